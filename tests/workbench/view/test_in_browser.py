"""The viewer in a browser: what it says and draws is what the bake says."""

import base64
import functools
import http.server
import io
import shutil
import threading
import time
from contextlib import contextmanager

import numpy as np
import pytest
from builders.chromium import chromium
from builders.far_bake import far_bake, far_walk
from viewcell.data.buildings.office import make_office
from viewcell.data.scene import OPAQUE
from viewcell.verify.rays.embree import embree_scene
from viewcell.workbench.bake.run import bake
from viewcell.workbench.bake.settings import Settings
from viewcell.workbench.pack.run import pack
from viewcell.workbench.view.run import view
from viewcell.workbench.walk.pages import frames_csv
from viewcell.workbench.walk.path import read_path
from viewcell.workbench.walk.run import walk as walked


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    """Headless Chromium that draws WebGL on the processor."""
    profile = tmp_path_factory.mktemp("chromium")
    yield from chromium(profile, "use-angle=swiftshader", "enable-unsafe-swiftshader", "ignore-gpu-blocklist")


@pytest.fixture(scope="module")
def folder(walk, built, tmp_path_factory):
    return view(walk, tmp_path_factory.mktemp("view") / "office.view").page.parent


@contextmanager
def served(folder, seconds=0.0):
    """Address of a view on a server, which waits for so long before each chunk."""

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *_):
            pass

        def do_GET(self):
            time.sleep(seconds if "geometry" in self.path else 0)
            super().do_GET()

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=folder))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{server.server_port}/index.html"
    finally:
        server.shutdown()
        server.server_close()


class Shown:
    """A view that is open in a browser."""

    def __init__(self, browser, address):
        self.browser = browser
        browser.get_log("browser")
        browser.get(f"{address}?{time.monotonic_ns()}")
        self.until("return document.documentElement.dataset.ready || document.documentElement.dataset.failed")

    def run(self, script, *arguments):
        return self.browser.execute_script(script, *arguments)

    def until(self, script, seconds=60):
        deadline = time.monotonic() + seconds
        while not (found := self.run(script)) and time.monotonic() < deadline:
            time.sleep(0.02)
        assert found, script

    def choose(self, name, value):
        """Choose something, and wait until it is drawn."""
        frames = self.run("return viewer.frames ?? 0")
        self.run("viewer.choose(arguments[0], arguments[1])", name, value)
        self.until(f"return viewer.frames > {frames} && viewer.cell === viewer.visitor.cell")

    def picture(self, yaw):
        """What is seen from inside in a direction, shape (height, width, 3), int."""
        from PIL import Image

        # Drawn and read at once: a picture of the page may be of the frame before.
        drawn = self.run(
            "viewer.visitor.yaw = arguments[0];"
            "if (viewer.cell !== viewer.visitor.cell) viewer.enter();"
            "viewer.stage.draw(viewer.visitor, viewer.chosen.view, viewer.chosen.height);"
            "return viewer.canvas.toDataURL('image/png')",
            yaw,
        )
        data = base64.b64decode(drawn.partition(",")[2])
        return np.asarray(Image.open(io.BytesIO(data)).convert("RGB")).astype(int)

    def complaints(self):
        return [entry["message"] for entry in self.browser.get_log("browser") if entry["level"] == "SEVERE"]


@pytest.fixture
def shown(browser, folder):
    return Shown(browser, (folder / "index.html").as_uri())


def test_it_opens_by_a_double_click(shown, walk):
    assert shown.run("return document.documentElement.dataset.ready") == "1"
    assert shown.complaints() == []
    start = shown.run("return viewer.database.cellIds[viewer.visitor.cell]")
    row = walk.row_of(start)
    here = len(walk.potential.of(row))
    assert shown.run("return viewer.counts") == {"drawn": here, "potential": here, "objects": walk.objects.num_rows}
    text = shown.run("return document.getElementById('drawn').textContent")
    assert text.startswith(f"{here:,} drawn, {here:,} potential ({len(walk.unknown.of(row))} unknown)")


def test_every_view_cell_has_the_sets_of_the_bake(shown, walk, office):
    found = shown.run(
        "const d = viewer.database; return [...d.viewCells].map((cell) => "
        "[d.cellIds[cell], d.setOf(cell).potential, [...d.setOf(cell).unknown], "
        "d.cellsOf(cell).map((one) => d.cellIds[one])])"
    )
    ids = walk.objects["object_id"].to_numpy()
    assert sorted(cell for cell, *_ in found) == np.flatnonzero(office.graph.inhabitable).tolist()
    for cell, potential, unknown, cells in found:
        assert sorted(ids[potential]) == office.potential(cell).tolist()
        assert sorted(ids[unknown]) == office.unknown(cell).tolist()
        assert sorted(cells) == np.flatnonzero(office.cell_sets[cell]).tolist()


@pytest.fixture(scope="module")
def met(office, walk):
    """Ids of all that rays through some pixels of what is shown meet first, with what is transparent and without."""
    ids, rng = walk.objects["object_id"].to_numpy(), np.random.default_rng(0)
    display = np.empty(len(ids), np.int64)
    display[ids] = np.arange(len(ids))
    scenes = []
    for roles in (OPAQUE, ()):
        triangles, owners = office.scene.triangles(*roles)
        scenes.append((embree_scene(triangles), owners))

    def through(shown, rows, columns, size):
        point, corners = shown.run(
            "return [viewer.visitor.point, viewer.stage.corners().map((way) => way.toArray())]"
        )  # fmt: skip
        # Of one depth along the view, so that pixels are even steps between them.
        corners = np.array(corners)
        a, b, c, d = corners / (corners @ corners.sum(axis=0))[:, None]
        found = set()
        for row, column in zip(rows, columns, strict=True):
            u, v = (column + rng.random((1000, 1))) / size[1], 1 - (row + rng.random((1000, 1))) / size[0]
            ways = ((a * (1 - u) + b * u) * (1 - v) + (d * (1 - u) + c * u) * v).astype(np.float32)
            origins = np.repeat(np.float32([point]) / np.float32(office.grid_m), len(ways), axis=0)
            for scene, owners in scenes:
                hits = scene.run(origins, ways)
                found |= set(display[owners[hits[hits >= 0]]].tolist())
        return found

    return through


@pytest.mark.slow
def test_the_set_draws_what_the_whole_model_draws(shown, met):
    """From several eyes and directions. Where pixels differ rays adjudicate: it is a crack where members abut.

    A rasteriser leaves such cracks, and only the whole model has something to show through them; so a thousand rays
    through the pixel must meet members alone.
    """
    shown.choose("view", "inside")
    cells = shown.run("return [...viewer.database.viewCells]")
    differing = pixels = 0
    for cell in cells[::3]:
        shown.choose("cell", cell)
        members = set(shown.run("return viewer.database.setOf(viewer.visitor.cell).potential"))
        for yaw in (0.3, 2.4):
            pictures = []
            for mode in ("set", "whole"):
                shown.choose("mode", mode)
                pictures.append(shown.picture(yaw))
            some, every = pictures
            assert np.ptp(every, axis=(0, 1)).max() > 10, "nothing is drawn"
            rows, columns = np.nonzero(np.abs(some - every).max(axis=2) > 8)
            assert met(shown, rows, columns, some.shape) <= members
            differing, pixels = differing + len(rows), pixels + some.shape[0] * some.shape[1]
    assert pixels > 10**6 and differing < 1e-4 * pixels, (differing, pixels)


def test_what_rays_of_an_eye_meet_is_what_the_eye_sees(shown, office, walk):
    """Rays through the picture's pixels; the eye stands in rooms, beside walls and within doorways."""
    shown.choose("mode", "eye")
    shown.choose("view", "inside")
    triangles, owners = office.scene.triangles(*OPAQUE)
    display = np.empty(len(walk.objects), np.int64)
    display[walk.objects["object_id"].to_numpy()] = np.arange(len(display))
    embree, rng = embree_scene(triangles), np.random.default_rng(0)
    kept = potential = 0
    for cell in shown.run("return [...viewer.database.viewCells]"):
        for yaw in rng.uniform(0, 6.3, 3):
            seen, point, corners, all_of = shown.run(
                "const [cell, yaw, steps] = arguments; const v = viewer.visitor; "
                "v.goTo(cell); v.yaw = yaw; viewer.enter();"
                "for (let k = 0; k < steps; k++) v.walk(0.1, 1, 0, 1.6);"
                "if (viewer.cell !== v.cell) viewer.enter(); viewer.look();"
                "return [[...viewer.stage.inside.shown.keys()].filter((id) => viewer.stage.inside.shown[id]), v.point,"
                "viewer.stage.corners().map((way) => way.toArray()), viewer.counts.potential]",
                cell, float(yaw), int(rng.integers(0, 40)),
            )  # fmt: skip
            u, v = rng.random((2, 5000, 1))
            a, b, c, d = np.array(corners) / np.linalg.norm(corners, axis=1)[:, None]
            ways = ((a * (1 - u) + b * u) * (1 - v) + (d * (1 - u) + c * u) * v).astype(np.float32)
            origins = np.repeat(np.float32([point]) / np.float32(office.grid_m), len(ways), axis=0)
            hits = embree.run(origins, ways)
            met = np.unique(display[owners[hits[hits >= 0]]])
            assert set(met) <= set(seen), (point, yaw, set(met) - set(seen))
            kept, potential = kept + len(seen), potential + all_of
    assert kept < 0.6 * potential


def test_a_set_that_lacks_a_wall_is_seen_to(shown, met):
    """The comparison above is one that can fail: pixels differ, and rays through them meet what is not shown."""
    shown.choose("view", "inside")
    whole = shown.picture(0.3)
    walls = "[...viewer.database.head.names.keys()].filter((id) => /wall/i.test(viewer.database.head.names[id]))"
    lacks = shown.run(f"const left = viewer.stage.inside.shown.slice(); for (const id of {walls}) left[id] = 0;"
                      "viewer.stage.inside.show(left, (id) => viewer.stage.inside.items[id]);"
                      f"return {walls};")  # fmt: skip
    differs = np.abs(shown.picture(0.3) - whole).max(axis=2) > 8
    assert differs.mean() > 0.01
    rows, columns = np.nonzero(differs)
    assert met(shown, rows[::5000], columns[::5000], whole.shape) & set(lacks)
    # Where nothing differs, the floor, no wall is met.
    assert not met(shown, [len(whole) - 2], [whole.shape[1] // 2], whole.shape) & set(lacks)


def test_walls_stop_and_doors_do_not(shown, office):
    """From the middle of each room in eight directions: nobody comes to where there is no way through portals."""
    found = shown.run(
        """
        const { visitor, database } = viewer;
        const out = [];
        for (const cell of database.viewCells) {
          for (let k = 0; k < 8; k++) {
            visitor.goTo(cell);
            visitor.yaw = (k * Math.PI) / 4 + 0.1;
            const met = new Set([cell]);
            for (let n = 0; n < 80; n++) { visitor.walk(0.1, 1, 0, 1.6); met.add(visitor.cell); }
            out.push([visitor.point, database.cellIds[visitor.cell], [...met].map((one) => database.cellIds[one])]);
          }
        }
        return out;
        """
    )
    links = {frozenset(pair) for pair in office.graph.portal_cells.tolist()}
    crossed = 0
    for point, cell, met in found:
        box = office.graph.cells[cell] * office.grid_m
        assert (np.array(point) >= box[0] - 1e-6).all() and (np.array(point) <= box[1] + 1e-6).all()
        for one in met:
            assert one == met[0] or any(frozenset((one, other)) in links for other in met)
        crossed += len(met) > 1
        # Eyes are as high above the floor as eyes are, whatever furniture there is.
        assert abs(point[2] - 1.65) < 0.02, point
    assert crossed > 3


def test_keys_walk_and_choose(shown):
    from selenium.webdriver.common.keys import Keys

    canvas = shown.browser.find_element("css selector", "body")
    before = shown.run("return viewer.visitor.point.slice()")
    shown.run("dispatchEvent(new KeyboardEvent('keydown', { code: 'KeyW' }))")
    shown.until(
        f"return Math.hypot(viewer.visitor.point[0] - {before[0]}, viewer.visitor.point[1] - {before[1]}) > 0.05"
    )
    shown.run("dispatchEvent(new KeyboardEvent('keyup', { code: 'KeyW' }))")
    canvas.send_keys("v")
    shown.until("return document.getElementById('view').value === 'above'")
    canvas.send_keys("m")
    shown.until(
        "return document.getElementById('mode').value === 'eye' && viewer.counts.drawn < viewer.counts.potential"
    )
    canvas.send_keys("m")
    shown.until(
        "return document.getElementById('mode').value === 'whole' && viewer.counts.drawn === viewer.counts.objects"
    )
    room = shown.browser.find_element("css selector", "#room")
    name = shown.run("return viewer.database.rooms()[2].name")
    room.send_keys(name + Keys.ENTER)
    shown.until("return viewer.visitor.cell === viewer.database.rooms()[2].cell")
    # What is typed into a field walks nowhere.
    assert shown.run("return viewer.keys.down.size") == 0
    room.clear()
    room.send_keys("nowhere" + Keys.ENTER)
    shown.until("return document.getElementById('note').textContent === 'no room is called nowhere'")


def test_from_above_verdicts_have_colours(shown):
    shown.choose("view", "above")
    shown.choose("height", shown.run("return viewer.stage.bounds[5] - 0.6"))
    coloured = shown.picture(0.0)
    shown.choose("colours", "model")
    plain = shown.picture(0.0)
    assert (np.abs(coloured - plain).max(axis=2) > 20).mean() > 0.05
    shown.choose("outlines", True)
    assert (np.abs(shown.picture(0.0) - plain).max(axis=2) > 20).mean() > 0.001
    assert shown.complaints() == []


@pytest.fixture(scope="module")
def certified(built, tmp_path_factory):
    out = tmp_path_factory.mktemp("certified") / "office.bake"
    made = bake(make_office(floors=1, rooms_per_side=3), out, settings=Settings(certify=True), threads=1)
    return view(made.folder, out.with_suffix(".view")).page.parent


def test_why_something_is_seen_or_not(browser, certified):
    """A click on what one sees: its sightline. From above on what is hidden: what the proof names. Esc ends it."""
    shown = Shown(browser, (certified / "index.html").as_uri())
    shown.choose("view", "inside")
    shown.browser.find_element("id", "canvas").click()
    shown.until("return !document.getElementById('why').hidden")
    found = shown.run("return { ...viewer.inquiry.found, id: viewer.inquiry.asked.id, cell: viewer.cell }")
    assert found["verdict"] == "seen" and "A sightline of" in found["text"] and found["clear"]["distance"] > 0
    box, to = found["box"], found["line"]["to"]
    assert all(box[k] - 0.01 <= to[k] <= box[k + 3] + 0.01 for k in range(3))
    shown.run("viewer.choose('object', viewer.database.head.names.findIndex((_, id) =>"
              "!viewer.database.isPotential(viewer.cell, id) && viewer.database.triangleCounts[id]))")  # fmt: skip
    shown.until("return viewer.inquiry.found.verdict === 'hidden'")
    assert shown.run("return viewer.inquiry.found.corners.length") >= 12
    assert shown.run("return document.getElementById('why-text').textContent").startswith("Proved hidden: ")
    # From elsewhere the answer is another one.
    for cell in shown.run("return [...viewer.database.viewCells]"):
        shown.choose("cell", cell)
        shown.until("return viewer.inquiry.from === viewer.visitor.cell")
        cells = shown.run("return [...viewer.database.reachOf(viewer.cell)].length")
        assert shown.run("return viewer.inquiry.found.verdict") in ("seen", "unknown", "hidden") and cells
    room = shown.run("return viewer.database.rooms()[0].cell")
    shown.run("viewer.choose('room', arguments[0])", room)
    shown.until("return viewer.inquiry.asked.kind === 'cell' && viewer.inquiry.from === viewer.cell")
    shown.run("dispatchEvent(new KeyboardEvent('keydown', { code: 'Escape' }))")
    shown.until("return document.getElementById('why').hidden && viewer.stage.marks.solid.length === 0")
    assert shown.complaints() == []


def test_reasons_that_cannot_be_read_are_said(browser, folder, tmp_path):
    shutil.copytree(folder, tmp_path / "v")
    (tmp_path / "v" / "why.js").unlink()
    shown = Shown(browser, (tmp_path / "v" / "index.html").as_uri())
    shown.run("viewer.choose('object', 0)")
    shown.until("return document.getElementById('note').textContent === "
                "'No reason can be given: why.js cannot be read'")  # fmt: skip


def test_a_tour_of_walk_is_replayed_and_a_recording_is_walked(shown, walk, tmp_path):
    """Python's path in the page, its eyes where Python had them; what the page records is a path for Python."""
    made = walked(walk.folder, frames=60, seed=3)
    text = frames_csv(made).decode()
    shown.run("viewer.choose('record'); viewer.choose('pace', 2); viewer.choose('path', arguments[0])", text)
    shown.run("globalThis.at = []; const { tour } = viewer; const tick = tour.tick.bind(tour);"
              "tour.tick = (visitor, s) => {"
              "const goes = tick(visitor, s); if (goes) at.push([tour.t, ...visitor.point, 0, visitor.cell]);"
              "return goes; }")  # fmt: skip
    shown.until("return viewer.tour.frames === null")
    found = np.array(shown.run("return at"))
    path = made.path
    times = np.minimum(found[:, 0], path.t[-1] - path.t[0]) + path.t[0]
    eyes = np.stack([np.interp(times, path.t, path.eyes[:, axis]) for axis in range(3)], axis=1)
    assert len(found) > 5 and np.abs(found[:, 1:4] - eyes).max() < 1e-6
    assert (found[:, 5] >= 0).all() and len(set(found[:, 5])) > 1
    recorded = tmp_path / "path.csv"
    recorded.write_text(shown.run("return viewer.tour.record(0)"))
    again = read_path(recorded)
    assert len(again) > 3 and walked(walk.folder, recorded).ok
    shown.run("viewer.choose('path', 'x,y\\n1,2')")
    assert shown.run("return document.getElementById('note').textContent").startswith("path: expected the column z")
    assert shown.complaints() == []


def test_what_memory_holds_has_colours(shown):
    """In a small memory what is needed is read, the rest given up; its bound is never passed."""
    shown.choose("colours", "memory")
    shown.choose("cache", 0.013)
    seen = set()
    for cell in shown.run("return [...viewer.database.viewCells]"):
        shown.choose("cell", cell)
        shown.until("return viewer.ahead.busy === 0 && !viewer.ahead.stale")
        held, states, reach, chunks = shown.run(
            "const { ahead, database } = viewer; const { memory } = ahead; const states = {};"
            "const ids = [...database.head.names.keys()];"
            "for (const id of ids) for (const now of [0, Infinity]) states[ahead.stateOf(id, now)] = 1;"
            "return [memory.claimed, Object.keys(states), ahead.cells, memory.state.reduce((a, b) => a + (b > 0), 0)]"
        )
        assert 0 < held <= 13_000 and chunks > 1
        seen |= set(states)
        assert reach[0] == [cell, 0] and all(0 <= far <= 2 for _, far in reach)
    assert shown.run("return viewer.ahead.memory.fetched") > 13_000
    assert seen >= {"resident", "read", "release"} and seen & {"ahead", "absent"}
    shown.choose("view", "above")
    assert shown.complaints() == []


def test_names_of_rooms_stand_where_they_are_cut_open(shown):
    """None hides another, none is of another storey, and none is there from inside."""
    shown.choose("view", "above")
    names = "[...document.querySelectorAll('#labels-over span:not([hidden])')]"
    found = shown.run(f"return {names}.map((one) => [one.textContent, one.getBoundingClientRect().toJSON()])")
    rooms = shown.run("return viewer.database.rooms().map(({ name }) => name)")
    assert len(found) > 4 and {name for name, _ in found} <= set(rooms)
    for k, (_, a) in enumerate(found):
        assert all(
            a["right"] <= b["left"] or b["right"] <= a["left"] or abs(a["top"] - b["top"]) > 10 for _, b in found[:k]
        )
    shown.choose("height", shown.run("return viewer.stage.bounds[2]"))
    assert shown.run(f"return {names}.length") == 0
    shown.choose("height", shown.run("return viewer.storeyTop()"))
    assert shown.run(f"return {names}.length") == len(found)
    shown.choose("view", "inside")
    assert shown.run(f"return {names}.length") == 0


def test_overlays_of_the_wedge_and_of_back_faces(shown):
    shown.choose("view", "inside")
    plain = shown.picture(0.3)
    shown.choose("colours", "backs")
    # No eye of the cell sees what faces away from all of it.
    assert (np.abs(shown.picture(0.3) - plain).max(axis=2) > 8).mean() < 1e-3
    shown.choose("view", "above")
    backs = shown.picture(0.3)
    shown.choose("colours", "model")
    assert (np.abs(shown.picture(0.3) - backs).max(axis=2) > 20).mean() > 0.001
    shown.choose("wedge", True)
    ends = shown.run("return [...viewer.stage.lines.wedge.mesh.geometry.attributes.position.array]")
    point = shown.run("return viewer.visitor.point")
    # From the eye to corners of what of portals is in sight, and along their edges.
    assert len(ends) >= 36 and np.allclose(np.reshape(ends, (-1, 4, 3))[:, 0], point, atol=1e-3)
    shown.choose("wedge", False)
    shown.choose("view", "inside")
    assert (np.abs(shown.picture(0.3) - plain).max(axis=2) > 8).mean() < 1e-3
    assert shown.complaints() == []


def test_stabbing_lines_are_the_bakes(shown, office):
    """As many as the cell sees others, from it to them; when they are not asked for, none."""
    shown.choose("sequences", True)
    rows = office.cell_to_cell.to_pylist()
    for cell in shown.run("return [...viewer.database.viewCells]")[::2]:
        shown.choose("cell", cell)
        own = shown.run("return viewer.database.cellIds[viewer.cell]")
        seen = [row for row in rows if row["cell_id"] == own != row["reached_cell_id"] and row["verdict"] == "visible"]
        lines = "viewer.stage.lines.stabs.mesh.geometry.attributes.position.array"
        shown.until(f"return {lines}.length === {6 * len(seen)}")
        found = np.reshape(shown.run(f"return [...{lines}]"), (-1, 6))
        low, high = office.graph.cells[own] * office.grid_m
        assert len(seen) and (found[:, :3] >= low - 1e-3).all() and (found[:, :3] <= high + 1e-3).all()
        assert shown.run("return viewer.stage.lines.stabbed.mesh.visible")
    shown.choose("sequences", False)
    shown.until(f"return {lines}.length === 0")


def test_edges_are_darker_and_go_with_what_has_them(browser, streamed):
    shown = Shown(browser, (streamed / "index.html").as_uri())
    shown.choose("view", "inside")
    shown.until(SETTLED)
    # Lines take the processor long; who draws with one is not asked to wait.
    assert shown.run("return viewer.stage.slow && !viewer.chosen.edges")
    plain = shown.picture(0.3)
    shown.choose("edges", True)
    lined = shown.picture(0.3).sum(axis=2) - plain.sum(axis=2)
    assert (lined < -20).mean() > 0.002 and (lined > 20).mean() < 1e-4
    total = shown.run("return viewer.database.chunkIds.reduce((sum, k) => sum + viewer.database.chunkBytes(k), 0)")
    shown.choose("cache", total / 4e6)
    for cell in shown.run("return [...viewer.database.viewCells]"):
        shown.choose("cell", cell)
        shown.until(SETTLED)
    kept, left = shown.run(
        "const [{ shapes, edges }] = viewer.stage.inside.parts;"
        "return [edges.shapes.size, [...edges.shapes.keys()].filter((item) => !shapes.has(item)).length]"
    )
    assert kept > 0 and left == 0
    shown.choose("edges", False)
    assert shown.complaints() == []


def test_keyboard_alone(shown):
    """Looking up and down, turning and cutting the view from above."""
    press = "dispatchEvent(new KeyboardEvent(arguments[1] ?? 'keydown', { code: arguments[0] }))"
    shown.run(press, "PageUp")
    shown.until("return viewer.visitor.pitch > 0.05")
    shown.run(press, "PageUp", "keyup")
    before = shown.run("return [viewer.stage.orbit.turn, viewer.stage.orbit.away, viewer.chosen.height]")
    for key in ("KeyQ", "Equal", "BracketLeft", "KeyG", "KeyN", "KeyF"):
        shown.run(press, key)
    after = shown.run("return [viewer.stage.orbit.turn, viewer.stage.orbit.away, viewer.chosen.height]")
    assert all(a != b for a, b in zip(before, after, strict=True))
    assert shown.run("return [viewer.chosen.wedge, viewer.chosen.labels, viewer.chosen.freeze]") == [True, False, True]


def test_frozen_what_is_seen_stays(shown):
    shown.choose("mode", "eye")
    before = shown.run("return [viewer.counts, viewer.stage.corners().map((way) => way.toArray())]")
    shown.choose("freeze", True)
    other = shown.run("return viewer.database.rooms().at(-1).cell")
    shown.run("viewer.choose('cell', arguments[0]); viewer.visitor.yaw = 2", other)
    shown.until("return viewer.visitor.yaw === 2 && !viewer.stale && viewer.turned.startsWith('2 ')")
    shown.run("viewer.look()")
    assert shown.run("return [viewer.counts, viewer.stage.corners().map((way) => way.toArray())]") == before
    shown.choose("freeze", False)
    assert shown.run("return viewer.cell") == other


@pytest.fixture(scope="module")
def streamed(built, tmp_path_factory):
    """A view of a bake with levels, whose geometry lies in chunks."""
    out = tmp_path_factory.mktemp("streamed") / "office.bake"
    made = bake(make_office(floors=1, rooms_per_side=3), out, settings=Settings(lods=True), threads=1)
    walk = pack(made.folder, flatten=True)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("viewcell.workbench.view.run.STREAMED", 0)
        return view(walk, out.with_suffix(".view")).page.parent


SETTLED = "return viewer.ahead.busy === 0 && !viewer.ahead.stale && !viewer.restage"


def test_levels_follow_the_frame_time(browser, streamed):
    """What takes too long is drawn coarser, what is quick again finer; colours say at which level."""
    shown = Shown(browser, (streamed / "index.html").as_uri())
    shown.choose("view", "inside")
    shown.until(SETTLED)
    fine = shown.run("return viewer.stage.inside.triangles")
    shown.choose("colours", "levels")
    shown.choose("target", 20)
    found = shown.run("for (let k = 0; k < 60; k++) viewer.levels.heard(100); viewer.look();"
                      "return [viewer.stage.inside.triangles, viewer.levels.tolerance]")  # fmt: skip
    assert found[0] < 0.8 * fine and found[1] == 64
    coarse = shown.picture(0.3)
    shown.run("for (let k = 0; k < 200; k++) viewer.levels.heard(1); viewer.look()")
    assert fine >= shown.run("return viewer.stage.inside.triangles") > found[0]
    shown.choose("target", 0)
    assert shown.run("return viewer.stage.inside.triangles") == fine
    assert (np.abs(shown.picture(0.3) - coarse).max(axis=2) > 8).any()


@pytest.mark.parametrize("scheme", ["file", "http"])
def test_geometry_streams_within_its_memory(browser, streamed, scheme):
    """Chunks come as they are looked ahead to, and go; what is here is drawn, and what the set holds comes at last."""
    with served(streamed) as address:
        shown = Shown(browser, address if scheme == "http" else (streamed / "index.html").as_uri())
        shown.choose("view", "inside")
        total = shown.run("return viewer.database.chunkIds.reduce((sum, k) => sum + viewer.database.chunkBytes(k), 0)")
        shown.choose("cache", total / 2e6)
        for cell in shown.run("return [...viewer.database.viewCells]"):
            shown.choose("cell", cell)
            shown.until(SETTLED)
            claimed, held, missing = shown.run(
                "return [viewer.ahead.memory.claimed, [...viewer.database.parts.values()].reduce((sum, part) => "
                "sum + part.length, 0), viewer.missing]"
            )
            assert held == claimed <= total / 2 and missing == 0
        assert shown.complaints() == []


def test_a_missing_chunk_is_said_and_walked_past(browser, streamed, tmp_path):
    shutil.copytree(streamed, tmp_path / "v")
    for chunk in (0, 1, 2):
        (tmp_path / "v" / f"geometry-{chunk}.js").unlink()
    (tmp_path / "v" / "geometry-3.js").write_text('viewcellChunks.set(3,"AAAA");')
    shown = Shown(browser, (tmp_path / "v" / "index.html").as_uri())
    shown.until("return viewer.ahead.misses >= 4")
    note = shown.run("return document.getElementById('note').textContent")
    assert note.endswith("what is drawn is what is there")
    shown.until(SETTLED)
    assert shown.run("return viewer.stage.inside.triangles") > 0
    assert "chunks failed" in shown.run("return document.getElementById('misses').textContent")


def test_a_slow_server_shows_what_has_come(browser, streamed):
    with served(streamed, seconds=0.3) as address:
        shown = Shown(browser, address)
        waiting = shown.run("return [viewer.missing, viewer.frames ?? 0]")
        shown.until("return viewer.missing === 0")
        assert waiting[0] > 0 and shown.complaints() == []


@pytest.mark.slow
def test_a_long_replay_does_not_grow(browser, streamed):
    """Half an hour of a walk, sixty times as fast: what is held stays what it was after the first tenth."""
    made = walked(pack(streamed.with_suffix(".bake")), frames=18_000, seed=1)
    shown = Shown(browser, (streamed / "index.html").as_uri())
    shown.choose("view", "inside")
    shown.run("viewer.choose('pace', 60); viewer.choose('mode', 'eye'); viewer.choose('cache', 0.1);"
              "viewer.choose('path', arguments[0])", frames_csv(made).decode())  # fmt: skip
    held = []
    for share in (0.1, 0.4, 0.7, 0.95):
        shown.until(f"return !viewer.tour.frames || viewer.tour.t > {share * 1800}", 400)
        browser.execute_cdp_cmd("HeapProfiler.collectGarbage", {})
        held.append(shown.run(
            "return [performance.memory.usedJSHeapSize, viewer.stage.renderer.info.memory.geometries,"
            "viewer.stage.inside.meshes[0].geometry.attributes.position.count]"
        ))  # fmt: skip
    held = np.array(held)
    assert (held[1:, 0] < 1.25 * held[0, 0] + 4e6).all() and (held[:, 1:] <= held[0, 1:] * 1.5).all(), held


def test_through_a_server(browser, folder):
    with served(folder) as address:
        assert Shown(browser, address).run("return document.documentElement.dataset.ready") == "1"


@pytest.mark.parametrize("what", ["cut", "missing"])
def test_what_cannot_be_read_is_said(browser, folder, tmp_path, what):
    spoiled = tmp_path / "v"
    shutil.copytree(folder, spoiled)
    data = spoiled / "data.js"
    if what == "missing":
        data.unlink()
    else:
        head, _, packed = data.read_text().partition('"packed":"')
        data.write_text(f'{head}"packed":"{packed[: len(packed) // 2 // 4 * 4]}"}};')
    shown = Shown(browser, (spoiled / "index.html").as_uri())
    assert shown.run("return document.getElementById('note').textContent").startswith("This view cannot be shown: ")


def test_depth_meshes_show_what_is_far(browser, built, tmp_path_factory):
    """In place of what stands on them, from the middle of the view cell, but for a texel's worth at edges and light."""
    out = tmp_path_factory.mktemp("far")
    walk = far_walk(out, far_bake(out))
    shown = Shown(browser, (view(walk, out / "balls.view").page).as_uri())
    shown.choose("view", "inside")
    shown.run("viewer.visitor.goTo(0); viewer.visitor.point = [-1, 0, 0]")
    shown.choose("depth", True)
    shown.until("return viewer.far.group.children.length > 0 && !viewer.restage && !viewer.stale")
    assert shown.run("return viewer.far.triangles") == walk.depth_meshes.faces[0].sum()
    near = set(walk.depth_meshes.near_levels(0)[0].tolist())
    drawn = shown.run(
        "return Array.from(viewer.stage.inside.shown.keys()).filter((id) => viewer.stage.inside.shown[id])"
    )
    assert set(drawn) == near and len(near) < 40
    with_meshes = [shown.picture(yaw) for yaw in (0.0, 1.5, 3.0, 4.5)]
    shown.choose("depth", False)
    shown.until("return viewer.far.group.children.length === 0 && !viewer.restage && !viewer.stale")
    plain = [shown.picture(yaw) for yaw in (0.0, 1.5, 3.0, 4.5)]
    shown.choose("mode", "set")
    background = plain[0][2, 2]
    for one, other in zip(with_meshes, plain, strict=True):
        there, wanted = ((np.abs(picture - background) > 12).any(axis=2) for picture in (one, other))
        assert wanted.sum() > 1000 and (there != wanted).sum() < 0.1 * wanted.sum()
    assert shown.complaints() == []


def test_one_jumps_to_a_room_by_a_double_click_and_to_an_object_by_a_key(shown):
    """The middle of the floor of each room, as the picture from above has it; and a room's desk."""
    shown.choose("view", "above")
    cells = shown.run("return Array.from(viewer.database.viewCells)")
    reached = 0
    for cell in cells:
        shown.choose("cell", cells[0])
        shown.run(
            """
            const [cell] = arguments;
            const { stage, database, canvas } = viewer;
            const box = database.cellBoxes.subarray(6 * cell, 6 * cell + 6);
            const floor = stage.head.position.clone();
            floor.set((box[0] + box[3]) / 2, (box[1] + box[4]) / 2, box[2]).project(stage.sky);
            const [x, y] = [(floor.x + 1) / 2 * canvas.clientWidth, (1 - floor.y) / 2 * canvas.clientHeight];
            const { left, top } = canvas.getBoundingClientRect();
            const at = { clientX: left + x, clientY: top + y, bubbles: true };
            canvas.dispatchEvent(new MouseEvent("dblclick", at));
            """,
            cell,
        )
        reached += shown.run("return viewer.visitor.cell") == cell
    # Walls and furniture stand before some of them.
    assert reached > len(cells) / 2
    shown.choose("cell", cells[0])
    desk = shown.run("return viewer.database.head.names.findLastIndex((name) => /desk/i.test(name))")
    shown.choose("object", desk)
    shown.run("viewer.pressed('KeyJ')")
    held = shown.run(
        "const [at, box] = [viewer.visitor.cell, viewer.database.boxOf(arguments[0])];"
        "const middle = [0, 1].map((axis) => (box[axis] + box[axis + 3]) / 2);"
        "return viewer.database.maze.holds(at, [...middle, box[5] + 0.3])",
        desk,
    )
    assert held and shown.run("return viewer.visitor.cell") != cells[0]
