"""What a check reports."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

Status = Literal["passed", "failed", "not_evaluated"]

# Normalised: lengths by 1 m, angles by 1 rad, accelerations, curvature and speed by their limit.
# A thousand times what rounding and the bound between rows need, and far below anything a robot feels.
VIOLATION_TOLERANCE = 1e-6


@dataclass(frozen=True, kw_only=True)
class Place:
    """When and where along a motion."""

    t: float  # [s]
    x: float  # [m]
    y: float  # [m]


@dataclass(frozen=True, kw_only=True)
class Check:
    """One rule, judged along one motion.

    `worst` is the least margin to the rule's limit in `unit`, over the whole motion: positive is
    room to spare, negative is by how much the limit is broken. `violation` is max(0, -worst) after
    normalisation. A check that a plan's model does not promise to pass (`promised` false) is measured
    and reported with its plan, but fails nothing.
    """

    name: str
    trajectory: str
    status: Status
    message: str
    worst: float | None = None
    unit: str = ""
    violation: float | None = None
    at: Place | None = None
    promised: bool = True
    wanted: bool = True  # a check whose stage the scenario does not ask for holds back no verdict

    @property
    def blocks(self) -> bool:
        """Whether the check failed although its plan promises to pass it."""
        return self.status == "failed" and self.promised

    def as_result(self) -> dict[str, Any]:
        """The entry in result.json; what was not evaluated is absent."""
        entry: dict[str, Any] = {"name": self.name, "trajectory": self.trajectory, "status": self.status}
        if self.worst is not None:
            entry |= {"worst": self.worst, "unit": self.unit, "violation": self.violation}
        if self.at is not None:
            entry["at"] = {"t": self.at.t, "x": self.at.x, "y": self.at.y}
        return entry | {"message": self.message}


def finding(
    name: str,
    worst: float,
    unit: str,
    at: Place,
    text: str,
    *,
    scale: float = 1.0,
    tolerance: float = VIOLATION_TOLERANCE,
) -> Check:
    """A judged check: failed when `-worst / scale` exceeds `tolerance`."""
    violation = max(0.0, -worst / scale)
    passed = worst / scale >= -tolerance  # false also where something is not a number
    return Check(
        name=name,
        trajectory="",
        status="passed" if passed else "failed",
        message=text if passed else f"{text}, at t = {at.t:.3f} s, ({at.x:.3f}, {at.y:.3f}) m",
        worst=worst + 0.0,
        unit=unit,
        violation=violation,
        at=at,
    )
