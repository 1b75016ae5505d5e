"""stops.npz as a file: what is not well-formed is not read."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest
import stops_case as case

from verify import evidence
from verify.evidence import EvidenceError
from verify.judge.stops_file import read_stops


@pytest.fixture(scope="module")
def arrays() -> case.Arrays:
    return case.stop_arrays(3)


def faults(data: bytes, folder: Path) -> str:
    (folder / evidence.STOPS).write_bytes(data)
    with pytest.raises(EvidenceError) as caught:
        read_stops(folder)
    assert all(reason.startswith("stops.npz: ") for reason in caught.value.reasons)
    return "\n".join(caught.value.reasons)


def test_what_was_written_is_read(arrays, tmp_path):
    (tmp_path / evidence.STOPS).write_bytes(case.packed(arrays))
    file = read_stops(tmp_path)
    assert file is not None
    assert (file.model, len(file)) == ("four_wheel", 6)
    for key in ("instant", "straightened", "first", *case.ROWS):
        np.testing.assert_array_equal(getattr(file, key), arrays[key])


def test_no_file_is_none(tmp_path):
    assert read_stops(tmp_path) is None


@pytest.mark.parametrize("share", [0.0, 0.3, 0.9, 0.999])
def test_a_truncated_file_is_not_read(share, arrays, tmp_path):
    data = case.packed(arrays)
    assert "truncated or not an archive" in faults(data[: int(share * len(data))], tmp_path)


def test_arrays_missing_and_too_many(arrays, tmp_path):
    less = {key: value for key, value in arrays.items() if key != "tilt"}
    assert "the array tilt is missing" in faults(case.packed(less), tmp_path)
    more = {**arrays, "comment": np.zeros(1)}
    assert "holds what it should not: 'comment.npy'" in faults(case.packed(more), tmp_path)


@pytest.mark.parametrize(
    ("key", "change", "words"),
    [
        ("schema", lambda a: a + 1, "schema = 2: must be 1"),
        ("schema", lambda a: a[None], "its shape is (1,)"),
        ("model", lambda a: np.array(4), "expected text"),
        ("model", lambda a: np.array("x" * 65), "expected text of at most 64 characters"),
        ("model", lambda a: np.array(["four_wheel"]), "its shape is (1,)"),
        ("instant", lambda a: a.astype(np.float32), "its type is '<f4', expected '<f8'"),
        ("instant", lambda a: a[:, None], "its shape is (6, 1)"),
        ("instant", lambda a: a[:0], "its shape is"),
        ("instant", lambda a: a * np.nan, "instant[0] = nan: is not finite or absurd"),
        ("instant", lambda a: a - 1.0, "instant[0] = -1.0: must not be negative"),
        ("straightened", lambda a: a.astype(np.int64), "its type is '<i8', expected '|b1'"),
        ("straightened", lambda a: a[1:], "its shape is (5,)"),
        ("first", lambda a: a[:-1], "its shape is (6,)"),
        ("first", lambda a: a.astype(np.int32), "its type is '<i4'"),
        ("first", lambda a: a + 1, "first: begins at 1"),
        ("first", lambda a: np.append(a[:-1], a[-1] - 1), "ends at"),
        ("first", lambda a: np.append([0, 1], a[2:]), "a stop has 2 rows or more"),
        ("first", lambda a: np.append([0, a[2], a[1]], a[3:]), "a stop has 2 rows or more"),
        ("first", lambda a: np.append([0, 2**63 - 1], a[2:]), "a stop has 2 rows or more"),
        ("first", lambda a: np.append([0, -(2**63)], a[2:]), "a stop has 2 rows or more"),
        ("t", lambda a: a[1:], "its shape is"),
        ("x", lambda a: a[:-1], "its shape is"),
        ("x", lambda a: a + 1e13, "is not finite or absurd"),
        ("y", lambda a: a + np.inf, "y[0] = inf: is not finite or absurd"),
        ("heading", lambda a: a * np.nan, "heading[0] = nan"),
        ("tilt", lambda a: a - 2.0, "must not be negative"),
        ("least_load", lambda a: a - 1.0, "must not be negative"),
        ("slip", lambda a: a - 1.0, "must not be negative"),
        ("slip", lambda a: a.astype(complex), "its type is '<c16'"),
    ],
)
def test_arrays_of_another_form_are_not_read(key, change, words, arrays, tmp_path):
    told = faults(case.packed({**arrays, key: change(arrays[key])}), tmp_path)
    assert words in told


def test_no_stops_at_all_are_read(tmp_path):
    # of a vehicle that fell before the first; the judge says what that means
    (tmp_path / evidence.STOPS).write_bytes(case.packed(case.no_stops()))
    file = read_stops(tmp_path)
    assert file is not None
    assert len(file) == 0


def test_what_unpacks_to_too_much_is_not_unpacked(arrays, tmp_path, monkeypatch):
    # 1 MB of zeros takes 1 kB: the size that the archive declares is what counts, before any is unpacked.
    data = case.packed({**arrays, "slip": np.zeros(2**17)})
    assert len(data) < 50_000
    monkeypatch.setattr(evidence, "MAX_BYTES", 50_000)
    monkeypatch.setattr(zipfile.ZipFile, "read", lambda *_: pytest.fail("unpacked"))
    assert "unpacks to more than 50000 bytes" in faults(data, tmp_path)


def with_bytes(arrays: case.Arrays, key: str, data: bytes) -> bytes:
    """The archive with other bytes for one array."""
    stream = io.BytesIO(case.packed({name: value for name, value in arrays.items() if name != key}))
    with zipfile.ZipFile(stream, "a", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(f"{key}.npy", data)
    return stream.getvalue()


def test_objects_are_never_unpickled(arrays, tmp_path):
    stream = io.BytesIO()
    np.lib.format.write_array(stream, np.array([{}], dtype=object), allow_pickle=True)
    assert "slip: its type is '|O', expected '<f8'" in faults(
        with_bytes(arrays, "slip", stream.getvalue()), tmp_path
    )


def test_flags_that_are_neither_true_nor_false_are_not_read(arrays, tmp_path):
    stream = io.BytesIO()
    np.lib.format.write_array(stream, arrays["straightened"])
    data = stream.getvalue()[:-1] + b"\x02"
    assert "straightened[5] = 2: must be 0 or 1" in faults(with_bytes(arrays, "straightened", data), tmp_path)


def test_a_declared_size_must_be_that_of_the_data(arrays, tmp_path):
    stream = io.BytesIO()
    np.lib.format.write_array(stream, arrays["v"])
    told = faults(with_bytes(arrays, "v", stream.getvalue()[:-8]), tmp_path)
    assert "bytes of numbers where" in told


def test_a_byte_flipped_anywhere_is_seen_or_does_not_matter(arrays, tmp_path):
    data = case.packed(arrays)
    seen = 0
    for place in np.linspace(0, len(data) - 1, 60).astype(int):
        changed = bytearray(data)
        changed[place] ^= 0x10
        (tmp_path / evidence.STOPS).write_bytes(changed)
        try:
            file = read_stops(tmp_path)
        except EvidenceError:
            seen += 1
            continue
        assert file is not None  # dates and the like in the archive's own entries
        for key in ("instant", "straightened", "first", *case.ROWS):
            np.testing.assert_array_equal(getattr(file, key), arrays[key])
    assert seen > 30
