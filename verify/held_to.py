"""Two runs with other limits of `certified_gap`: what both keep, so what a later one is held to."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from verify.baseline_file import Aim
from verify.digits import as_given

# Compute times that depend on how far the bound was refined.
TIMES = frozenset({"compute_time.lower_bound", "compute_time.total"})
_GAPS = ("gap.certified", "gap.certified_full")


@dataclass(frozen=True, kw_only=True)
class HeldTo:
    """The looser of two: the gap `aimed` at, inf where one run sought none, and the verdict's `limit`."""

    aimed: float
    limit: float
    same_aim: bool
    values: Mapping[str, float]  # figures of the later run, by name

    @classmethod
    def by(cls, was: Aim, now: Aim, values: Mapping[str, float]) -> HeldTo:
        """What a run with the figures `values` is held to."""
        return cls(
            aimed=max(math.inf if aim.aimed is None else aim.aimed for aim in (was, now)),
            limit=max(was.limit, now.limit),
            same_aim=was.aimed == now.aimed,
            values=values,
        )

    def compares(self, name: str) -> bool:
        """Whether there is anything to hold this figure to."""
        return self.same_aim or not (
            name in TIMES or (math.isinf(self.aimed) and name in ("lower_bound", *_GAPS))
        )

    def worst(self, name: str) -> float | None:
        """The value that this run's figure would have at the looser aim exactly; None for other figures.

        With the gap g of the run, a bound L and the time T = (1 + g) L, that is the bound T / (1 + aim), and
        of each gap 1 + gap grows by (1 + aim) / (1 + g).
        """
        gap = next((self.values[key] for key in _GAPS if key in self.values), None)
        if self.same_aim or gap is None or name not in self.values or not self.compares(name):
            return None
        growth = (1.0 + self.aimed) / (1.0 + gap)
        if name == "lower_bound":
            return self.values[name] / growth
        return (1.0 + self.values[name]) * growth - 1.0 if name in _GAPS else None

    @property
    def is_certified(self) -> bool:
        """Whether the run's gap is within the looser limit: no worse verdict follows from the tighter one."""
        gap = self.values.get("gap.certified")
        return gap is not None and gap <= self.limit


def remark(was: Aim, now: Aim) -> str | None:
    """What differs, and what follows from that; None for the same limits."""
    if was == now:
        return None
    before, after = _words(was), _words(now)
    looser = max(was.limit, now.limit)
    text = f"the limit of certified_gap is {after}, was {before}: "
    if was.aimed == now.aimed:
        return text + f"the verdict is held to the looser, {as_given(looser)}"
    if was.aimed is None or now.aimed is None:
        return text + "lower bound and certified gaps are not compared, nor the compute times of the bound"
    aimed = max(was.aimed, now.aimed)
    held = as_given(aimed) + ("" if aimed == looser else f", the verdict to {as_given(looser)}")
    return text + (
        f"lower bound, certified gaps and verdict are held to the looser, {held}; compute times of the bound "
        "and of the whole are not compared"
    )


def _words(aim: Aim) -> str:
    if aim.aimed is None:
        return f"{as_given(aim.limit)} (not sought)"
    return as_given(aim.limit) + (
        "" if aim.aimed == aim.limit else f" (bound refined to {as_given(aim.aimed)})"
    )
