"""Ctrl-C and SIGTERM that arrive while compiled code calls back into Python, or while a run tidies up.

Drake turns a KeyboardInterrupt raised within a callback into a RuntimeError of its own, and a stage may
take that for a failure. So the signal is also remembered, and looked at as stages go on and end.
"""

from __future__ import annotations

import signal
import threading
from types import FrameType, TracebackType
from typing import Any, Self

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def heeded() -> dict[int, Any]:
    """Handlers of the signals that end a run; what this process was started to ignore stays ignored."""
    handlers = {number: signal.getsignal(number) for number in SIGNALS}
    return {number: handler for number, handler in handlers.items() if handler != signal.SIG_IGN}


class Interruption:
    """While entered, the first SIGINT, SIGTERM or SIGHUP raises KeyboardInterrupt.

    Those that follow are only remembered, so that nothing cuts short the tidying up which the first one
    set off. Outside the main thread, which alone handles signals, it does nothing. A signal that strikes
    just as the block ends can leave handlers in place; `restore` does that once more.
    """

    def __init__(self) -> None:
        self.requested = False
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            self._before = heeded()
            for number in self._before:
                signal.signal(number, self._remember)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.restore()
        if error is not None and not isinstance(error, KeyboardInterrupt):
            self.check()

    def restore(self) -> None:
        """Put the handlers back that were there before; any number of times."""
        while self._before:
            number, handler = next(iter(self._before.items()))
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
            self._before.pop(number, None)

    def check(self) -> None:
        """Raise KeyboardInterrupt if a signal has arrived."""
        if self.requested:
            raise KeyboardInterrupt

    def _remember(self, _number: int, _frame: FrameType | None) -> None:
        first, self.requested = not self.requested, True
        if first:
            raise KeyboardInterrupt
