"""Files that appear whole or not at all.

A run works in a hidden folder beside its target and swaps it in by renames. Whatever happens before
the swap leaves the earlier result untouched; signals wait while the swap lasts; and what a killed run
left behind is put right by the next one. Folders are locked with `flock`, which ends with its process.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
import signal
import tempfile
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType, TracebackType
from typing import Any, Self

from verify import evidence
from verify.by_products import by_products
from verify.evidence import MODEL_OF_PLAN, EvidenceError

UNLISTED = "unlisted_trajectories"  # where trajectory files go that are not ours: trajectories/ is evidence
_DEFERRED = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class OutputError(Exception):
    """The place for the output cannot be used; the message says why."""


@contextlib.contextmanager
def deferred_signals() -> Iterator[None]:
    """Let SIGINT, SIGTERM and SIGHUP wait until the block is done, then act as usual."""
    if threading.current_thread() is not threading.main_thread():
        yield  # only the main thread runs handlers, so nothing can interrupt this one
        return
    before: dict[int, Any] = {number: signal.getsignal(number) for number in _DEFERRED}
    pending: list[int] = []
    waiting = True

    def remember(number: int, frame: FrameType | None) -> None:
        if waiting:
            pending.append(number)
        else:  # a signal cut short the restoring of handlers below: this one is still in place
            _act(before[number], number, frame)

    try:
        for number in before:
            signal.signal(number, remember)
        yield
    finally:
        waiting = False
        for number, handler in before.items():
            signal.signal(number, _settable(handler))
        for number in dict.fromkeys(pending):
            signal.raise_signal(number)


def _settable(handler: Any) -> Any:
    """A handler as `signal.signal` takes it; None stands for one that Python did not install."""
    return signal.SIG_DFL if handler is None else handler


def _act(handler: Any, number: int, frame: FrameType | None) -> None:
    """Do what the handler does."""
    if callable(handler):
        handler(number, frame)
    elif handler != signal.SIG_IGN:
        signal.signal(number, signal.SIG_DFL)
        signal.raise_signal(number)


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the lock of `folder`; waits for another process that holds it."""
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)


def replace_file(file: Path, write: Callable[[Path], object]) -> None:
    """Let `write` make a file beside `file`, then put it in its place."""
    handle, name = tempfile.mkstemp(prefix=f".{file.name}.", dir=file.parent)
    os.close(handle)
    aside = Path(name)
    try:
        write(aside)
        aside.chmod(0o666 & ~_umask())
        aside.replace(file)
    finally:
        aside.unlink(missing_ok=True)


def usable_folder(out: Path) -> Path:
    """`out`, made if needed.

    Raises
    ------
    OutputError : it cannot be made, or nothing can be written in it.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=out):
            pass
    except OSError as error:
        raise OutputError(f"{out}: cannot be used for output: {error.strerror}") from error
    return out


class ResultFolder:
    """The folder `out/name`, written aside.

        with ResultFolder(out, "warehouse") as folder:
            ...                 # write into folder.work
            folder.publish()

    Without `publish` nothing remains. The one gap in this is a signal that raises just as the block
    ends, before `__exit__` has begun; who installs such a handler calls `discard` once more.
    """

    def __init__(self, out: Path, name: str) -> None:
        self.out = out
        self.name = name
        self.final = out / name
        self._work: Path | None = None
        self._handle = -1

    @property
    def work(self) -> Path:
        """The hidden folder to write into, within the block."""
        if self._work is None:
            raise RuntimeError(f"{self.final}: its folder is not open")
        return self._work

    def __enter__(self) -> Self:
        """Recover from killed runs and open the hidden folder.

        Raises
        ------
        OutputError : the final folder holds something that `verify` did not write.
        """
        try:
            with locked(self.out), deferred_signals():  # waiting for the lock can be interrupted
                self._recover()
                self._require_replaceable()
                self._work = Path(tempfile.mkdtemp(prefix=f".{self.name}.", dir=self.out))
                self._handle = os.open(self.work, os.O_RDONLY | os.O_DIRECTORY)
                fcntl.flock(self._handle, fcntl.LOCK_EX)  # tells others that this run is alive
        except BaseException:  # also a signal that waited: without an entered block nobody else tidies up
            self.discard()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.discard()

    def discard(self) -> None:
        """Remove the hidden folder if there is one; any number of times."""
        with deferred_signals():
            if self._work is not None:
                shutil.rmtree(self._work, ignore_errors=True)
            if self._handle >= 0:
                os.close(self._handle)
            self._work, self._handle = None, -1

    def publish(self, keep: Callable[[Path, Path], object] = lambda _old, _new: None) -> None:
        """Swap the hidden folder in; files in the old one that are not ours come along.

        `keep` is called with the folder that is replaced, if there is one, and the one that replaces it.
        """
        with locked(self.out), deferred_signals():
            self._require_replaceable()
            backup = self.work.with_name(f"{self.work.name}.old")
            replaced = self.final.exists()
            if replaced:
                self._carry_over()
                keep(self.final, self.work)
            self.work.chmod(0o777 & ~_umask())
            if replaced:
                self.final.rename(backup)
            try:
                self.work.rename(self.final)
            except OSError:
                if replaced:
                    backup.rename(self.final)
                raise
            shutil.rmtree(backup, ignore_errors=True)

    def _require_replaceable(self) -> None:
        final = self.final
        if final.is_symlink() or (final.exists() and not final.is_dir()):
            raise OutputError(f"{final}: exists and is not a folder; nothing was changed")
        if final.is_dir() and any(final.iterdir()) and not evidence.is_result_folder(final):
            raise OutputError(
                f"{final}: holds no {evidence.RESULT} written by verify, so it is not replaced; "
                "move it away or choose another --out"
            )

    def _recover(self) -> None:
        """Put back what a run killed within its swap had set aside, and remove dead hidden folders."""
        leftovers = [path for path in self.out.glob(f".{self.name}.*") if path.is_dir()]
        backups = [path for path in leftovers if path.name.endswith(".old")]
        if not self.final.exists():
            whole = [path for path in backups if evidence.is_result_folder(path)]
            if whole:
                newest = max(whole, key=lambda path: path.stat().st_mtime)
                newest.rename(self.final)
                leftovers.remove(newest)
        for path in leftovers:
            if _is_dead(path):
                shutil.rmtree(path, ignore_errors=True)

    def _carry_over(self) -> None:
        """Bring files of the old folder that this program did not write."""
        ours = {evidence.RESULT, evidence.SCENARIO, evidence.REPORT, evidence.EXECUTED, evidence.SIMULATION}
        ours |= {evidence.CERTIFICATE} | by_products(self.final)
        ours |= {f"{evidence.TRAJECTORIES}/{plan}.csv" for plan in MODEL_OF_PLAN}
        try:
            listed = evidence.read_result(self.final).get("files")
        except EvidenceError:
            listed = None  # an empty folder
        ours |= set(listed) if isinstance(listed, dict) else set()
        for here, folders, files in os.walk(self.final):
            links = [name for name in folders if Path(here, name).is_symlink()]
            for name in [*files, *links]:
                source = Path(here, name)
                inside = source.relative_to(self.final)
                if inside.as_posix() in ours:
                    continue
                if inside.parts[0] == evidence.TRAJECTORIES and inside.suffix == ".csv":
                    inside = Path(UNLISTED, *inside.parts[1:])
                target = self.work / inside
                if not target.exists() and not target.is_symlink():
                    target.parent.mkdir(parents=True, exist_ok=True)
                    _link_or_copy(source, target)


def _link_or_copy(source: Path, target: Path) -> None:
    try:
        os.link(source, target, follow_symlinks=False)
    except OSError:
        shutil.copy2(source, target, follow_symlinks=False)


def _is_dead(folder: Path) -> bool:
    """Whether no living run works in a hidden folder."""
    try:
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    except OSError:
        return False
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    else:
        return True
    finally:
        os.close(handle)


def _umask() -> int:
    mask = os.umask(0o077)
    os.umask(mask)
    return mask
