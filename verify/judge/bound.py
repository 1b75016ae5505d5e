"""What the certificate proves, and whether any trajectory contradicts it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from verify.digits import rounded
from verify.evidence import MODEL_OF_PLAN
from verify.judge.certificate import Proof
from verify.judge.checks import Setting
from verify.judge.ends import disc_around
from verify.judge.finding import Check
from verify.judge.motion import Motion
from verify.judge.promises import ENDS
from verify.judge.zones import GaugeZone

NAME = "lower_bound"  # what the check is about, in place of a trajectory
JOINTS = 2e-8  # [m]: more than the jumps between all rows of a motion that passes the check travel_time
ROUNDING = 1e-12  # relative: of sums over some thousand rows
IN_MESSAGE, LISTED = 3, 20  # reasons told


@dataclass(frozen=True, kw_only=True)
class Bound:
    """The checked certificate."""

    proof: Proof
    beaten: tuple[str, ...] = ()  # trajectories faster than what was proven possible

    @property
    def travel_time(self) -> float | None:
        """Proven least travel time [s] of the variational model, over all ways; None: nothing is proven."""
        return None if self.reasons else float(self.proof.travel_time)

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why the certificate is refused; empty when it holds."""
        if not self.proof.holds:
            return tuple(self.proof.reasons) or ("the certificate does not hold",)
        return self.beaten

    @property
    def told(self) -> tuple[str, ...]:
        """The reasons, as many as anyone reads."""
        more = len(self.reasons) - LISTED
        return self.reasons[:LISTED] + ((f"and {more} more",) if more > 0 else ())

    @property
    def check(self) -> Check:
        """The check `certificate`: `worst` is the least relative slack of its inequality."""
        slack = float(self.proof.worst)
        finite = math.isfinite(slack)
        failed = bool(self.reasons)
        more = len(self.reasons) - IN_MESSAGE
        words = [*self.reasons[:IN_MESSAGE], *([f"and {more} more"] if more > 0 else [])]
        return Check(
            name="certificate",
            trajectory=NAME,
            status="failed" if failed else "passed",
            message="; ".join(words) or f"no motion is faster than {self._proven} s",
            worst=slack if finite else None,
            violation=max(0.0, -slack) if finite else None,
        )

    @property
    def _proven(self) -> str:
        """The proven time, with its last digit rounded down."""
        return rounded(float(self.proof.travel_time), 6)

    def as_result(self) -> dict[str, Any]:
        """The judged part of `lower_bound` in result.json."""
        proof = self.proof
        entry: dict[str, Any] = {
            "holds": not self.reasons,
            "triangles": int(proof.triangles),
            "dropped": int(proof.dropped),
            "exact": bool(proof.exact),
        }
        if proof.driven:
            entry["driven"] = True  # of the full robot with its ends, so that no end cost goes on top
        if math.isfinite(proof.worst):
            entry["worst_slack"] = float(proof.worst)
        if self.travel_time is None:
            return entry | {"reasons": list(self.told)}
        return entry | {"travel_time": self.travel_time, "statement": proof.statement}


def judge_bound(
    proof: Proof, sound: Mapping[str, Motion], end_cost: float, checks: Iterable[Check], setting: Setting
) -> Bound:
    """Hold a proof against every trajectory whose model's promises are kept.

    Each of them obeys the braking distance, so none may take less than what is proven; one with the ends
    that were asked for takes `end_cost` [s] more. One that is faster, by more than what its own checks
    tolerate, shows a fault in the certificate, its checker or the checks. A proof for motions of the full
    robot with its ends (`driven`) is held against those only, and rests on no braking distance.
    """
    found = list(checks)
    beaten = []
    for name, motion in sound.items() if proof.holds else ():
        own = {check.name: check for check in found if check.trajectory == name}
        with_ends = MODEL_OF_PLAN[name] == "full" and all(own[end].status == "passed" for end in ENDS)
        if own["braking_distance"].status != "passed" or (proof.driven and not with_ends):
            continue  # of a plan that promises less than the bound is about
        least = proof.travel_time
        tolerated = _tolerated(proof, motion, own, setting)
        if with_ends:
            least += end_cost
            tolerated += tolerated_by_drive(motion, own, setting)
        if motion.travel_time + tolerated < least * (1.0 - ROUNDING):
            beaten.append(
                f"a trajectory is faster than the bound proves possible: {name} takes "
                f"{motion.travel_time:.9f} s, the proven least is {least:.9f} s"
            )
    return Bound(proof=proof, beaten=tuple(beaten))


def _tolerated(proof: Proof, motion: Motion, checks: Mapping[str, Check], setting: Setting) -> float:
    return tolerated_length(motion, setting) if proof.driven else tolerated_time(motion, checks, setting)


def tolerated_time(motion: Motion, checks: Mapping[str, Check], setting: Setting) -> float:
    """Time [s] that a motion may have gained by what its checks tolerate.

    Derived. Let delta be the amount by which d >= t_r v + v^2/(2 a_b) + m is broken at most, and c the
    least clearance. V is concave and zero at m, so V(d) / (d - m) falls, hence V(d + delta) / V(d) <=
    1 + delta/(c - m): slowed by that factor (and by the excess over v_max) the motion obeys the law. Its
    rows may leave gaps, and its ends may miss start and goal, together by e. As distance is 1-Lipschitz,
    straight pieces across keep the clearance c - e, so they take at most e / V(c - e).

    With a zone D E (+) body let n be a direction that shows the gap -delta at D, and rho and R the radii of
    discs in E and around it. In this direction the gap with l D is -delta + (1 - l) D h(n) at least, h(n) >=
    rho, and D is (c - m)/R at least, as the gap falls from c - m or more with D by R at most: it is none with
    1 - l = delta R / (rho (c - m)). V(l D) >= l V(D), as V is concave and zero at 0. Across, V is that of a
    disc around the zone, and m what this disc has at standstill beyond the robot's.
    """
    limits, zone = setting.limits, None if setting.zone is None else setting.zone.zone
    around = limits if zone is None else disc_around(limits, zone)
    if around is None:
        return math.inf
    clear = (checks["clearance"].worst or 0.0) - around.margin
    miss = _missed(motion, setting)
    if clear <= 2.0 * miss:
        return math.inf  # too close to the law's zero to say anything
    short = max(0.0, -(checks["braking_distance"].worst or 0.0)) / clear
    if isinstance(zone, GaugeZone) and short > 0.0:
        less = short * zone.shape.extent / zone.shape.inscribed if zone.shape.inscribed > 0.0 else 1.0
        short = less / (1.0 - less) if less < 1.0 else math.inf
    factor = (1.0 + short) * (1.0 + (checks["speed"].violation or 0.0))
    across = miss / around.safe_speed(around.margin + clear - miss)
    return (factor - 1.0) * motion.travel_time + across * factor


def tolerated_length(motion: Motion, setting: Setting) -> float:
    """Time [s] that a motion may have gained by gaps between its rows and at its ends.

    Its way is shorter by no more than all of them together, e. A vehicle that stops, goes e from rest to rest
    and then on its way takes 2 sqrt(e / a) longer, a the lesser of drive and brakes; where neither end is at
    rest, less.
    """
    weakest = min(setting.limits.acceleration, setting.limits.braking)
    return 2.0 * math.sqrt(_missed(motion, setting) / weakest)


def _missed(motion: Motion, setting: Setting) -> float:
    """Gaps between rows and at the ends, together [m]."""
    miss = JOINTS
    for row, end in ((0, setting.start), (-1, setting.goal)):
        miss += math.hypot(motion.x[row] - end.position[0], motion.y[row] - end.position[1])
    return miss


def tolerated_by_drive(motion: Motion, checks: Mapping[str, Check], setting: Setting) -> float:
    """Time [s] that a motion of the full model may have gained by end speeds and a drive beyond its limits.

    An end speed off by e takes e/a to make good; limits exceeded by a factor 1 + x shorten no motion by
    more than that factor.
    """
    miss = sum(abs(checks[name].worst or 0.0) for name in ("start", "goal"))
    weakest = min(setting.limits.acceleration, setting.limits.braking)
    return miss / weakest + (checks["drive"].violation or 0.0) * motion.travel_time
