"""What each plan promises: which checks it is held to, and which are only measured."""

from __future__ import annotations

from dataclasses import dataclass, replace

ENDS = frozenset({"start", "goal"})
UNIFORM_PLAN = "uniform"  # the full model under uniform braking, beside a zone that is not a disc
FIELD_PLAN = "refined"  # that is driven under a field set


@dataclass(frozen=True, kw_only=True)
class Promise:
    """Which checks a plan promises to pass; without `end_motion` it promises no speed or heading there."""

    checks: frozenset[str]
    end_motion: bool
    by: str  # whose promise it is, in words


# The variational model: uniform braking alone, any end speed and heading.
_VARIATIONAL = Promise(
    checks=frozenset({"boundary", *ENDS, "clearance", "braking_distance", "speed", "travel_time"}),
    end_motion=False,
    by="the variational model",
)
# Methods of the full robot that promise less than all. The vc-method follows the Voronoi arcs whether or not
# the wheels can turn that tightly; the dynamic window approach may get stuck on its way.
_BASELINES = {
    "vc_method": Promise(
        checks=_VARIATIONAL.checks | {"friction_circle", "tip_over", "drive"},
        end_motion=False,
        by="the vc-method",
    ),
    "dwa": Promise(
        checks=_VARIATIONAL.checks - {"goal"} | {"friction_circle", "tip_over", "drive", "steering"},
        end_motion=True,
        by="the dynamic window approach",
    ),
}
# The full model under uniform braking, for comparison with a zone that asks for less in some directions.
_UNIFORM = Promise(
    checks=(_BASELINES["dwa"].checks | {"goal", "uniform_distance"}) - {"braking_distance"},
    end_motion=True,
    by="uniform braking",
)
_UNIFORM_WITHIN = replace(_UNIFORM, checks=_UNIFORM.checks | {"braking_distance"})


def promise_of(plan: str, model: str, *, zone_within_disc: bool = True) -> Promise | None:
    """What a plan of a model promises; None: everything.

    A plan for uniform braking keeps the zone free where the zone lies within uniform braking's disc.
    """
    if plan == UNIFORM_PLAN:
        return _UNIFORM_WITHIN if zone_within_disc else _UNIFORM
    return _VARIATIONAL if model == "variational" else _BASELINES.get(plan)
