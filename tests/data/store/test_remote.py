"""A database behind HTTP: what comes is what the folder has, or one line in time."""

import shutil
import socket
import time

import pytest
from builders.four_rooms import hashes
from builders.packed_house import packed_scene
from builders.range_server import serving, took
from viewcell.data.errors import InputError
from viewcell.data.store.ranges import FileSource, Range, ReadFailed
from viewcell.data.store.remote import HttpSource, fetch_index, is_remote
from viewcell.data.store.walk_folder import GEOMETRY
from viewcell.workbench.bake.run import bake
from viewcell.workbench.pack.run import pack

WAIT_S = 0.5


@pytest.fixture(scope="module")
def packed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("served")
    return pack(bake(packed_scene(), folder / "house.bake"), folder / "house.walk").folder


def test_an_index_is_the_folders_and_ranges_are_its_geometry(packed, tmp_path):
    with serving(packed.parent) as (url, asked):
        walk, size = fetch_index(f"{url}/house.walk/", tmp_path)
        own = {name: digest for name, digest in hashes(packed).items() if name != GEOMETRY}
        assert hashes(tmp_path) == own and size == sum((packed / name).stat().st_size for name in own)
        assert walk.objects.num_rows and GEOMETRY not in {name for name, _ in asked}
        remote, local = HttpSource(f"{url}/house.walk"), FileSource(packed / GEOMETRY)
        for wanted in (Range(0, 16, (0,), 0), Range(32, 300, (1,), 0), Range(0, 1, (0,), 0)):
            assert remote.read(wanted) == local.read(wanted)
        assert asked[-1] == (GEOMETRY, "bytes=0-0")
        remote.close()
        local.close()


@pytest.mark.parametrize(
    ("fault", "why"),
    [
        ("silent", "found none in 0.5 s"),
        ("slow", "found none in 0.5 s"),
        ("closed", "expected an answer, found"),
        ("error", "expected status 206, found 503"),
        ("no ranges", "found 200 OK; the server knows no ranges"),
        ("short", "expected 64 bytes, found 32"),
        ("other range", "expected bytes 16-79, found bytes 32-95"),
    ],
)
def test_a_range_that_does_not_come_is_told_in_time(fault, why, packed):
    with serving(packed.parent, lambda name, span: fault) as (url, _):
        source, begin = HttpSource(f"{url}/house.walk", WAIT_S), time.monotonic()
        with pytest.raises(ReadFailed, match=why) as failed:
            source.read(Range(16, 64, (0,), 0))
        assert "\n" not in str(failed.value)
        # The bound is that of the promise, many times over, for a busy machine.
        assert took(begin) < 20 * WAIT_S
        source.close()


def test_after_a_failure_the_next_range_is_itself(packed):
    """What was left of an answer is not taken for the next one; a connection that was closed is opened anew."""
    faults = iter(["other range", "", "closed", "", "short", ""])
    with serving(packed.parent, lambda name, span: next(faults)) as (url, _):
        source, data = HttpSource(f"{url}/house.walk", 5.0), (packed / GEOMETRY).read_bytes()
        for first in (0, 32):
            with pytest.raises(ReadFailed):
                source.read(Range(first, 64, (0,), 0))
            assert source.read(Range(first, 64, (0,), 0)) == data[first : first + 64]
            # The third request is closed without an answer, and asked again.
            if not first:
                assert source.read(Range(0, 16, (0,), 0)) == data[:16]
        source.close()


@pytest.mark.parametrize("fault", ["silent", "slow", "closed", "error", "short", "altered"])
def test_an_index_that_does_not_come_is_one_line(fault, packed, tmp_path):
    with serving(packed.parent, lambda name, span: fault if name == "objects.parquet" else "") as (url, _):
        with pytest.raises(InputError) as refused:
            fetch_index(f"{url}/house.walk", tmp_path, WAIT_S)
        assert f"{url}/house.walk" in str(refused.value) and "\n" not in str(refused.value)


def test_what_is_no_database_is_refused(packed, tmp_path):
    shutil.copytree(packed, tmp_path / "other.walk")
    (tmp_path / "other.walk" / "manifest.json").write_text('{"kind": "bake", "files": 7}')
    with serving(tmp_path) as (url, _):
        for name, why in (("none.walk", "found 404"), ("other.walk", "expected that of a display database")):
            with pytest.raises(InputError, match=why):
                fetch_index(f"{url}/{name}", tmp_path, WAIT_S)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        nobody = f"http://127.0.0.1:{free.getsockname()[1]}/house.walk"
        with pytest.raises(InputError, match="expected an answer, found"):
            fetch_index(nobody, tmp_path, WAIT_S)
    for address in ("http://", "http://host:nine/house.walk", "http://host/house.walk?key=1"):
        assert is_remote(address)
        with pytest.raises(InputError, match="expected an address such as"):
            fetch_index(address, tmp_path, WAIT_S)
    assert not is_remote("house.walk") and not is_remote(packed)
