"""What a long run is doing, on standard error of a terminal and nowhere else."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.status import Status


class Progress:
    """A line on the terminal that names the current stage; silent in a pipe or where `CI` is set."""

    def __init__(self, *, quiet: bool = False) -> None:
        console = Console(stderr=True)
        self._shown = console.is_terminal and sys.stderr.isatty() and "CI" not in os.environ and not quiet
        self._status: Status | None = console.status("") if self._shown else None

    def __enter__(self) -> Self:
        if self._status is not None:
            self._status.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._status is not None:
            self._status.stop()

    def say(self, text: str) -> None:
        """Name what is being done."""
        if self._status is not None:
            self._status.update(text)

    @contextlib.contextmanager
    def paused(self) -> Iterator[None]:
        """Clear the line while results are printed."""
        if self._status is not None:
            self._status.stop()
        try:
            yield
        finally:
            if self._status is not None:
                self._status.start()
