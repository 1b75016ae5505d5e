"""Gaps between the plans, and the gates that limit them."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from verify.judge.finding import Check

GATE_NAMES = (
    "analytic_gap",
    "refinement_gap",
    "certified_gap",
    "constraint_violation",
    "braking_margin",
    "emergency_stops",
)
AT_LEAST = frozenset({"braking_margin"})  # holds when value >= limit; the others when value <= limit
NOT_CONSTRAINTS = frozenset({"tracking", "emergency_stops"})  # of the simulation, with gates of their own


@dataclass(frozen=True, kw_only=True)
class Gate:
    """One promise about the result; `passed` is None when its stage did not run."""

    name: str
    limit: float
    value: float | None = None
    reason: str = ""  # why it was not evaluated
    scenario_limit: float | None = None  # the scenario's own, where `limit` was given on the command line
    named: bool = False  # the scenario or the command line names this gate itself

    @property
    def overridden(self) -> bool:
        """Whether the limit comes from the command line, not from the scenario."""
        return self.scenario_limit is not None

    @property
    def passed(self) -> bool | None:
        """Whether the gate holds; None when not evaluated."""
        if self.value is None:
            return None
        return self.value >= self.limit if self.name in AT_LEAST else self.value <= self.limit

    def as_result(self) -> dict[str, Any]:
        """The entry of `gates` in result.json."""
        entry: dict[str, Any] = {"name": self.name}
        if self.value is not None:
            entry["value"] = self.value
        entry |= {"limit": self.limit, "passed": self.passed, "named": self.named}
        if self.overridden:
            entry |= {"overridden": True, "scenario_limit": self.scenario_limit}
        if self.value is None:
            entry["reason"] = self.reason
        return entry


@dataclass(frozen=True, kw_only=True)
class Times:
    """Travel times [s] the gaps are made of; None where there is no such figure."""

    speed_graph: float | None = None
    collocation: float | None = None
    refined: float | None = None
    best_variational: float | None = None  # least feasible time of the variational model
    lower_bound: float | None = None
    end_cost: float = 0.0
    isotropic: bool = True  # whether the braking zone is a disc, as the speed graph has it

    @property
    def variational(self) -> float | None:
        """The variational optimum: of the speed graph, else of the collocation.

        With a zone that depends on the heading the speed graph solves what stands for it, and its path is
        timed again: then there is an optimum only of the collocation, and the better of both is it.
        """
        if not self.isotropic and self.collocation is None:
            return None
        given = [time for time in (self.speed_graph, self.collocation) if time is not None]
        if not self.isotropic:
            return min(given)
        return given[0] if given else None


def gaps(times: Times) -> dict[str, float]:
    """The gaps that can be formed; the others are absent."""
    found = {}
    if times.isotropic and times.speed_graph is not None and times.collocation:
        found["analytic"] = times.speed_graph / times.collocation - 1.0
    if times.refined is not None and times.variational:
        found["refinement"] = times.refined / (times.variational + times.end_cost) - 1.0
    proven = times.lower_bound if times.lower_bound is not None and times.lower_bound > 0.0 else None
    compared = times.isotropic or times.variational is not None
    if times.best_variational is not None and proven is not None and compared:
        found["certified"] = times.best_variational / proven - 1.0
    if times.refined is not None and proven is not None:
        found["certified_full"] = times.refined / (proven + times.end_cost) - 1.0
    return found


def gates(
    limits: Mapping[str, float],
    named: Collection[str],
    overrides: Mapping[str, float],
    gap: Mapping[str, float],
    checks: Iterable[Check],
    result: str | None,
    *,
    bad_stops: int | None = None,
    no_bound: str = "no lower bound was computed",
    no_stops: str = "no emergency stops were recorded",
    isotropic: bool = True,
) -> tuple[Gate, ...]:
    """All six gates.

    Parameters
    ----------
    limits, named : the scenario's limits, and which gates it names itself.
    overrides : limits from the command line, which take precedence.
    gap : as from `gaps`.
    checks : of all trajectories.
    result : the plan that is to be executed, None without one.
    bad_stops : emergency stops that end badly, None without evidence.
    no_bound, no_stops : why there is no certified gap and no such number, where there is none.
    isotropic : whether the braking zone is a disc.
    """
    checks = tuple(checks)
    values: dict[str, float | None] = {
        "analytic_gap": abs(gap["analytic"]) if "analytic" in gap else None,
        "refinement_gap": gap.get("refinement"),
        "certified_gap": gap.get("certified"),
        "constraint_violation": _worst_violation(checks, result),
        "braking_margin": next(
            (c.worst for c in checks if c.name == "braking_distance" and c.trajectory == result), None
        ),
        "emergency_stops": None if bad_stops is None else float(bad_stops),
    }
    reasons = {
        "analytic_gap": "not evaluated: no speed graph to compare with the collocation"
        if isotropic
        else "not evaluated: the speed graph solves the problem with a disc in place of the zone only",
        "refinement_gap": "not evaluated: no refined trajectory, or no variational optimum",
        "certified_gap": f"not evaluated: {no_bound}",
        "constraint_violation": "not evaluated: there is no trajectory to execute",
        "braking_margin": "not evaluated: there is no trajectory to execute",
        "emergency_stops": f"not evaluated: {no_stops}",
    }
    return tuple(
        Gate(
            name=name,
            limit=float(overrides.get(name, limits[name])),
            value=values[name],
            reason=reasons[name],
            scenario_limit=float(limits[name]) if name in overrides else None,
            named=name in named or name in overrides,
        )
        for name in GATE_NAMES
    )


def _worst_violation(checks: tuple[Check, ...], result: str | None) -> float | None:
    """Worst normalised violation of what each plan promises; None without a result."""
    if result is None or not any(check.trajectory == result for check in checks):
        return None
    found = [
        check.violation
        for check in checks
        if check.violation is not None
        and check.name not in NOT_CONSTRAINTS
        and (check.promised or check.trajectory == result)
    ]
    return max(found, default=math.inf) if found else None
