"""Settings beside a default: each another one, none that the user has chosen."""

from dataclasses import replace
from types import SimpleNamespace

from viewcell.workbench.bake.settings import Settings
from viewcell.workbench.tune.neighbours import neighbours, words


def tried(base=None, asked=(), octree=False, view_cells=False):
    sources = SimpleNamespace(octree=octree, view_cells=view_cells or octree)
    return neighbours(base or Settings(), asked, sources)


def test_each_is_another_setting_that_bake_takes():
    for base, kind in ((Settings(), {}), (Settings(method="occluders"), {"octree": True})):
        found = [replace(base, **changes) for changes in tried(base, **kind)]
        assert base not in found and len(set(found)) == len(found) > 3
        for settings in found:
            settings.check()


def test_methods_are_compared_within_the_default_cells_and_beside_them():
    names = [words(changes) for changes in tried()]
    assert {"--method portals", "--method both", "--threshold 1", "--refine-kept 1.5"} <= set(names)
    assert names[-1] == "--method occluders --cells octree"


def test_what_the_user_has_chosen_stays():
    assert not any("method" in changes for changes in tried(Settings(method="both"), asked=["method"]))
    assert not any("threshold_m2" in changes for changes in tried(Settings(threshold_m2=2.0), asked=["threshold_m2"]))


def test_what_a_setting_does_not_go_with_is_left_out():
    assert not any(changes.get("cells") for changes in tried(Settings(seal=0.05), asked=["seal"]))
    depths = [changes["depth"] for changes in tried(Settings(depth=0), octree=True) if "depth" in changes]
    assert depths == [1]
