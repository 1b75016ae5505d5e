"""The command `verify`, and `python -m verify`."""

from __future__ import annotations

import signal
import sys
from types import FrameType

from verify.exit_codes import INTERRUPTED
from verify.interruption import heeded


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; returns the exit code. Ctrl-C, SIGTERM and SIGHUP end it without a trace."""
    before = heeded()
    try:
        for number in before:
            signal.signal(number, _interrupt)
        from verify.cli import run

        return run(sys.argv[1:] if arguments is None else arguments)
    except KeyboardInterrupt:
        print("\nverify: interrupted; earlier results are as they were", file=sys.stderr)
        return INTERRUPTED
    finally:
        for number, handler in before.items():
            signal.signal(number, signal.SIG_DFL if handler is None else handler)


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    raise KeyboardInterrupt


if __name__ == "__main__":
    sys.exit(main())
