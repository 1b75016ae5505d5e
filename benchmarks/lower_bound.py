"""The lower bound: how tight after how long, on large worlds, its checker, and fast marching beside it.

Every case runs in a process of its own, which tells the most memory it held. Certified gap: the least time
known over the bound, less one. scikit-fmm (second order, same exact distances) is the peer; its time at the
goal is an estimate that proves nothing, and its error is that against the same least time.
"""

from __future__ import annotations

import multiprocessing
import os
import statistics
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
import skfmm

from benchmarks.large_maps import field_of_hexagons, hall_of_boxes
from benchmarks.speed_graph import gallery, marched
from verify.judge.certificate import check_certificate, read_certificate
from verify.judge.question import read_question
from vnav_drake.lower_bound import LowerBound, lower_bound
from vnav_drake.problem import Problem
from vnav_drake.speed_graph import speed_graph

GALLERY = Path(__file__).parent.parent / "scenarios"
ENDLESS = 10_000_000  # triangles: a budget that no run here spends
ROUNDS = 3


@dataclass(frozen=True)
class Case:
    """A scenario of the gallery, and the gaps [%] that are aimed at."""

    name: str
    aims: tuple[tuple[float, float], ...]  # after so many seconds, at most so many per cent

    @property
    def least(self) -> float:
        """Time [s] of the fastest class: exact to ten digits, and that of a path that can be driven."""
        return fastest(gallery(self.name))


CASES = (
    Case("warehouse", ((5.0, 0.3), (30.0, 0.005))),
    Case("four_point_room", ((5.0, 0.08), (30.0, 0.002))),
    Case("single_wall", ((5.0, 0.03), (30.0, 0.0005))),
    Case("single_point", ((5.0, 0.03), (30.0, 0.0005))),
)
LARGE: Sequence[tuple[str, Callable[[], Problem], float, float]] = (
    ("40 x 40 m, 90 rectangles", hall_of_boxes, 1.0, 20.0),  # name, world, aim [%], aim [s]
    ("1,600 vertices", field_of_hexagons, 2.0, 60.0),
)
CHECKED = 20_000  # triangles of the certificate that is checked
FLOATING, EXACT = 0.2, 10.0  # aims [s]
CELLS = (320, 1600)  # of fast marching, along the longer side; the warehouse has its ridges on nodes then


T = TypeVar("T")


@dataclass(frozen=True)
class Outcome:
    """One run of the solver, told by its process."""

    rounds: tuple[tuple[float, int, float], ...]  # seconds, triangles, best bound so far [s]
    stopped: str
    wall: float  # [s], of the whole call
    memory: float  # [GB], most that the process held, its libraries included

    def at(self, seconds: float) -> tuple[int, float]:
        """Triangles and bound [s] that were there after so many seconds; none and zero before the first."""
        done = [(triangles, bound) for when, triangles, bound in self.rounds if when <= seconds]
        return done[-1] if done else (0, 0.0)


def fastest(problem: Problem) -> float:
    """Time [s] of the fastest path that the speed graph finds."""
    return speed_graph(problem, classes=1, with_published=False).classes[0].travel_time


def _outcome(found: LowerBound, wall: float) -> Outcome:
    best = np.maximum.accumulate([r.lower_bound for r in found.rounds]).tolist()
    rounds = tuple((r.seconds, r.triangles, b) for r, b in zip(found.rounds, best, strict=True))
    return Outcome(rounds, found.stopped, wall, _peak_memory())


def _peak_memory() -> float:
    """Most memory [GB] that this process held; getrusage counts that of the parent before it as well."""
    status = Path("/proc/self/status").read_text(encoding="ascii")  # Linux only
    (line,) = [line for line in status.splitlines() if line.startswith("VmHWM:")]
    return int(line.split()[1]) * 1024 / 1e9


def solve_known(name: str, seconds: float) -> Outcome:
    """The bound of a scenario of the gallery, refined until `seconds` have passed."""
    problem = gallery(name)
    begun = time.perf_counter()
    found = lower_bound(problem, budget=ENDLESS, time_limit=seconds)
    return _outcome(found, time.perf_counter() - begun)


def solve_large(index: int, upper: float, gap: float, seconds: float) -> Outcome:
    """The bound of a large world, until the gap to `upper` [s] is reached or `seconds` have passed."""
    problem = LARGE[index][1]()
    begun = time.perf_counter()
    found = lower_bound(problem, upper=upper, gap=gap, budget=ENDLESS, time_limit=seconds)
    return _outcome(found, time.perf_counter() - begun)


def against_time() -> None:
    """Print the gap after 5 s and 30 s where the optimum is known, and fast marching in the same run."""
    head = f"{'scenario':<18}{'after':>7}{'triangles':>11}{'gap [%]':>10}{'aim [%]':>10}{'memory [GB]':>13}"
    print(head)
    for case in CASES:
        least, outcome = case.least, _apart(solve_known, case.name, case.aims[-1][0])
        for seconds, aim in case.aims:
            triangles, bound = outcome.at(seconds)
            gap = f"{100.0 * (least / bound - 1.0):.5f}" if bound > 0.0 else "none"
            print(
                f"{case.name:<18}{seconds:5.0f} s{triangles:11d}{gap:>10}{aim:10.4f}{outcome.memory:13.2f}",
                flush=True,
            )
        _against_marching(case.name, least, outcome)


def _against_marching(name: str, least: float, outcome: Outcome) -> None:
    """Print the error of fast marching, and how long it took as a ratio to the bound with a gap as small."""
    for cells in CELLS:
        value, distances, marching = marched(gallery(name), cells)
        error = abs(value / least - 1.0)
        equal = next((when for when, _, bound in outcome.rounds if least / bound - 1.0 <= error), None)
        ratio = "not reached" if equal is None else f"{(distances + marching) / equal:.2f} of the bound's"
        print(
            f"  scikit-fmm {cells:5d} cells: {distances + marching:6.2f} s, error {100.0 * error:.5f} %;"
            f" time at equal size of gap: {ratio}",
            flush=True,
        )


def against_size() -> None:
    """Print when the aim was reached on the large worlds, and the memory that it took."""
    head = f"{'world':<28}{'best known':>12}{'bound [s]':>11}{'gap [%]':>9}{'aim [%]':>9}{'time [s]':>10}"
    print(f"\n{head}{'aim [s]':>9}{'triangles':>11}{'memory [GB]':>13}")
    for index, (name, make, aim, seconds) in enumerate(LARGE):
        upper = fastest(make())
        outcome = _apart(solve_large, index, upper, 0.01 * aim, seconds)
        _, triangles, bound = outcome.rounds[-1]
        gap = 100.0 * (upper / bound - 1.0) if bound > 0.0 else float("inf")
        print(
            f"{name:<28}{upper:12.4f}{bound:11.4f}{gap:9.3f}{aim:9.3f}{outcome.wall:10.1f}{seconds:9.0f}"
            f"{triangles:11d}{outcome.memory:13.2f}  stopped: {outcome.stopped}",
            flush=True,
        )


def checker() -> None:
    """Print how long the judge takes for a certificate of the warehouse."""
    problem, budget = gallery("warehouse"), 2 * CHECKED
    best = lower_bound(problem, budget=budget)
    while len(best.certificate.triangles) < CHECKED:
        budget *= 2
        best = lower_bound(problem, budget=budget)
    with tempfile.TemporaryDirectory() as folder:
        best.certificate.save(Path(folder) / "certificate.npz")
        size = (Path(folder) / "certificate.npz").stat().st_size
        file = read_certificate(Path(folder))
    question = read_question((GALLERY / "warehouse.yaml").read_bytes())
    if file is None:
        raise RuntimeError("the certificate that was saved is not found")
    kept, dropped = len(file.triangles), len(file.dropped)
    print(f"\nchecker, warehouse: {kept} kept and {dropped} dropped triangles, file {size / 1e6:.2f} MB")
    for name, exact, aim in (("floating point", False, FLOATING), ("exact", True, EXACT)):
        times = []
        for _ in range(ROUNDS):
            begun = time.perf_counter()
            proof = check_certificate(file, question, exact=exact)
            times.append(time.perf_counter() - begun)
        verdict = f"holds, {proof.travel_time:.6f} s" if proof.holds else "; ".join(proof.reasons)
        median = statistics.median(times)
        each = median * CHECKED / kept
        print(f"  {name:<15}{median:7.2f} s; for {CHECKED} kept {each:.2f} s, aim {aim:.1f} s; {verdict}")


def _apart(run: Callable[..., T], *given: object) -> T:
    """The result of a function run in a fresh process."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(run, given)


def main() -> None:
    """Print all tables."""
    load = os.getloadavg()[0]
    print(f"load of the machine: {load:.1f} on {os.cpu_count()} cores; scikit-fmm {skfmm.__version__}")
    against_time()
    against_size()
    checker()


if __name__ == "__main__":
    main()
