import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from viewcell.data.errors import InputError
from viewcell.data.ragged import starts_of
from viewcell.data.runs import decode, encode, find_runs

VECTORS = {
    "": [],
    "00 00": [0],
    "07 00": [7],
    "00 02 03 01 0a 00": [0, 1, 2, 7, 8, 20],
    "00 ab 02": list(range(300)),
    "c8 01 03 c3 01 00": [200, 201, 202, 203, 400],
    "ff ff ff ff 07 00": [2**31 - 1],
}
sets_of_ids = st.sets(st.integers(0, 40) | st.integers(100, 70_000) | st.integers(2**31 - 40, 2**31 - 1), max_size=40)


def flat(sets):
    return starts_of([len(ids) for ids in sets]), np.array([i for ids in sets for i in sorted(ids)], np.int64)


@pytest.mark.parametrize("code", VECTORS)
def test_vectors(code):
    ids, raw = VECTORS[code], bytes.fromhex(code)
    assert encode(*flat([ids])) == [raw]
    assert decode([raw], 2**31).of(0).tolist() == ids


@given(st.lists(sets_of_ids, max_size=8))
def test_decoding_gives_back_what_was_encoded(sets):
    codes = encode(*flat(sets))
    found = decode(codes, 2**31)
    assert len(found) == len(sets)
    assert [found.of(row).tolist() for row in range(len(sets))] == [sorted(ids) for ids in sets]
    starts, ids = found.ids()
    assert np.array_equal(starts, flat(sets)[0]) and np.array_equal(ids, flat(sets)[1])


@given(sets_of_ids)
def test_the_code_is_that_of_a_plain_loop(ids):
    out, end = bytearray(), 0
    runs = find_runs(*flat([ids]))
    for first, length in zip(runs.first.tolist(), runs.length.tolist(), strict=True):
        for number in (first - end - (end > 0), length - 1):
            while number >= 0x80:
                out.append(number & 0x7F | 0x80)
                number >>= 7
            out.append(number)
        end = first + length
    assert encode(*flat([ids])) == [bytes(out)]


@given(st.lists(st.binary(max_size=12), max_size=4))
def test_other_bytes_are_a_set_or_refused(codes):
    try:
        found = decode(codes, 5000)
    except InputError as error:
        assert "\n" not in str(error)
        return
    assert encode(*found.ids()) == codes


MALFORMED = {
    "80": "set 1 cut short",
    "00": "set 1 cut short",
    "00 00 80": "set 1 cut short",
    "05 05": "ids below 8, found 10 in set 1",
    "08 00": "ids below 8, found 8 in set 1",
    "80 00 00": "fewest bytes",
    "ff ff ff ff ff 01 00": "fewest bytes",
}


@pytest.mark.parametrize("code", MALFORMED)
def test_malformed(code):
    with pytest.raises(InputError, match=MALFORMED[code]):
        decode([b"\x00\x07", bytes.fromhex(code), b""], 8)
    # A number may not begin in one set and end in the next.
    with pytest.raises(InputError):
        decode([b"\x80", b"\x01\x00"], 1000)


@pytest.mark.parametrize("ids", [[3, 2], [2, 2], [-1], [2**31]])
def test_refuses_what_is_no_set(ids):
    with pytest.raises(InputError, match="sets: expected ids"):
        encode(np.array([0, len(ids)]), np.array(ids))
    # Each set begins anew.
    assert decode(encode(np.array([0, 1, 1, 2]), np.array([3, 2])), 9).ids()[1].tolist() == [3, 2]


def test_runs_of_a_set():
    runs = find_runs(np.array([0, 3, 3, 5]), np.array([1, 2, 4, 5, 6]))
    assert runs.starts.tolist() == [0, 2, 2, 3]
    assert runs.first.tolist() == [1, 4, 5] and runs.length.tolist() == [2, 1, 2]
