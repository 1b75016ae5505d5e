"""The judge: from the evidence in a folder to checks, gaps, gates and a verdict."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

from verify import evidence
from verify.evidence import MODEL_OF_PLAN, EvidenceError
from verify.judge.bound import NAME as LOWER_BOUND
from verify.judge.bound import Bound, judge_bound
from verify.judge.certificate import CertificateFile, Proof, check_certificate, read_certificate
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
    bound: Bound | None = None  # what the certificate proves; None without one

    @property
    def failing_gates(self) -> tuple[Gate, ...]:
        """Gates that were evaluated and do not hold."""
        return tuple(gate for gate in self.gates if gate.passed is False)

    @property
    def unmet_gates(self) -> tuple[Gate, ...]:
        """Gates that somebody named but that could not be evaluated."""
        return tuple(gate for gate in self.gates if gate.passed is None and gate.named)

    @property
    def unfinished_gates(self) -> tuple[Gate, ...]:
        """Unmet gates whose stage gave nothing to judge: not that of a certificate that was refused."""
        refused = self.bound is not None and self.bound.travel_time is None
        return tuple(g for g in self.unmet_gates if not (refused and g.name == "certified_gap"))

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
        if self.bound is not None:
            result["lower_bound"] = self.bound.as_result()
        return result


@dataclass(frozen=True, kw_only=True)
class Findings:
    """What the evidence in a folder shows, whatever the limits of the gates."""

    question: Question
    motions: Mapping[str, Motion]  # by plan, in the order of the plans
    executed: str | None
    same: frozenset[str]  # plans that trajectory.csv is a copy of: more than one where they are identical
    checks: tuple[Check, ...]
    simulation: Mapping[str, Any] | None
    gaps: Mapping[str, float]
    end_cost: float  # E [s]
    certificate: CertificateFile | None = None
    bound: Bound | None = None


def judge(folder: Path, overrides: Mapping[str, float] = MappingProxyType({})) -> Judgement:
    """Judge the evidence in `folder`: the scenario, the trajectories, the recorded run and the certificate.

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
    same = _executed(folder, motions)
    executed = same[0] if same else None
    certificate = read_certificate(folder)
    checks: list[Check] = []
    for name, motion in motions.items():
        checks += check_motion(motion, name, MODEL_OF_PLAN[name], setting)
    simulation, tracking = _simulation(folder, motions.get(executed or ""), setting)
    checks += [tracking, _emergency_stops()]
    proof = None if certificate is None else check_certificate(certificate, question)
    findings = Findings(
        question=question,
        motions=motions,
        executed=executed,
        same=frozenset(same),
        checks=tuple(checks),
        simulation=simulation,
        gaps={},
        end_cost=0.0,
        certificate=certificate,
    )
    return _with_proof(findings, proof)


def exactly(findings: Findings) -> Findings:
    """The same, with the certificate checked in rational arithmetic; unchanged without a certificate."""
    if findings.certificate is None:
        return findings
    return _with_proof(findings, check_certificate(findings.certificate, findings.question, exact=True))


def _with_proof(findings: Findings, proof: Proof | None) -> Findings:
    """The gaps, and the check of the certificate, that go with a proof."""
    setting, motions = findings.question.setting, findings.motions
    checks = tuple(check for check in findings.checks if check.trajectory != LOWER_BOUND)
    bound = None if proof is None else judge_bound(proof, motions, checks, setting)
    cost, gap = _gaps(setting, motions, checks, None if bound is None else bound.travel_time)
    if bound is not None:
        checks = (*checks, bound.check)
    return replace(findings, checks=checks, gaps=gap, end_cost=cost, bound=bound)


def decide(findings: Findings, overrides: Mapping[str, float]) -> Judgement:
    """Gates and verdict under the scenario's limits; `overrides` take precedence over them."""
    asked, checks = findings.question, findings.checks
    gap, no_bound = _gaps_to_limit(findings, overrides)
    gate = gates(asked.gates, asked.named_gates, overrides, gap, checks, findings.executed, no_bound=no_bound)
    executed = _chosen(findings.motions, findings.executed, findings.same, gate)
    verdict, reasons = _verdict(findings.motions, executed, checks, gate)
    return Judgement(
        scenario=asked.name,
        scenario_sha256=asked.sha256,
        verdict=verdict,
        reasons=reasons,
        executed=executed,
        plans={name: _plan(name, motion, checks) for name, motion in findings.motions.items()},
        gaps=findings.gaps,
        end_cost=findings.end_cost,
        simulation=findings.simulation,
        gates=gate,
        checks=checks,
        bound=findings.bound,
    )


def _gaps_to_limit(findings: Findings, overrides: Mapping[str, float]) -> tuple[Mapping[str, float], str]:
    """The gaps that gates limit, and why the certified one is not among them, where it is not.

    The bound holds for all ways. Where only some were asked for, a small gap proves that the fastest is one
    of them; a large one says nothing against the plan, so the gate is held against it only if it is named.
    """
    bound, gap, asked = findings.bound, findings.gaps, findings.question
    if bound is None:
        return gap, "no lower bound was computed"
    if bound.travel_time is None:
        return gap, "the certificate is refused"
    if asked.some_ways and not {"certified_gap"} & {*asked.named_gates, *overrides}:
        limited = {k: v for k, v in gap.items() if k != "certified" or v <= asked.gates["certified_gap"]}
        return limited, "the lower bound is over all ways, and plan.through asks for some of them"
    return gap, "no plan to compare the lower bound with"


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


def _executed(folder: Path, motions: Mapping[str, Motion]) -> list[str]:
    """The plans that trajectory.csv is a copy of, byte for byte; empty when there is nothing to execute."""
    if not (folder / evidence.EXECUTED).exists():
        return []
    wanted = evidence.read_bytes(folder, evidence.EXECUTED)
    same = [
        name
        for name in reversed(tuple(motions))  # the full model's before the others
        if evidence.read_bytes(folder, f"{evidence.TRAJECTORIES}/{name}.csv") == wanted
    ]
    if not same:
        raise EvidenceError(f"{evidence.EXECUTED}: differs from every plan in {evidence.TRAJECTORIES}/")
    return same


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
    setting: Setting, motions: Mapping[str, Motion], checks: Sequence[Check], lower_bound: float | None
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
        lower_bound=lower_bound,
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
    optimum = _optimum(motions)
    if executed == optimum and not _gap_certified(gate):
        reasons.append(f"{executed}: the certified gap is not shown to be within its gate")
    if executed not in (optimum, "refined"):
        reasons.append(f"{executed} is neither the variational optimum nor the full model's collocation")
    if reasons:
        return "failed", tuple(reasons)
    return ("refined" if executed == "refined" else "certified"), ()


def _optimum(motions: Mapping[str, Motion]) -> str:
    """The plan that stands for the variational optimum."""
    return "speed_graph" if "speed_graph" in motions else "collocation"


def _gap_certified(gate: Sequence[Gate]) -> bool:
    return next(g for g in gate if g.name == "certified_gap").passed is True


def _chosen(
    motions: Mapping[str, Motion], executed: str | None, same: frozenset[str], gate: Sequence[Gate]
) -> str | None:
    """The plan executed, by its best name: a motion that is several plans at once is the optimum where
    that is certified, else the first in the order of `_executed`."""
    optimum = _optimum(motions)
    others = tuple(name for name in ("refined", optimum) if name in same)
    if not others:
        return executed
    return optimum if optimum in same and _gap_certified(gate) else others[0]
