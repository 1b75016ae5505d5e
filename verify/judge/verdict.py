"""The judge: from the evidence in a folder to checks, gaps, gates and a verdict."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

from verify import evidence
from verify.evidence import MODEL_OF_PLAN, EvidenceError
from verify.judge.checks import Setting, check_motion
from verify.judge.ends import end_cost, straight_time
from verify.judge.finding import Check
from verify.judge.gates import Gate, Times, gaps, gates
from verify.judge.motion import COLUMNS, Motion
from verify.judge.question import Question, read_question
from verify.judge.tracking import judge_run, record_from_columns

Verdict = Literal["certified", "refined", "failed"]

RECORD_COLUMNS = ("t", "x", "y", "heading", "v", "lateral_acceleration")
# Checks whose stage this version does not have: they are never passed, and hold back no verdict.
ABSENT_STAGES = frozenset({"emergency_stops"})


@dataclass(frozen=True, kw_only=True)
class Judgement:
    """What the evidence shows. A pure function of the folder and the gate limits given by hand."""

    scenario: str
    scenario_sha256: str
    verdict: Verdict
    reasons: tuple[str, ...]  # why the verdict is no better, empty if it holds
    executed: str | None  # the plan that trajectory.csv is a copy of
    plans: Mapping[str, Mapping[str, Any]]
    gaps: Mapping[str, float]
    end_cost: float  # E [s]
    simulation: Mapping[str, Any] | None
    gates: tuple[Gate, ...]
    checks: tuple[Check, ...]

    @property
    def failing_gates(self) -> tuple[Gate, ...]:
        """Gates that were evaluated and do not hold."""
        return tuple(gate for gate in self.gates if gate.passed is False)

    @property
    def unmet_gates(self) -> tuple[Gate, ...]:
        """Gates that somebody named but that could not be evaluated."""
        return tuple(gate for gate in self.gates if gate.passed is None and gate.named)

    @property
    def failing_checks(self) -> tuple[Check, ...]:
        """Checks that failed although their plan promises to pass them."""
        return tuple(check for check in self.checks if check.blocks)

    @property
    def passed(self) -> bool:
        """No failed verdict, gate or check; gates named by the scenario were evaluated."""
        return self.verdict != "failed" and not (
            self.failing_gates or self.failing_checks or self.unmet_gates
        )

    def as_result(self) -> dict[str, Any]:
        """The judged part of result.json."""
        result: dict[str, Any] = {
            "scenario": self.scenario,
            "scenario_sha256": self.scenario_sha256,
            "verdict": self.verdict,
            "reasons": list(self.reasons),
            "plans": {name: dict(plan) for name, plan in self.plans.items()},
            "gaps": dict(self.gaps),
            "end_cost": self.end_cost,
            "gates": [gate.as_result() for gate in self.gates],
            "checks": [check.as_result() for check in self.checks if check.promised],
        }
        if self.executed is not None:
            result["executed"] = self.executed
        if self.simulation is not None:
            result["simulation"] = dict(self.simulation)
        return result


@dataclass(frozen=True, kw_only=True)
class Findings:
    """What the evidence in a folder shows, whatever the limits of the gates."""

    question: Question
    motions: Mapping[str, Motion]  # by plan, in the order of the plans
    executed: str | None
    checks: tuple[Check, ...]
    simulation: Mapping[str, Any] | None
    gaps: Mapping[str, float]
    end_cost: float  # E [s]


def judge(folder: Path, overrides: Mapping[str, float] = MappingProxyType({})) -> Judgement:
    """Judge the evidence in `folder`: the scenario, the trajectories and the recorded run.

    Nothing is planned, solved or simulated, and result.json is not read. `overrides` are gate limits
    that take precedence over the scenario's.

    Raises
    ------
    EvidenceError : evidence is missing or malformed; all faults are listed.
    """
    return decide(examine(folder), overrides)


def examine(folder: Path) -> Findings:
    """Every check and gap; the part of `judge` that takes time.

    Raises
    ------
    EvidenceError : as from `judge`.
    """
    question = read_question(evidence.read_bytes(folder, evidence.SCENARIO))
    setting = question.setting
    motions = _motions(folder)
    executed = _executed(folder, motions)
    checks: list[Check] = []
    for name, motion in motions.items():
        checks += check_motion(motion, name, MODEL_OF_PLAN[name], setting)
    simulation, tracking = _simulation(folder, motions.get(executed or ""), setting)
    checks += [tracking, _emergency_stops()]
    cost, gap = _gaps(setting, motions, checks)
    return Findings(
        question=question,
        motions=motions,
        executed=executed,
        checks=tuple(checks),
        simulation=simulation,
        gaps=gap,
        end_cost=cost,
    )


def decide(findings: Findings, overrides: Mapping[str, float]) -> Judgement:
    """Gates and verdict under the scenario's limits; `overrides` take precedence over them."""
    asked, checks = findings.question, findings.checks
    gate = gates(asked.gates, asked.named_gates, overrides, findings.gaps, checks, findings.executed)
    verdict, reasons = _verdict(findings.motions, findings.executed, checks, gate)
    return Judgement(
        scenario=asked.name,
        scenario_sha256=asked.sha256,
        verdict=verdict,
        reasons=reasons,
        executed=findings.executed,
        plans={name: _plan(name, motion, checks) for name, motion in findings.motions.items()},
        gaps=findings.gaps,
        end_cost=findings.end_cost,
        simulation=findings.simulation,
        gates=gate,
        checks=checks,
    )


def _motions(folder: Path) -> dict[str, Motion]:
    """All trajectories by plan, in the order of the plans."""
    names = [Path(file).stem for file in evidence.trajectory_files(folder)]
    unknown = [name for name in names if name not in MODEL_OF_PLAN]
    reasons = [f"{evidence.TRAJECTORIES}/{name}.csv: not a plan known here" for name in unknown]
    motions = {}
    for name in MODEL_OF_PLAN:
        if name in names:
            try:
                motions[name] = _motion(folder, f"{evidence.TRAJECTORIES}/{name}.csv")
            except EvidenceError as error:
                reasons += error.reasons
    if reasons:
        raise EvidenceError(*reasons)
    return motions


def _motion(folder: Path, file: str) -> Motion:
    columns = evidence.read_table(folder, file, COLUMNS, exact=True)
    return Motion(*(columns[name] for name in COLUMNS))


def _executed(folder: Path, motions: Mapping[str, Motion]) -> str | None:
    """The plan that trajectory.csv is a copy of, byte for byte; None when there is nothing to execute."""
    if not (folder / evidence.EXECUTED).exists():
        return None
    wanted = evidence.read_bytes(folder, evidence.EXECUTED)
    for name in reversed(tuple(motions)):  # the full model's before the others
        if evidence.read_bytes(folder, f"{evidence.TRAJECTORIES}/{name}.csv") == wanted:
            return name
    raise EvidenceError(f"{evidence.EXECUTED}: differs from every plan in {evidence.TRAJECTORIES}/")


def _simulation(folder: Path, motion: Motion | None, setting: Setting) -> tuple[dict[str, Any] | None, Check]:
    if not (folder / evidence.SIMULATION).exists():
        return None, _not_evaluated("tracking", "no simulation was recorded")
    columns = evidence.read_table(folder, evidence.SIMULATION, RECORD_COLUMNS, exact=False)
    if motion is None:
        return None, _not_evaluated("tracking", f"there is no {evidence.EXECUTED} to compare the run with")
    record = record_from_columns(columns)
    if (record.t[1:] <= record.t[:-1]).any() or abs(record.t[0]) > 1e-9:
        raise EvidenceError(f"{evidence.SIMULATION}: times must increase from zero")
    run = judge_run(record, motion, setting.goal.position, setting.surroundings, setting.limits)
    return run.figures, run.check


def _emergency_stops() -> Check:
    return _not_evaluated("emergency_stops", "no emergency stops were recorded")


def _not_evaluated(name: str, message: str) -> Check:
    return Check(name=name, trajectory="simulation", status="not_evaluated", message=message)


def _gaps(
    setting: Setting, motions: Mapping[str, Motion], checks: list[Check]
) -> tuple[float, dict[str, float]]:
    """The extra time of the ends, and the gaps that can be formed."""
    time = {name: motion.travel_time for name, motion in motions.items()}
    cost = _end_cost(setting, time.get("speed_graph", time.get("collocation")))
    sound = [
        name
        for name in motions
        if MODEL_OF_PLAN[name] == "variational"
        and not any(check.trajectory == name and check.blocks for check in checks)
    ]
    times = Times(
        speed_graph=time.get("speed_graph"),
        collocation=time.get("collocation"),
        refined=time.get("refined"),
        best_variational=min((time[name] for name in sound), default=None),
        end_cost=cost,
    )
    return cost, gaps(times)


def _end_cost(setting: Setting, variational: float | None) -> float:
    """E: the better of two proven bounds, by cutting off the ends and by the straight way.

    No motion is faster than the straight way with nothing in it, T_s, and the variational optimum T* is no
    more than the time found for it, so T >= T* + (T_s - T_variational).
    """
    where = (setting.limits, setting.surroundings, setting.start, setting.goal)
    cost = end_cost(*where)
    if variational is None or setting.start.speed == setting.goal.speed == "safe":
        return cost
    return max(cost, straight_time(*where) - variational)


def _plan(name: str, motion: Motion, checks: tuple[Check, ...]) -> dict[str, Any]:
    """What the trajectory itself says about a plan: all limits of the full robot are measured.

    `violations` holds the normalised violation of every check that failed, promised or not;
    `unpromised` says more about those that the plan's model does not promise to pass.
    """
    failed = [check for check in checks if check.trajectory == name and check.status == "failed"]
    plan: dict[str, Any] = {
        "travel_time": motion.travel_time,
        "length": motion.length,
        "model": MODEL_OF_PLAN[name],
        "feasible": not failed,
        "violations": {check.name: check.violation for check in failed},
    }
    unpromised = [check.as_result() for check in failed if not check.promised]
    return plan | {"unpromised": unpromised} if unpromised else plan


def _verdict(
    motions: Mapping[str, Motion], executed: str | None, checks: Sequence[Check], gate: tuple[Gate, ...]
) -> tuple[Verdict, tuple[str, ...]]:
    """`certified`, `refined` or `failed`, and what stands against it.

    certified: the variational optimum (speed graph, else collocation) satisfies every limit of the
    full robot, ends included, is the one to execute, and its certified gap is within the gate.
    refined: the one to execute is the collocation of the full model. Both need all checks of the
    executed trajectory and of its simulation passed; a check whose stage this version does not have
    is not counted. failed: no trajectory passed all checks.
    """
    if executed is None:
        return "failed", ("there is no trajectory to execute",)
    reasons = [
        f"{check.name}: {check.message}"
        for check in checks
        if check.trajectory in (executed, "simulation")
        and check.status != "passed"
        and check.name not in ABSENT_STAGES
    ]
    optimum = "speed_graph" if "speed_graph" in motions else "collocation"
    certified = next(g for g in gate if g.name == "certified_gap")
    if executed == optimum and certified.passed is not True:
        reasons.append(f"{executed}: the certified gap is not shown to be within its gate")
    if executed not in (optimum, "refined"):
        reasons.append(f"{executed} is neither the variational optimum nor the full model's collocation")
    if reasons:
        return "failed", tuple(reasons)
    return ("refined" if executed == "refined" else "certified"), ()
