"""Run every benchmark of this package, or those named: `python -m benchmarks world`.

A benchmark is a module with a function `main() -> None` that prints its table. Studies take too long to be
among them; they are run by their own names: `python -m benchmarks.ranking`.
"""

from __future__ import annotations

import importlib
import pkgutil
import platform
import sys

import benchmarks

# studies, what others measure with, and pictures
NOT_HERE = {
    "ranking",
    "vc_study",
    "random_worlds",
    "vehicle_alone",
    "large_maps",
    "figures",
    "figures_certificate",
    "figures_vc_method",
    "reproduction",
    "held_stops",
    "figures_fields",
}


def main(wanted: list[str]) -> int:
    """Run the benchmarks; 2 when one asked for does not exist."""
    known = sorted(
        m.name
        for m in pkgutil.iter_modules(benchmarks.__path__)
        if not m.name.startswith("_") and m.name not in NOT_HERE
    )
    unknown = sorted(set(wanted) - set(known))
    if unknown:
        print(f"no benchmark {', '.join(unknown)}; there are: {', '.join(known)}", file=sys.stderr)
        return 2
    print(f"Python {platform.python_version()}, {platform.machine()}, {platform.system()}")
    for name in wanted or known:
        print(f"\n== {name}", flush=True)
        importlib.import_module(f"benchmarks.{name}").main()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
