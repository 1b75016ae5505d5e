"""`python -m benchmarks.reproduction [--only TOPIC ...] [--page]`."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence

from benchmarks.reproduction import page


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, draw, and write data and page."""
    known = page.topics()
    parser = argparse.ArgumentParser(prog="python -m benchmarks.reproduction", description=__doc__)
    parser.add_argument(
        "--only",
        nargs="+",
        choices=list(known),
        default=list(known),
        metavar="TOPIC",
        help=f"measure these alone and keep the others: {', '.join(known)}",
    )
    parser.add_argument(
        "--page", action="store_true", help="measure nothing: pictures and page from what is kept"
    )
    chosen = parser.parse_args(arguments)
    for name in chosen.only:
        if chosen.page:
            continue
        begun = time.process_time()  # so that a busy machine does not count
        data = known[name].measure()
        took = time.process_time() - begun
        kept = page.read()
        kept["topics"][name], kept["seconds"][name] = data, round(took, 1)
        page.write(kept)
        print(f"{name}: {took:.1f} s", flush=True)
    kept = page.read()
    for name in chosen.only:
        if name in kept["topics"]:
            for file in page.draw(known[name], kept["topics"][name]):
                print(f"{file}: {file.stat().st_size // 1024} kB")
    page.PAGE.write_text(page.render(kept), encoding="utf-8")
    print(page.PAGE)
    return 0


if __name__ == "__main__":
    sys.exit(main())
