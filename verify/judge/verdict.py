"""The judge: from the evidence in a folder to checks, gaps, gates and a verdict."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

from verify import evidence
from verify.evidence import MODEL_OF_PLAN
from verify.judge.bound import NAME as LOWER_BOUND
from verify.judge.bound import Bound, judge_bound
from verify.judge.certificate import CertificateFile, Proof, check_certificate, read_certificate
from verify.judge.checks import Setting, check_motion, reaches
from verify.judge.ends import end_cost, straight_time
from verify.judge.finding import Check
from verify.judge.gates import Gate, Times, gaps, gates
from verify.judge.motion import Motion
from verify.judge.question import Question, read_question
from verify.judge.reading import PRESCREEN, read_executed, read_motions, read_simulation
from verify.judge.stops import NAME as STOPS
from verify.judge.stops import Stops, stops_check, why_no_stops
from verify.judge.zone_block import zone_block
from verify.judge.zones.fields_file import FieldsFile, fields_of, read_fields

Verdict = Literal["certified", "refined", "failed"]

# Relative. Rows of both are slowed by 1e-6 and by what proves their clearance between samples, up to 1e-5
# in all: a motion that is faster by less than that is not faster.
SAME_TIME = 1e-5
# A run of these may end elsewhere than at the goal: then it has no travel time.
MAY_GET_STUCK = frozenset({"dwa"})


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
    zone: Mapping[str, Any] | None = None  # of a braking zone that is not a disc, and of field sets

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
        """Unmet gates whose stage gave nothing to judge: not that of refused evidence."""
        refused = {check.name for check in self.checks if check.name == STOPS and check.blocks}
        if self.bound is not None and self.bound.travel_time is None:
            refused.add("certified_gap")
        return tuple(gate for gate in self.unmet_gates if gate.name not in refused)

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

    @property
    def lacks_only_stops(self) -> bool:
        """Whether nothing stands against it but emergency stops that were not recorded yet."""
        open_check = any(check.name == STOPS and check.status == "not_evaluated" for check in self.checks)
        only = bool(self.reasons) and all(reason.startswith(f"{STOPS}:") for reason in self.reasons)
        return open_check and only and not (self.failing_gates or self.failing_checks)

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
        if self.zone is not None:
            result["zone"] = dict(self.zone)
        return result


@dataclass(frozen=True, kw_only=True)
class Findings:
    """What the evidence in a folder shows, whatever the limits of the gates."""

    question: Question
    motions: Mapping[str, Motion]  # by plan, in the order of the plans
    executed: str | None
    same: frozenset[str]  # plans that trajectory.csv is a copy of: more than one where they are identical
    checks: tuple[Check, ...]  # all but that of the emergency stops, which needs the limit of its gate
    simulation: Mapping[str, Any] | None
    gaps: Mapping[str, float]
    end_cost: float  # E [s]
    stops: Stops | None = None
    certificate: CertificateFile | None = None
    bound: Bound | None = None
    zone: Mapping[str, Any] | None = None


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
    question, file = _read_question(folder)
    setting = question.setting
    motions = read_motions(folder)
    same = read_executed(folder, motions)
    executed = same[0] if same else None
    certificate = read_certificate(folder)
    checks: list[Check] = []
    for name, motion in motions.items():
        checks += check_motion(motion, name, MODEL_OF_PLAN[name], setting)
    claimed = setting.zone_of(executed or "")
    simulated = read_simulation(folder, motions.get(executed or ""), question, claimed)
    checks += simulated.checks
    zone, of_fields = zone_block(setting, file, executed, motions)
    checks += of_fields
    proof = None if certificate is None else check_certificate(certificate, question)
    findings = Findings(
        question=question,
        motions=motions,
        executed=executed,
        same=frozenset(same),
        checks=tuple(checks),
        simulation=simulated.figures,
        stops=simulated.stops,
        gaps={},
        end_cost=0.0,
        certificate=certificate,
        zone=zone,
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
    sound = _sound(motions, checks, setting)
    cost = 0.0 if proof is not None and proof.driven else _end_cost(setting, sound)
    bound = None if proof is None else judge_bound(proof, sound, cost, checks, setting)
    proven = None if bound is None else bound.travel_time
    gap = _gaps(motions, sound, cost, proven, isotropic=setting.isotropic)
    if bound is not None:
        checks = (*checks, bound.check)
    return replace(findings, checks=checks, gaps=gap, end_cost=cost, bound=bound)


def decide(findings: Findings, overrides: Mapping[str, float]) -> Judgement:
    """Gates and verdict under the scenario's limits; `overrides` take precedence over them."""
    asked = findings.question
    limit = float({**asked.gates, **overrides}[STOPS])
    checks = (*findings.checks, stops_check(asked.drive, findings.stops, limit))
    gap, no_bound = _gaps_to_limit(findings, overrides)
    gate = gates(
        asked.gates,
        asked.named_gates,
        overrides,
        gap,
        checks,
        findings.executed,
        bad_stops=None if findings.stops is None else findings.stops.bad,
        no_bound=no_bound,
        no_stops=why_no_stops(asked.drive, findings.stops),
        isotropic=asked.setting.isotropic,
    )
    lower = None if findings.bound is None else findings.bound.travel_time
    times = {name: motion.travel_time for name, motion in findings.motions.items()}
    optimum = _optimum(times, isotropic=asked.setting.isotropic)
    certified = _nothing_to_refine(
        times, optimum, _sound(findings.motions, checks, asked.setting), lower, gate
    )
    executed = _chosen(optimum, findings.executed, findings.same, certified)
    verdict, reasons = _verdict(optimum, executed, checks, certified)
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
        zone=findings.zone,
    )


def _read_question(folder: Path) -> tuple[Question, FieldsFile | None]:
    """What was asked, with the fields that were fitted, and the file that tells of them."""
    question = read_question(evidence.read_bytes(folder, evidence.SCENARIO))
    asked = question.setting.zone
    if asked is None or asked.type != "field_set":
        return question, None
    file = read_fields(folder)
    setting = replace(question.setting, fields=fields_of(asked, file))
    return replace(question, setting=setting), file


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
    if not asked.setting.isotropic and "collocation" not in findings.motions:
        return gap, "the variational model has no optimum with this braking zone to compare the bound with"
    if asked.some_ways and not {"certified_gap"} & {*asked.named_gates, *overrides}:
        limited = {k: v for k, v in gap.items() if k != "certified" or v <= asked.gates["certified_gap"]}
        return limited, "the lower bound is over all ways, and plan.through asks for some of them"
    return gap, "no plan to compare the lower bound with"


def _sound(motions: Mapping[str, Motion], checks: Sequence[Check], setting: Setting) -> dict[str, Motion]:
    """The motions from start to goal that keep what their plan promises."""
    broken = {check.trajectory for check in checks if check.blocks}
    return {
        name: motion for name, motion in motions.items() if name not in broken and reaches(motion, setting)
    }


def _gaps(
    motions: Mapping[str, Motion],
    sound: Mapping[str, Motion],
    cost: float,
    lower_bound: float | None,
    *,
    isotropic: bool,
) -> dict[str, float]:
    """The gaps that can be formed."""
    time = {name: motion.travel_time for name, motion in motions.items()}
    variational = [time[name] for name in sound if MODEL_OF_PLAN[name] == "variational"]
    times = Times(
        speed_graph=time.get("speed_graph"),
        collocation=time.get("collocation"),
        refined=time.get("refined"),
        best_variational=min(variational, default=None),
        lower_bound=lower_bound,
        end_cost=cost,
        isotropic=isotropic,
    )
    return gaps(times)


def _end_cost(setting: Setting, sound: Mapping[str, Motion]) -> float:
    """E: the better of two proven bounds, by cutting off the ends and by the straight way.

    No motion is faster than the straight way with nothing in it, T_s, and the variational optimum T* is no
    more than the time of a sound motion, so T >= T* + (T_s - T_variational).
    """
    where = (setting.limits, setting.surroundings, setting.start, setting.goal)
    zone = None if setting.zone is None else setting.zone.zone
    cost = end_cost(*where, zone)
    optima = [sound[name] for name in ("speed_graph", "collocation") if name in sound]
    if not optima or setting.start.speed == setting.goal.speed == "safe":
        return cost
    least = min(motion.travel_time for motion in (optima[:1] if setting.isotropic else optima))
    return max(cost, straight_time(*where, zone) - least)


def _plan(name: str, motion: Motion, checks: tuple[Check, ...]) -> dict[str, Any]:
    """What the trajectory itself says about a plan: all limits of the full robot are measured.

    `violations` holds the normalised violation of every check that failed, promised or not;
    `unpromised` says more about those that the plan's model does not promise to pass.
    """
    failed = [check for check in checks if check.trajectory == name and check.status == "failed"]
    plan: dict[str, Any] = {
        **_duration(name, motion, failed),
        "length": motion.length,
        "model": MODEL_OF_PLAN[name],
        "feasible": not failed,
        "violations": {check.name: check.violation for check in failed},
    }
    unpromised = [check.as_result() for check in failed if not check.promised]
    return plan | {"unpromised": unpromised} if unpromised else plan


def _duration(name: str, motion: Motion, failed: Sequence[Check]) -> dict[str, Any]:
    """The travel time; of a run that may get stuck whether it did not, else after which time it ended."""
    if name not in MAY_GET_STUCK:
        return {"travel_time": motion.travel_time}
    if any(check.name in ("goal", "travel_time") for check in failed):
        return {"reached": False, "stopped_after": motion.travel_time}
    return {"reached": True, "travel_time": motion.travel_time}


def _verdict(
    optimum: str, executed: str | None, checks: Sequence[Check], certified: bool
) -> tuple[Verdict, tuple[str, ...]]:
    """`certified`, `refined` or `failed`, and what stands against it.

    certified: the variational optimum (speed graph, else collocation) satisfies every limit of the
    full robot, ends included, is the one to execute, and is `_nothing_to_refine`.
    refined: the one to execute is the collocation of the full model. Both need all checks of the
    executed trajectory and of its simulation passed; a check that the scenario does not ask for
    is not counted. failed: no trajectory passed all checks.
    """
    if executed is None:
        return "failed", ("there is no trajectory to execute",)
    reasons = [
        f"{check.name}: {check.message}"
        for check in checks
        if check.trajectory in (executed, "simulation", PRESCREEN)
        and check.status != "passed"
        and check.wanted
    ]
    if executed == optimum and not certified:
        reasons.append(
            f"{executed}: its own certified gap is not shown to be within the gate, or another plan is faster"
        )
    if executed not in (optimum, "refined"):
        reasons.append(f"{executed} is neither the variational optimum nor the full model's collocation")
    if reasons:
        return "failed", tuple(reasons)
    return ("refined" if executed == "refined" else "certified"), ()


def _optimum(times: Mapping[str, float], *, isotropic: bool = True) -> str:
    """The plan that stands for the variational optimum, by the travel `times` [s] of all plans.

    With a zone that depends on the heading the faster of both, as the speed graph is exact for discs only.
    """
    if isotropic or "collocation" not in times:
        return "speed_graph" if "speed_graph" in times else "collocation"
    return min((name for name in ("collocation", "speed_graph") if name in times), key=times.__getitem__)


def _nothing_to_refine(
    times: Mapping[str, float],
    optimum: str,
    sound: Collection[str],
    lower_bound: float | None,
    gate: Sequence[Gate],
) -> bool:
    """Whether the plan that stands for the variational optimum is certified to be one.

    The gate holds the best of the travel `times` [s] against the bound; here the plan's own must be within
    the same limit, and no `sound` plan may be faster.
    """
    limit = next(g for g in gate if g.name == "certified_gap")
    own = times.get(optimum)
    if limit.passed is not True or lower_bound is None or own is None:
        return False
    fastest = min((times[name] for name in sound), default=own)
    return own / lower_bound - 1.0 <= limit.limit and own <= fastest * (1.0 + SAME_TIME)


def _chosen(optimum: str, executed: str | None, same: Collection[str], certified: bool) -> str | None:
    """The plan executed, by its best name: a motion that is several plans at once is the optimum where
    that is certified, else the first in the order of `_executed`."""
    others = tuple(name for name in ("refined", optimum) if name in same)
    if not others:
        return executed
    return optimum if optimum in same and certified else others[0]
