"""The command `verify`, and `python -m verify`."""

from __future__ import annotations

import signal
import sys
from types import FrameType

INTERRUPTED = 130  # the shell's code for Ctrl-C


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; returns the exit code. Ctrl-C and SIGTERM end it without a trace."""
    before = signal.signal(signal.SIGTERM, _interrupt)
    try:
        from verify.cli import run

        return run(sys.argv[1:] if arguments is None else arguments)
    except KeyboardInterrupt:
        print("\nverify: interrupted; earlier results are as they were", file=sys.stderr)
        return INTERRUPTED
    finally:
        signal.signal(signal.SIGTERM, before)


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    raise KeyboardInterrupt


if __name__ == "__main__":
    sys.exit(main())
