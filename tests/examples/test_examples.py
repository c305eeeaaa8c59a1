"""The examples do what they say: pages and scripts with stand-ins for their engines, the rest as it stands."""

import ast
import importlib.util
import json
import re

import numpy as np
import pytest
from builders.lobby_house import lobby_house
from builders.node import run_node
from builders.places import ROOT
from viewcell.workbench.baked import load

EXAMPLES = ROOT / "examples"
# As much of three.js as the page asks for. Nodes come from the bytes of the GLB; frames are drawn for given eyes.
THREE = """
import { readFileSync } from "node:fs";
const { glb, json, eyes } = JSON.parse(readFileSync(0, "utf-8"));
const bytes = readFileSync(glb);
const rows = JSON.parse(bytes.subarray(20, 20 + bytes.readUInt32LE(12))).nodes;
const placed = rows.map(({ extras = {} }) => ({ userData: extras, visible: true }));
let eyeOf;
const label = {};
globalThis.document = { body: { append() {} }, querySelector: () => label };
globalThis.innerWidth = globalThis.innerHeight = 100;
globalThis.fetch = async () => ({ json: async () => JSON.parse(readFileSync(json, "utf-8")) });
class GLTFLoader { loadAsync = async () => ({ scene: { traverse: (f) => placed.forEach(f) } }); }
class FlyControls { update() {} }
const THREE = {
  WebGLRenderer: class {
    domElement = {}; setSize() {} render() {}
    setAnimationLoop(frame) {
      const ids = (nodes) => nodes.map((node) => node.userData.id).filter((id) => id !== undefined);
      const shown = () => ids(placed.filter((node) => node.visible));
      const told = (eye) => { Object.assign(eyeOf.position, eye); frame(); return [label.textContent, shown()]; };
      console.log(JSON.stringify(eyes.map(told)));
    }
  },
  Scene: class { add() { return this; } },
  HemisphereLight: class {},
  PerspectiveCamera: class { constructor() { eyeOf = this; this.position = { set() {} }; } },
};
"""


@pytest.fixture(scope="module")
def lobby(tmp_path_factory):
    """A folder in which the cells of the notebook have run, and their names and last values."""
    folder = tmp_path_factory.mktemp("lobby")
    lobby_house(folder / "house.ifc")
    cells = json.loads((EXAMPLES / "lobby.ipynb").read_text(encoding="utf-8"))["cells"]
    names: dict = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        values = [run("".join(cell["source"]), names) for cell in cells if cell["cell_type"] == "code"]
    return folder, names, values


def run(code, names):
    """Run a cell; the value of its last line, if it is an expression."""
    lines = ast.parse(code).body
    last = lines.pop() if isinstance(lines[-1], ast.Expr) else None
    exec(compile(ast.Module(lines, []), "cell", "exec"), names)
    return None if last is None else eval(compile(ast.Expression(last.value), "cell", "eval"), names)


def test_the_notebook_tells_which_rooms_see_the_lobby(lobby):
    folder, names, values = lobby
    bake = load(folder / "house.bake")
    assert values[1]["name"].tolist() == ["Lobby", "Office", "Vault", "Cellar"]
    rooms = bake.rooms["name"].to_pylist()
    wanted = {
        rooms[row["room_id"]]: row["verdict"]
        for row in bake.room_to_room.to_pylist()
        if rooms[row["reached_room_id"]] == "Lobby" and rooms[row["room_id"]] != "Lobby"
    }
    found = names["seen_from"]
    assert dict(zip(found["name"], found["verdict"], strict=True)) == wanted
    # Doorways zigzag: nobody sees round two corners.
    assert "Office" in wanted and "Cellar" not in wanted
    kinds = [bake.scene.objects[number].kind for number in bake.potential("Lobby")]
    assert values[3].to_dict() == {kind: kinds.count(kind) for kind in set(kinds)}
    assert {"house.glb", "house.json"} <= {path.name for path in folder.iterdir()}


def eyes_in(bake):
    """(point of the model, view cell that holds it or None): in the middle of each, and around all."""
    cells = np.flatnonzero(bake.graph.inhabitable)
    middle = bake.in_model(bake.graph.cells[cells].mean(axis=1) * bake.grid_m)
    yield from zip(middle.tolist(), cells.tolist(), strict=True)
    yield [-1000.0, 5.0, 1.0], None
    yield [*middle[0][:2].tolist(), 50.0], None


def test_the_page_shows_what_the_cameras_cell_may_see(lobby, tmp_path):
    """As it stands, but for its imports."""
    folder, bake = lobby[0], load(lobby[0] / "house.bake")
    page = (EXAMPLES / "three" / "index.html").read_text(encoding="utf-8")
    script = re.search(r'<script type="module">\n(.*?)</script>', page, re.DOTALL)[1]
    lines = script.splitlines()
    imports = [line for line in lines if line.startswith("import ")]
    mapped = json.loads(re.search(r'<script type="importmap">(.*?)</script>', page, re.DOTALL)[1])["imports"]
    assert len(imports) == 3 and all(any(f'from "{name}' in line for name in mapped) for line in imports)
    (tmp_path / "page.mjs").write_text(THREE + "\n".join(line for line in lines if line not in imports))
    eyes = list(eyes_in(bake))
    # Z up to Y up.
    there = [{"x": x, "y": z, "z": -y} for (x, y, z), _ in eyes]
    asked = json.dumps({"glb": str(folder / "house.glb"), "json": str(folder / "house.json"), "eyes": there})
    done = run_node(str(tmp_path / "page.mjs"), text=asked)
    assert done.returncode == 0, done.stderr
    everything = list(range(len(bake.scene.objects)))
    for (_, cell), (told, shown) in zip(eyes, json.loads(done.stdout), strict=True):
        assert shown == (everything if cell is None else bake.potential(cell).tolist())
        assert told == "in no view cell" if cell is None else told.startswith(f"view cell {cell} ")
    assert any(cell is not None and len(bake.potential(cell)) < len(everything) for _, cell in eyes)


def test_the_script_for_godot_finds_the_cameras_cell(lobby):
    """Its search, turned into Python word by word; gdparse and gdlint of gdtoolkit 4.5 accept the whole."""
    folder, bake = lobby[0], load(lobby[0] / "house.bake")
    script = (EXAMPLES / "godot" / "viewcell_sets.gd").read_text(encoding="utf-8")
    body = script[script.index("func row_at") :]
    for pattern, there in (
        (r"func (\w+)\((.*)\) -> \w+:", lambda m: f"def {m[1]}({re.sub(r': float', '', m[2])}):"),
        (r"\bvar (\w+)(?:: \w+)? =", r"\1 ="),
        (r"cells\.size\(\)", "len(cells)"),
    ):
        body = re.sub(pattern, there, body)
    names = {"cells": json.loads((folder / "house.json").read_text(encoding="utf-8"))["cells"]}
    exec(body, names)
    for point, cell in eyes_in(bake):
        row = names["row_at"](*point)
        assert (names["cells"][row]["id"] if row >= 0 else None) == cell
    assert "row_at(eye.x, -eye.z, eye.y)" in script and "row < 0 or potential[row].has(id)" in script


def example_test():
    """The module of the example for one's own baker."""
    spec = importlib.util.spec_from_file_location("test_my_pvs", EXAMPLES / "test_my_pvs.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


MINE = example_test()
test_of_ones_own_baker = MINE.test_nothing_visible_is_hidden


def test_a_baker_that_hides_what_is_visible_fails_there(viewcell_scene, tmp_path, assert_conservative, monkeypatch):
    keep = MINE.my_baker
    floor = next(number for number, placed in enumerate(viewcell_scene.objects) if placed.kind == "IfcSlab")
    monkeypatch.setattr(MINE, "my_baker", lambda *asked: [pair for pair in keep(*asked) if pair != (0, floor)])
    assert len(MINE.view_cells(viewcell_scene)) > 1
    with pytest.raises(AssertionError, match="not conservative: 1 visible pair"):
        MINE.test_nothing_visible_is_hidden(viewcell_scene, assert_conservative, tmp_path)
