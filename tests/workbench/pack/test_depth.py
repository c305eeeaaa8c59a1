"""Depth meshes in a pack: everything that may be seen is near or far, and what is read is what was made."""

from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
from builders.far_bake import CELLS, TRIANGLES, far_bake, far_walk
from viewcell.data.camera import Screen
from viewcell.data.errors import InputError
from viewcell.data.store.depth_items import decode_face
from viewcell.data.store.walk_depth import DepthIndex
from viewcell.data.store.walk_folder import read_walk
from viewcell.kernels.launch import Device
from viewcell.solvers.depth_meshes.balance import Balance, Budget
from viewcell.workbench.cli import main
from viewcell.workbench.pack.depth import DepthItems, DepthSettings
from viewcell.workbench.pack.words import pack_text

HEAD = "x,y,z,yaw,pitch,t\n"


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return far_bake(tmp_path_factory.mktemp("far"))


@pytest.fixture(scope="module")
def walk(made, tmp_path_factory):
    return far_walk(tmp_path_factory.mktemp("walk"), made)


def test_rows_are_what_was_balanced(made, walk):
    index, order = walk.depth_meshes, walk.objects["object_id"].to_numpy()
    assert index.cells.tolist() == [0, 1]
    balance = Balance(made.scene, Budget(TRIANGLES, Screen()), device=Device.wanted("cpu"))
    for row, cell in enumerate(CELLS):
        potential = np.sort(order[walk.potential.of(row)])
        found = balance.of(potential, cell)
        near, levels = index.near_levels(row)
        assert dict(zip(order[near].tolist(), levels.tolist(), strict=True)) == dict(
            zip(found.side.near.tolist(), found.levels.tolist(), strict=True)
        )
        assert sorted(order[index.far.of(row)].tolist()) == found.side.far.tolist()
        assert np.isclose(index.cull_boxes[row], found.cull_box * made.grid_m) and index.pixels[row] == found.pixels
        assert index.errors[row] == found.side.error and index.skins[row] == found.side.skin
        assert np.allclose(index.middles[row], cell.mean(axis=0) * made.grid_m)
        assert np.isclose(index.reaches[row], found.side.reach * made.grid_m) and index.texels[row] == 512
        for face in range(6):
            item = walk.depth_face(row, face)
            shown = np.where(item.ranks < 0, -1, order[index.far.of(row)][item.ranks])
            assert np.array_equal(shown, found.side.ids[face]) and np.array_equal(item.layers, found.side.layers[face])
            assert index.faces[row, face] == sum(len(mesh.triangles) for mesh in item.meshes)
            for one, other in zip(item.meshes, found.side.meshes[face], strict=True):
                assert all(np.array_equal(a, b) for a, b in zip(one.arrays(), other.arrays(), strict=True))


def test_ids_are_those_of_the_display(made):
    """Whatever the order: one in which no object keeps its number."""
    found = Balance(made.scene, Budget(6_000, skin_weight=0.01)).of(np.arange(40), CELLS[0])
    found = replace(found, levels=np.arange(len(found.side.near)) % 4)
    order = np.roll(np.arange(40)[::-1], 7)
    place = np.argsort(order)
    with closing(DepthItems(32)) as items:
        items.add(5, found, place, made.grid_m)
        index, data = DepthIndex.of(items.table, 40), b"".join(items.geometry())
    near, levels = index.near_levels(0)
    assert dict(zip(order[near].tolist(), levels.tolist(), strict=True)) == dict(
        zip(found.side.near.tolist(), found.levels.tolist(), strict=True)
    )
    for face in range(6):
        begin = index.offsets[0, face] - 32
        item = decode_face(data[begin : begin + index.sizes[0, face]], "face")
        shown = np.where(item.ranks < 0, -1, order[index.far.of(0)][item.ranks])
        assert np.array_equal(shown, found.side.ids[face])


def test_meshes_that_do_not_pay(made, tmp_path, monkeypatch):
    monkeypatch.setattr("viewcell.solvers.depth_meshes.balance.PAYS", 0.0)
    assert not len(far_walk(tmp_path, made, cells="auto").depth_meshes)
    assert len(far_walk(tmp_path, made, "all.walk").depth_meshes)


def test_faces_follow_the_items_and_begin_aligned(walk):
    index = walk.depth_meshes
    ends = walk.items["offset"].to_numpy() + walk.items["size"].to_numpy()
    assert index.offsets.min() >= ends.max() and (index.offsets % 16 == 0).all()
    assert (np.diff(np.sort(index.offsets.ravel())) >= index.sizes.ravel()[:-1]).all()


def test_it_says_what_they_take(walk):
    text = pack_text(walk)
    assert f"depth meshes: 2 of 2 view cells, {walk.depth_meshes.faces.sum() / 2:,.0f} triangles" in text
    assert "no texel off by more than" in text
    assert read_walk(walk.folder).manifest["counts"]["depth_meshes"] == 2


def test_where_everything_fits_there_are_none(made, tmp_path):
    walk = far_walk(tmp_path, made, cells="auto", triangles=10**6)
    assert not len(walk.depth_meshes) and "depth meshes: none, as they pay in no view cell" in pack_text(walk)


def test_auto_has_those_that_pay(made, walk, tmp_path):
    some = far_walk(tmp_path, made, cells="auto")
    finest = np.array([len(shape.lods[0].faces) for shape in made.scene.definitions])
    assert len(some.depth_meshes) <= len(walk.depth_meshes)
    assert (some.depth_meshes.faces.sum(axis=1) < finest.sum() / 2).all()


def test_along_a_path_its_cells_alone(made, tmp_path):
    eyes = tmp_path / "path.csv"
    eyes.write_text(HEAD + "1.5,0,0,0,0,0\n1.6,0,0,0,0,1\n")
    assert far_walk(tmp_path, made, along=eyes).depth_meshes.cells.tolist() == [1]
    eyes.write_text(HEAD + "1.5,0,0,0,0,0\n9,0,0,0,0,1\n")
    with pytest.raises(InputError, match="found frame 1 in none"):
        far_walk(tmp_path, made, "b.walk", along=eyes)
    assert not (tmp_path / "b.walk").exists()


def test_other_meshes_are_packed_anew_and_the_same_are_not(made, tmp_path):
    first = far_walk(tmp_path, made)
    manifest = (first.folder / "manifest.json").stat().st_ino
    assert (far_walk(tmp_path, made).folder / "manifest.json").stat().st_ino == manifest
    assert far_walk(tmp_path, made, triangles=1_100).manifest["depth_meshes"]["triangles"] == 1_100


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--triangles", "5"], "expected --depth-meshes beside --triangles"),
        (["--along", "x.csv"], "expected --depth-meshes beside --along"),
        (["--depth-meshes", "auto", "--along", "x.csv"], "x.csv"),
        (["--check", "--depth-meshes", "all"], "expected nothing to write beside --check"),
    ],
)
def test_bad_options(made, tmp_path, capsys, arguments, words):
    assert main(["pack", str(made.folder), "--out", str(tmp_path / "x.walk"), *arguments]) == 2
    assert words in capsys.readouterr().err


def test_bad_settings():
    with pytest.raises(InputError, match="expected auto or all, found 'some'"):
        DepthSettings("some")
    with pytest.raises(InputError, match="triangles: expected a number above 0"):
        DepthSettings(triangles=0)
