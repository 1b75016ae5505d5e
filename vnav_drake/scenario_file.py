"""From the bytes of a scenario file to plain data that knows its lines.

The file may be hostile, so everything is bounded before it is built: bytes, nesting, values. Anchors,
aliases and tags have no use in a scenario and are refused. Plain scalars follow the YAML 1.2 core schema
where YAML 1.1 surprises: `1e-6` is a number; `yes`, `010`, `1:30` and `1_000` are text, so that a number
field refuses them.
"""

from __future__ import annotations

import os
import re
import reprlib
import stat
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import yaml

MAX_BYTES = 8_000_000  # a world of 100,000 vertices at full precision takes 5 MB
MAX_VALUES = 1_000_000  # scalars, lists and mappings in one file
MAX_KEYS = 100  # in one mapping
MAX_DEPTH = 16  # nested lists and mappings; the format itself needs 5
MAX_FAULTS = 20  # reported for one file

Key = str | int
KeyPath = tuple[Key, ...]
# The line of a scalar, or of a list or mapping together with the lines of what it holds.
Lines = int | tuple[int, "dict[str, Lines] | list[Lines]"]

_NUMBER = re.compile(r"[-+]?(?:(?:0|[1-9][0-9]*)(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")
_INTEGER = re.compile(r"[-+]?(?:0|[1-9][0-9]{0,17})")
_SPECIAL = re.compile(r"[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)")
_WORDS = {"": None, "~": None, "null": None, "true": True, "false": False}
_UNPRINTABLE = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff\ufeff\ufffe\uffff]")

_RIDER = reprlib.Repr()
_RIDER.maxlist = _RIDER.maxdict = _RIDER.maxtuple = 4
_RIDER.maxstring = _RIDER.maxother = _RIDER.maxlong = 60


class ScenarioError(ValueError):
    """Bad input. `str()` is one line a fault: `file:line: key = value: what was expected`."""

    def __init__(self, *faults: str) -> None:
        super().__init__(*faults)
        self.faults = faults

    def __str__(self) -> str:
        return "\n".join(self.faults)


@dataclass(frozen=True)
class Fault:
    """One thing wrong with a file."""

    path: KeyPath
    message: str  # what was expected
    line: int | None = None  # where not that of `path`


@dataclass(frozen=True)
class Document:
    """Plain data (dict, list, str, int, float, bool, None) and the line of every key and item."""

    where: str  # the file's name, for messages
    data: object
    lines: Lines
    faults: tuple[Fault, ...] = ()  # what the text itself got wrong
    unread: frozenset[KeyPath] = field(default=frozenset())  # places whose value could not be read

    def line(self, path: KeyPath) -> int:
        """Line of a key or item, counted from 1; that of the innermost parent when there is none."""
        lines = self.lines
        for key in path:
            if isinstance(lines, int) or not _holds(lines[1], key):
                break
            lines = cast("dict[Key, Lines]", lines[1])[key]
        return lines if isinstance(lines, int) else lines[0]

    def message(self, fault: Fault) -> str:
        """The fault as `file:line: key = value: what was expected`."""
        line = fault.line or self.line(fault.path)
        key = show_path(fault.path)
        value: Any = self.data
        found = bool(fault.path) and fault.path not in self.unread
        for part in fault.path:
            found = found and _holds(value, part)
            value = value[part] if found else None
        label = f"{key} = {show_value(value)}: " if found else f"{key}: " if key else ""
        return f"{printable(self.where)}:{line}: {label}{fault.message}"

    def error(self, faults: Sequence[Fault]) -> ScenarioError:
        """All faults as one error, in the order of the file; at most `MAX_FAULTS` are spelled out."""
        ordered = sorted(faults, key=lambda fault: fault.line or self.line(fault.path))
        lines = [self.message(fault) for fault in ordered[:MAX_FAULTS]]
        if len(ordered) > MAX_FAULTS:
            lines.append(f"{printable(self.where)}: and {len(ordered) - MAX_FAULTS} faults more")
        return ScenarioError(*lines)


def _holds(container: object, key: Key) -> bool:
    """Whether a mapping has this key, or a list this item."""
    if isinstance(key, int):
        return isinstance(container, list) and 0 <= key < len(container)
    return isinstance(container, dict) and key in container


def printable(text: str) -> str:
    """Text with everything that is not printable escaped, as in a Python string."""
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def show_value(value: object) -> str:
    """A short, printable form of any value."""
    text = _RIDER.repr(value)
    return text if len(text) <= 100 else f"{text[:97]}..."


def show_path(path: KeyPath) -> str:
    """`("world", "obstacles", 3)` as `world.obstacles[3]`."""
    text = ""
    for key in path:
        if isinstance(key, int):
            text += f"[{key}]"
        else:
            plain = key if re.fullmatch(r"[\w-]{1,60}", key, re.ASCII) else show_value(key)
            text += f".{plain}" if text else plain
    return text


def split_path(key: str) -> KeyPath:
    """The inverse of `show_path` for plain keys."""
    return tuple(int(part) if part.isdigit() else part for part in re.findall(r"[^.\[\]]+", key))


def read_bytes(path: str | os.PathLike[str]) -> bytes:
    """The content of a regular file of at most `MAX_BYTES`.

    Raises
    ------
    ScenarioError : missing, unreadable, not a regular file, or too large. Never waits, and never
        reads more than one byte beyond the limit.
    """
    where = printable(os.fspath(path))
    try:
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
        try:
            status = os.fstat(descriptor)
            if not stat.S_ISREG(status.st_mode):
                raise ScenarioError(f"{where}: is not a regular file")
            if status.st_size > MAX_BYTES:
                raise ScenarioError(_too_large(where, status.st_size))
            with open(descriptor, "rb", closefd=False) as file:
                return file.read(MAX_BYTES + 1)  # it may have grown; `read_document` measures again
        finally:
            os.close(descriptor)
    except OSError as error:
        raise ScenarioError(f"{where}: cannot be read: {error.strerror}") from error
    except ValueError as error:
        if isinstance(error, ScenarioError):
            raise
        raise ScenarioError(f"{where}: cannot be read: {error}") from error


def read_document(data: bytes, where: str | Path) -> Document:
    """Parse one YAML document.

    Faults that leave the rest readable (duplicate keys, anchors, tags) are collected in the result.

    Raises
    ------
    ScenarioError : nothing can be made of the text: too large, not UTF-8, not YAML, empty, several
        documents, nested too deep, too many values.
    """
    where = str(where)
    text = _decode(data, where)
    return _Reader(where).read(text)


def _too_large(where: str, size: int) -> str:
    return f"{where}: has {size:,} bytes; a scenario has at most {MAX_BYTES:,}"


def _decode(data: bytes, where: str) -> str:
    name = printable(where)
    if len(data) > MAX_BYTES:
        raise ScenarioError(_too_large(name, len(data)))
    if data.startswith((b"\xff\xfe", b"\xfe\xff", b"\xef\xbb\xbf")):
        raise ScenarioError(f"{name}:1: starts with a byte order mark; expected UTF-8 without one")
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as error:
        line = 1 + data.count(b"\n", 0, error.start)
        raise ScenarioError(f"{name}:{line}: byte 0x{data[error.start]:02x} is not UTF-8 text") from error
    strange = _UNPRINTABLE.search(text)
    if strange:
        line = 1 + text.count("\n", 0, strange.start())
        raise ScenarioError(f"{name}:{line}: holds the character {strange.group()!a}; expected plain text")
    return text


def _line(mark: Any) -> int:
    """Line of a YAML mark, counted from 1; the first where there is no mark."""
    return 1 if mark is None else int(mark.line) + 1


def _scalar(event: yaml.ScalarEvent) -> object:
    """The value of a scalar: quoted text is text, plain text may be null, a boolean or a number."""
    text: str = event.value
    if event.style:
        return text
    if text.lower() in _WORDS and (text.islower() or text.istitle() or text.isupper() or text in "~"):
        return _WORDS[text.lower()]
    if _INTEGER.fullmatch(text):
        return int(text)
    if _NUMBER.fullmatch(text):
        return float(text)
    if _SPECIAL.fullmatch(text):
        return float(text.replace(".", "", 1))
    return text


@dataclass
class _Open:
    """A list or mapping whose end has not come yet."""

    data: dict[str, object] | list[object]
    lines: dict[str, Lines] | list[Lines]
    path: KeyPath
    line: int
    key: str | None = None  # of the value that comes next; None: a key comes next
    key_line: int = 0
    duplicate: bool = False  # the value that comes next is thrown away


class _Reader:
    """Builds a `Document` from parser events with a stack of its own, so that depth costs no recursion."""

    def __init__(self, where: str) -> None:
        self.where = where
        self.faults: list[Fault] = []
        self.unread: set[KeyPath] = set()
        self.root: tuple[object, Lines] | None = None
        self.stack: list[_Open] = []

    def read(self, text: str) -> Document:
        count = 0
        for event in self._events(text):
            line = _line(event.start_mark)
            if isinstance(event, yaml.DocumentStartEvent) and self.root is not None:
                raise self._stop(line, "a second document starts; expected one")
            if isinstance(event, yaml.CollectionEndEvent):
                done = self.stack.pop()
                self._place(done.data, (done.line, done.lines), done.line)
            elif isinstance(event, yaml.NodeEvent):
                count += 1
                if count > MAX_VALUES:
                    raise self._stop(line, f"holds more than {MAX_VALUES:,} values")
                self._node(event, line)
        if self.root is None:
            raise ScenarioError(f"{printable(self.where)}:1: is empty")
        data, lines = self.root
        return Document(self.where, data, lines, tuple(self.faults), frozenset(self.unread))

    def _events(self, text: str) -> Iterator[yaml.Event]:
        try:
            yield from yaml.parse(text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))
        except yaml.MarkedYAMLError as error:
            line = _line(error.problem_mark or error.context_mark)
            reason = ", ".join(part for part in (error.context, error.problem) if part)
            raise self._stop(line, f"is not valid YAML: {reason}") from error
        except yaml.YAMLError as error:
            raise self._stop(1, f"is not valid YAML: {error}") from error

    def _node(self, event: yaml.NodeEvent, line: int) -> None:
        path = self._path()
        if getattr(event, "tag", None) is not None:
            self._fault(path, "has a tag (!...); expected a plain value", line)
        if isinstance(event, yaml.AliasEvent):
            self._fault(path, "is an alias (*...); expected the value itself", line)
            self.unread.add(path)
            self._place(None, line, line)
            return
        if event.anchor is not None:
            self._fault(path, "has an anchor (&...); expected a plain value", line)
        if isinstance(event, yaml.ScalarEvent):
            if self._key_is_next():
                self._open_key(event.value, line)
            else:
                self._place(_scalar(event), line, line)
            return
        if self._key_is_next():
            raise self._stop(line, "a list or mapping stands where a key was expected")
        if len(self.stack) == MAX_DEPTH:
            raise self._stop(line, f"lists and mappings are nested more than {MAX_DEPTH} deep")
        if isinstance(event, yaml.MappingStartEvent):
            self.stack.append(_Open({}, {}, path, line))
        else:
            self.stack.append(_Open([], [], path, line))

    def _key_is_next(self) -> bool:
        return bool(self.stack) and isinstance(self.stack[-1].data, dict) and self.stack[-1].key is None

    def _open_key(self, key: str, line: int) -> None:
        top = self.stack[-1]
        if len(top.data) == MAX_KEYS:
            raise self._stop(line, f"a mapping has more than {MAX_KEYS} keys")
        top.key, top.key_line, top.duplicate = key, line, key in top.data
        if top.duplicate:
            entry = cast("dict[str, Lines]", top.lines)[key]
            first = entry if isinstance(entry, int) else entry[0]
            self._fault((*top.path, key), f"appears twice; it stands already in line {first}", line)

    def _place(self, data: object, lines: Lines, line: int) -> None:
        """Put a finished value where it belongs; a mapping's value counts from the line of its key."""
        if not self.stack:
            self.root = (data, lines)
            return
        top = self.stack[-1]
        if isinstance(top.data, list) and isinstance(top.lines, list):
            top.data.append(data)
            top.lines.append(lines)
        elif isinstance(top.data, dict) and isinstance(top.lines, dict):
            if top.key is None:  # an alias as a key
                raise self._stop(line, "an alias stands where a key was expected")
            if not top.duplicate:
                top.data[top.key] = data
                top.lines[top.key] = top.key_line if isinstance(lines, int) else (top.key_line, lines[1])
            top.key = None

    def _path(self) -> KeyPath:
        if not self.stack:
            return ()
        top = self.stack[-1]
        if isinstance(top.data, list):
            return (*top.path, len(top.data))
        return top.path if top.key is None else (*top.path, top.key)

    def _fault(self, path: KeyPath, message: str, line: int) -> None:
        if len(self.faults) == 10 * MAX_FAULTS:
            raise self._stop(line, "too many faults; reading stops here")
        self.faults.append(Fault(path, message, line))

    def _stop(self, line: int, message: str) -> ScenarioError:
        """The end of reading: what was found so far, and this."""
        name = printable(self.where)
        lines = [f"{name}:{f.line}: {show_path(f.path)}: {f.message}" for f in self.faults[:MAX_FAULTS]]
        return ScenarioError(*lines, f"{name}:{line}: {printable(message)}")
