"""The page in a browser: what a click asks for is shown."""

import time

import numpy as np
import pytest
from builders.chromium import chromium
from builders.seen_house import CURVES, views_only, with_rooms
from viewcell.workbench.curves.series import Curves
from viewcell.workbench.report.web_page import page


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    """Headless Chromium with a profile of its own."""
    yield from chromium(tmp_path_factory.mktemp("chromium"), "disable-gpu")


class Page:
    """A page that is open in a browser."""

    def __init__(self, browser, made, folder, curves=None):
        path = folder / "page.html"
        path.write_text(page(made, "house", curves), encoding="utf-8")
        self.browser, self.made = browser, made
        browser.get(f"{path.as_uri()}?{time.monotonic_ns()}")
        deadline = time.monotonic() + 20
        while not self.run("return document.documentElement.dataset.ready") and time.monotonic() < deadline:
            time.sleep(0.02)
        self.settle()

    def run(self, script, *arguments):
        return self.browser.execute_script(script, *arguments)

    def settle(self):
        self.browser.execute_async_script("requestAnimationFrame(() => requestAnimationFrame(arguments[0]))")

    def one(self, selector):
        return self.browser.find_element("css selector", selector)

    def text(self, selector):
        return self.one(selector).text

    def place(self, box):
        """Pixels of a box's middle in the plan, from its upper left corner."""
        x, y, scale = map(float, self.one("#plan").get_attribute("data-view").split())
        width, height = self.run("const c = document.getElementById('plan'); return [c.clientWidth, c.clientHeight]")
        middle = (box[0] + box[1]) / 2
        return width / 2 + (middle[0] - x) * scale, height / 2 - (middle[1] - y) * scale

    def click(self, box):
        from selenium.webdriver.common.action_chains import ActionChains

        x, y = self.place(box)
        plan = self.one("#plan")
        ActionChains(self.browser, duration=20).move_to_element_with_offset(
            plan, round(x - plan.size["width"] / 2), round(y - plan.size["height"] / 2)
        ).click().perform()
        self.settle()

    def colours(self, box):
        """Colours in the plan about a box's lower left quarter, where no label is, as a set of #rrggbb."""
        x, y = self.place(np.stack([box[0], (box[0] + box[1]) / 2]))
        found = self.run(
            "return Array.from(document.getElementById('plan').getContext('2d')"
            ".getImageData(arguments[0] - 8, arguments[1] - 8, 16, 16).data)",
            round(x),
            round(y),
        )
        pixels = np.array(found, np.uint8).reshape(-1, 4)[:, :3]
        return {"#" + bytes(pixel).hex() for pixel in np.unique(pixels, axis=0)}

    def numbers(self):
        """Rows of the view cell's table: name, then potential, seen, unknown."""
        rows = "[...document.querySelectorAll('#cell-numbers .with-bar')]"
        found = self.run(f"return {rows}.map(row => [...row.cells].map(cell => cell.innerText))")
        return {row[0]: [int(text.replace(",", "")) for text in row[1:4]] for row in found}

    def complaints(self):
        return [entry["message"] for entry in self.browser.get_log("browser") if entry["level"] == "SEVERE"]


def test_a_browser_shows_what_is_clicked(browser, house, tmp_path):
    """The plan's colours, the numbers and the target's card follow the clicks."""
    shown = Page(browser, house, tmp_path, Curves.of_content(CURVES))
    cells = house.graph.cells
    assert not shown.complaints() and shown.run("return performance.getEntriesByType('resource').length") == 0
    shown.one("#portals").click()
    for cell in (2, 0):
        shown.click(cells[cell])
        assert shown.text("#cell-title") == f"Cell {cell} ({house.graph.cell_names[cell]})"
        potential = house.potential_cells[cell]
        rows = [row for row in house.cell_to_cell.to_pylist() if row["cell_id"] == cell and row["verdict"] == "visible"]
        seen = {row["reached_cell_id"] for row in rows}
        for name, chosen in (("Inhabitable cells", house.graph.inhabitable), ("Other cells", ~house.graph.inhabitable)):
            wanted = int((potential & chosen).sum()), sum(bool(chosen[t]) for t in seen)
            assert shown.numbers()[name] == [*wanted, wanted[0] - wanted[1]]
        assert shown.numbers()["Objects"][0] == house.potential_objects[cell].sum()
    # Cell 0 has lost its witness of cell 4, which is hatched, sees cell 2, and not cell 5.
    assert not house.potential_cells[0, 5] and "#d55e00" in shown.colours(cells[0])
    assert "#a9d8f3" in shown.colours(cells[2]) and shown.colours(cells[5]) == {"#ffffff"}
    assert "#f6d38a" in shown.colours(cells[4]) and len(shown.colours(cells[4])) > 1
    assert shown.text("#targets").startswith("4 · study")
    # Targets: seen, with its sightline through the doorway; unknown; hidden.
    shown.one("input[value=inspect]").click()
    shown.click(cells[2])
    assert "VISIBLE" in shown.text("#target") and "Through 2 portals: cell 0" in shown.text("#target")
    assert "portal 0 → cell 1 → portal 1 → cell 2" in shown.text("#target")
    shown.click(cells[4])
    assert "UNKNOWN" in shown.text("#target") and "portal 0" not in shown.text("#target")
    shown.click(cells[5])
    assert "HIDDEN" in shown.text("#target") and shown.text("#cell-title") == "Cell 0 (hall)"
    # A target may become the view cell; its own sightlines are found, beyond the row without one.
    shown.click(cells[2])
    shown.one("#target button").click()
    assert shown.text("#cell-title") == "Cell 2 (room)" and not shown.one("#target").is_displayed()
    shown.click(cells[4])
    assert "Through 2 portals: cell 2 → portal 2 → cell 3 → portal 3 → cell 4" in shown.text("#target")
    shot = tmp_path / "shot.png"
    assert browser.save_screenshot(str(shot)) and shot.stat().st_size > 20_000
    assert not shown.complaints()


def test_a_browser_obeys_lists_tables_and_keys(browser, house, tmp_path):
    shown = Page(browser, house, tmp_path, Curves.of_content(CURVES))
    from selenium.webdriver.common.keys import Keys

    # The worst cell is chosen first: cell 0, the only one with something unknown; another heading sorts anew.
    assert shown.text("#cell-title") == "Cell 0 (hall)"
    assert shown.text("#worst tbody tr td").strip() == "0"
    assert shown.one("#worst th[aria-sort]").text.startswith("overestimate")
    shown.one("#worst th button[data-key=name]").click()
    names = shown.run("return [...document.querySelectorAll('#worst tbody tr')].map(r => r.cells[1].innerText)")
    assert names == ["hall", "room", "store", "study"]
    shown.one("#worst tbody tr:last-child button").click()
    assert shown.text("#cell-title") == "Cell 4 (study)"
    # Arrow keys go to the view cell beside; an id or a name does, too; nonsense is said to be.
    shown.one("#plan").send_keys(Keys.ARROW_LEFT)
    assert shown.text("#cell-title") == "Cell 2 (room)"
    field = shown.one("#cell-input")
    for typed, title in (("5", "Cell 5 (store)"), ("hall", "Cell 0 (hall)"), ("1", "Cell 0 (hall)")):
        field.clear()
        field.send_keys(typed, Keys.TAB)
        assert shown.text("#cell-title") == title
    assert 'No view cell has the id or name "1"' in shown.text("#picker-error")
    shown.one("#next").click()
    assert shown.text("#cell-title") == "Cell 2 (room)"
    # The list of what is seen; a target of it.
    shown.one(".tabs button[data-verdict='2']").click()
    shown.one("#targets button").click()
    assert "VISIBLE" in shown.text("#target") and "Sightline of" in shown.text("#target")
    # Curves: the front leaves out the slow, loose point and what hides visible things.
    assert len(browser.find_elements("css selector", "#curves .on-front")) == 2
    assert "sampling" not in shown.text("#curves svg")
    assert not shown.complaints()


def test_a_browser_shows_what_a_room_sees(browser, house, tmp_path):
    """The room is found by its name; its view cells are the source, and their sets together are shown."""
    shown = Page(browser, with_rooms(house), tmp_path)
    cells = house.graph.cells
    shown.one("#portals").click()
    shown.one("#search").send_keys("suite")
    shown.one("#found button").click()
    shown.settle()
    assert shown.text("#cell-title") == "Room suite, Ground"
    assert "2 view cells (2, 4) together; they hold 90 %" in shown.text("#cell-facts")
    assert shown.numbers()["Objects"][0] == house.potential_objects[[2, 4]].any(axis=0).sum()
    wanted = int((house.potential_cells[[2, 4]].any(axis=0) & house.graph.inhabitable).sum())
    assert shown.numbers()["Inhabitable cells"][0] == wanted
    assert all("#d55e00" in shown.colours(cells[cell]) for cell in (2, 4)) and "#a9d8f3" in shown.colours(cells[0])
    assert not shown.complaints()


def test_a_browser_shows_objects_of_view_cells(browser, tmp_path):
    made = views_only(tmp_path)
    shown = Page(browser, made, tmp_path)
    assert shown.text("#cell-title") == "Cell 0 (hall)" and list(shown.numbers()) == ["Objects"]
    potential = int(made.potential_objects[0].sum())
    assert shown.numbers()["Objects"] == [potential, potential - 1, 1]
    assert not shown.one("#layers").is_displayed() and not shown.one("#portals").is_displayed()
    lost = int(made.cell_to_object.to_pylist()[0]["object_id"])
    assert shown.text("#targets").startswith(f"{lost} ·")
    shown.one("#targets button").click()
    assert "UNKNOWN" in shown.text("#target")
    # The desk (object 17) lies on the plan of the study; it may be asked about.
    shown.one("input[value=inspect]").click()
    shown.click(made.scene.object_bounds()[17])
    assert shown.text("#target").startswith("Object 17")
    assert not shown.complaints()
