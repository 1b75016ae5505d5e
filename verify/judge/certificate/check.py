"""Does the certificate prove its bound? Nothing of what it claims is believed.

Theorem. Let triangles, kept and dropped, tile a box that holds the boundary; let the robot be unable to
move in the dropped ones; let u be continuous and quadratic on each kept triangle, with
|grad u| <= 1/V there. Then no motion from S to G with v <= V takes less than u(G) - u(S).

Proof. A motion never leaves the boundary. In a dropped triangle V = 0, so that it would stand still
there: it never enters one. On the kept ones t -> u(q(t)) is a continuous choice among finitely many
Lipschitz functions, so it is Lipschitz, and its rate is almost everywhere at most |grad u| v <= 1.
Integrate. The inequality is shown at the corners only: grad u is affine on a triangle, its norm convex, and
the minorant of 1/V affine.

For a robot without margin (m = 0) walls may cut u: then the theorem is about motions that touch nothing, and
`continuity` shows that u(q(t)) is continuous for them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from verify.judge.certificate import floating, headings, rational
from verify.judge.certificate.blocked import check_blocked
from verify.judge.certificate.bound import barycentric, float_at_most, potential
from verify.judge.certificate.continuity import check_continuity
from verify.judge.certificate.drive import drive_time
from verify.judge.certificate.file import CertificateFile
from verify.judge.certificate.minorant import WEIGHT_ROUNDING, corners_of, minorants_of
from verify.judge.certificate.same_question import question_faults
from verify.judge.certificate.sheets import Sheets
from verify.judge.certificate.statement import statement_of
from verify.judge.certificate.tiling import check_tiling
from verify.judge.certificate.wording import listed, place_of
from verify.judge.certificate.zone import length_limits, zone_faults, zone_gauge
from verify.judge.question import Question

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

CHUNK = 2**15  # triangles evaluated at once
SLOWEST, FASTEST = 1e-9, 1e9  # [m/s], of tangents: their powers neither vanish nor overflow


@dataclass(frozen=True, kw_only=True)
class Proof:
    """What a certificate proves, or why it does not."""

    holds: bool
    travel_time: float  # [s], no motion takes less; rounded down. Zero unless `holds`
    reasons: tuple[str, ...]  # every fault found, with its place; empty if it holds
    triangles: int  # kept
    dropped: int
    worst: float  # least of (m_i - |g_i|) / m_i over all corners; -inf where it could not be evaluated
    at: tuple[float, float]  # [m], the corner where it is
    exact: bool  # in rational arithmetic
    driven: bool = False  # of the full robot between the ends asked for only: by length and drive, not by V
    slack: Array = field(repr=False, compare=False)  # (t,), the least of each kept triangle
    statement: str  # one paragraph: what is proven and how, or that nothing is


def check_certificate(file: CertificateFile, question: Question, *, exact: bool = False) -> Proof:
    """Check a certificate against the scenario's own numbers.

    Parameters
    ----------
    exact : use rational arithmetic throughout, else floating point with rounding bounds for the gradient
        inequality, and integers wherever those cannot decide a question of geometry. With a zone that depends
        on the heading there is floating point with rounding bounds only, and the statement says so.
    """
    limits = question.setting.limits
    asked = None if question.setting.isotropic else question.setting.zone
    # Lengths bound the time with any zone; that they are what u measures the file says.
    length = asked is not None and file.lengths is not None and bool(file.lengths)
    gauge = None if asked is None or length else zone_gauge(asked, limits)
    exact = exact and (asked is None or length)  # for all headings floating point with slack is what there is
    bounded = limits if asked is None or not length else length_limits(asked, limits)
    faults = []
    if file.actual_digest() != file.digest.tobytes():
        faults.append("the digest is not that of the numbers: the file was changed after it was written")
    faults += question_faults(file, question)
    faults += zone_faults(file, question.setting.zone, length=length, bounds=gauge is not None)
    comparable = len(file.features) == len(question.features.table)
    sheets = Sheets.of(file)
    tiling = check_tiling(file, question.features, sheets)
    if comparable:
        faults += check_blocked(file, question.features, bounded, exact=exact)
    term_faults, usable = _term_faults(file)
    faults += [*tiling.faults, *term_faults]
    if comparable:
        faults += check_continuity(file, sheets, question, exact=exact)
    slack = np.full((len(file.triangles), 3), -np.inf)
    positive = bool((tiling.twice_area > 0).all())
    if tiling.side_edges is not None and comparable and usable and positive:
        arithmetic = rational if exact else floating
        for first in range(0, len(slack), CHUNK):
            rows = slice(first, first + CHUNK)
            corners = corners_of(file, tiling.side_edges, tiling.twice_area, rows)
            minorants = minorants_of(file, question.features, bounded, rows)
            if asked is None or length:
                slack[rows] = arithmetic.slack(corners, minorants)
            elif gauge is not None and file.contact is not None:
                slack[rows] = headings.slack(corners, minorants, file.contact[rows], gauge)
        faults += _steep(file, slack)
    proven = Fraction(0)
    if tiling.side_edges is not None and positive:
        proven, end_faults = _rise(file, question, tiling.side_edges)
        faults += end_faults
    else:
        faults.append("u at start and goal could not be evaluated")
    least = float_at_most(proven)
    if length:
        ends = question.setting.start, question.setting.goal
        least = drive_time(limits, *ends, max(0.0, least))
        if not least > 0.0:
            faults.append("with speeds free at both ends and no v_max no time follows from a length")
    corner = divmod(int(np.argmin(slack)), 3)
    x, y = file.points[file.triangles[corner]]
    holds = not faults
    return Proof(
        holds=holds,
        travel_time=max(0.0, least) if holds else 0.0,
        reasons=tuple(faults),
        triangles=len(file.triangles),
        dropped=len(file.dropped),
        worst=float(slack[corner]),
        at=(float(x), float(y)),
        exact=exact,
        driven=length,
        slack=slack.min(axis=1),
        statement=statement_of(
            file,
            question,
            sheets,
            proven=proven if holds else None,
            worst=float(slack[corner]),
            at=(float(x), float(y)),
            exact=exact,
            driven=max(0.0, least) if length else None,
        ),
    )


def _term_faults(file: CertificateFile) -> tuple[list[str], bool]:
    """Weights and speeds of the minorants, and whether they can be evaluated."""
    kept = file.triangles.astype(np.int64)

    def tell(row: int) -> str:
        return place_of(file, kept[row])

    negative = (file.weight < 0.0).any(axis=1)
    heavy = (file.weight > 2.0).any(axis=1)  # may overflow when summed
    heavy |= np.minimum(file.weight, 2.0).sum(axis=1) > 1.0 + WEIGHT_ROUNDING
    used = (file.weight > 0.0) & (file.feature >= 0)
    odd = (used & ~((file.speed >= SLOWEST) & (file.speed <= FASTEST))).any(axis=1)
    faults = [
        *listed("a weight is negative in", np.flatnonzero(negative), tell),
        *listed("the weights sum to more than 1 in", np.flatnonzero(heavy), tell),
        *listed(
            f"the speed of a tangent is not between {SLOWEST:g} and {FASTEST:g} m/s in",
            np.flatnonzero(odd),
            tell,
        ),
    ]
    return faults, not faults


def _steep(file: CertificateFile, slack: Array) -> list[str]:
    """Corners where u rises faster than the minorant of 1/V allows."""
    steep = np.flatnonzero((slack < 0.0).any(axis=1))

    def tell(row: int) -> str:
        corner = int(np.argmin(slack[row]))
        x, y = file.points[file.triangles[row, corner]]
        by = (
            f"by {-slack[row, corner]:.3g} of it"
            if math.isfinite(slack[row, corner])
            else "which is not positive"
        )
        return f"({x:.9g}, {y:.9g}) m, {by}, in {place_of(file, file.triangles[row])}"

    return listed(
        "u is steeper than the lower bound of 1/V at", steep[np.argsort(slack[steep].min(axis=1))], tell
    )


def _rise(file: CertificateFile, question: Question, side_edges: Indices) -> tuple[Fraction, list[str]]:
    """u(G) - u(S) exactly; start and goal must lie in their triangles, and the claim not be above."""
    faults, values = [], []
    for name, index, end in (
        ("start", int(file.start_triangle), question.setting.start),
        ("goal", int(file.goal_triangle), question.setting.goal),
    ):
        weights = barycentric(file, index, end.position)
        if min(weights) < 0:
            x, y = end.position
            around = place_of(file, file.triangles[index])
            faults.append(f"the {name} ({x:.9g}, {y:.9g}) m does not lie in {around}, as it is said to")
        values.append(potential(file, index, side_edges, weights))
    rise = values[1] - values[0]
    claimed = float(file.travel_time)
    if Fraction(claimed) > rise:
        proven = float_at_most(rise)
        faults.append(f"claims {claimed!r} s, but u(goal) - u(start) is only {proven!r} s")
    return rise, faults
