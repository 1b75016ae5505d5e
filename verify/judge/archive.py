"""Archives of arrays as numpy writes them, read strictly: they may come from anybody.

Sizes are bounded by what the archive declares before anything is unpacked, and nothing is unpickled.
"""

from __future__ import annotations

import io
import math
import tokenize
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify import evidence
from verify.evidence import EvidenceError

# dtype and shape of each array; a letter stands for a length, the same everywhere, `TEXT` for one short word
Layout = Mapping[str, tuple[str, tuple[str | int, ...]]]

TEXT = "<U"
MOST_TEXT = 64  # characters of a word
MOST_HEADER = 4096  # bytes before an array's numbers
# What numpy raises for a header that is not one.
_MALFORMED = (
    ValueError,
    SyntaxError,
    TypeError,
    OverflowError,
    RecursionError,
    MemoryError,
    tokenize.TokenError,
)


def read_archive(folder: Path, name: str, layout: Layout) -> dict[str, NDArray[Any]] | None:
    """The arrays of one .npz file of the folder by key: all of the layout, none else; None without the file.

    Types are as laid out; shapes are not looked at, see `shape_faults`.

    Raises
    ------
    EvidenceError : truncated, not such an archive, an array missing, unknown or of another type.
    """
    if not (folder / name).exists():
        return None
    try:
        with zipfile.ZipFile(io.BytesIO(evidence.read_bytes(folder, name))) as archive:
            entries = _entries(archive, name, layout)
            return {
                key: _array(name, key, layout[key][0], archive.read(entry)) for key, entry in entries.items()
            }
    except (zipfile.BadZipFile, zlib.error, EOFError, OSError, NotImplementedError, RuntimeError) as error:
        raise EvidenceError(f"{name}: truncated or not an archive of arrays: {error}") from error


def shape_faults(arrays: Mapping[str, NDArray[Any]], layout: Layout) -> list[str]:
    """Arrays whose shape is not as laid out, or whose lengths do not fit together."""
    wrong: list[str] = []
    lengths: dict[str | int, int] = {}
    for key, (_, shape) in layout.items():
        actual = arrays[key].shape
        if len(actual) == len(shape):
            for name, length in zip(shape, actual, strict=True):
                lengths.setdefault(name, length)
            if actual == tuple(lengths[name] if isinstance(name, str) else name for name in shape):
                continue
        expected = ", ".join(str(lengths.get(name, name)) for name in shape)
        wrong.append(f"{key}: its shape is {actual}, expected ({expected})")
    return wrong


def first_fault(key: str, values: NDArray[Any], good: NDArray[np.bool_], rule: str) -> list[str]:
    """The first value that is not good, with its place and the rule; empty where all are."""
    if good.all():
        return []
    where = tuple(int(i) for i in np.argwhere(~good)[0])
    place = "".join(f"[{i}]" for i in where)
    return [f"{key}{place} = {values[where]}: {rule}"]


def _entries(archive: zipfile.ZipFile, name: str, layout: Layout) -> dict[str, zipfile.ZipInfo]:
    names = [entry.filename for entry in archive.infolist()]
    wanted = {f"{key}.npy": key for key in layout}
    wrong = [f"the array {key} is missing" for file, key in wanted.items() if file not in names]
    strange = sorted(set(names) - set(wanted))
    wrong += [f"holds what it should not: {file[:60]!a}" for file in strange[:5]]
    if len(set(names)) < len(names):
        wrong.append("two entries have the same name")
    if sum(entry.file_size for entry in archive.infolist()) > evidence.MAX_BYTES:
        wrong.append(f"unpacks to more than {evidence.MAX_BYTES} bytes")
    if any(e.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED) for e in archive.infolist()):
        wrong.append("is packed in a way that numpy does not use")
    if wrong:
        raise EvidenceError(*(f"{name}: {text}" for text in wrong))
    return {wanted[entry.filename]: entry for entry in archive.infolist()}


def _array(name: str, key: str, wanted: str, data: bytes) -> NDArray[Any]:
    """One array in numpy's format, in C order; its declared size must be that of the data."""
    stream = io.BytesIO(data)
    try:
        if np.lib.format.read_magic(stream) != (1, 0):
            raise ValueError("not of version 1.0")
        shape, _, dtype = np.lib.format.read_array_header_1_0(stream, max_header_size=MOST_HEADER)
        declared = math.prod(shape) * dtype.itemsize
        if wanted == TEXT:
            if dtype.kind != "U" or dtype.itemsize > np.dtype(f"<U{MOST_TEXT}").itemsize:
                raise ValueError(
                    f"its type is {dtype.str!a}, expected text of at most {MOST_TEXT} characters"
                )
        elif dtype.str != wanted:
            raise ValueError(f"its type is {dtype.str!a}, expected {wanted!a}")
        if declared != len(data) - stream.tell():
            raise ValueError(f"{len(data) - stream.tell()} bytes of numbers where {declared} are declared")
        stream.seek(0)
        array = np.lib.format.read_array(stream, allow_pickle=False, max_header_size=MOST_HEADER)
    except _MALFORMED as error:
        raise EvidenceError(f"{name}: {key}: {error}") from error
    return np.array(array, order="C")
