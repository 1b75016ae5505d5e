"""Speed profiles and programs with zones: safe between samples, right derivatives, uniform as it was."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from verify.zoning import stand_in, with_zone
from vnav_drake.braking import BrakingZone, UniformBraking
from vnav_drake.collocation import plan_full, plan_variational
from vnav_drake.collocation.blocks import Block, Layout
from vnav_drake.collocation.zone_blocks import held_arc_block, zone_block
from vnav_drake.convex import ConvexPieces
from vnav_drake.plan import Path, Trajectory
from vnav_drake.problem import End, PlanningError, Problem
from vnav_drake.robot import Robot
from vnav_drake.speed_profile import fastest_profile
from vnav_drake.world import Obstacle, World
from vnav_drake.zones.convex_zone import ConvexZone, GaugeZone
from vnav_drake.zones.held_arc import TurnLimit
from vnav_drake.zones.shapes import DiscZone, EllipseZone, ProtectiveField
from vnav_drake.zones.speed import least_gap

Array = NDArray[np.float64]

LAW = UniformBraking(max_braking=1.0, reaction_time=0.2, margin=0.05)
ROBOT = Robot(
    radius=0.3,
    mass=40.0,
    wheelbase=0.4,
    track=0.3,
    com_height=0.1,
    friction=0.6,
    max_braking=1.0,
    max_acceleration=1.0,
    max_steering=0.6,
)
ROOM = World.build(
    [(0, 0), (12, 0), (12, 6), (0, 6)],
    [Obstacle(((5.0, 0.0), (6.0, 0.0), (6.0, 2.5), (5.0, 2.5))), Obstacle(((8.0, 4.0),))],
)


def problem(zone: ConvexZone | None, friction_reserve: bool = False) -> Problem:
    return Problem(
        world=ROOM,
        robot=ROBOT,
        braking=LAW,
        zone=zone,
        friction_reserve=friction_reserve,
        start=End(position=(1.0, 1.5), speed="rest"),
        goal=End(position=(11.0, 1.5), speed="rest"),
    )


def bend() -> Path:
    """From (1, 1.5) over the block and past the point: three arcs."""
    return Path.from_arcs((1.0, 1.5), 0.6, [-0.02, -0.25, 0.1], [3.5, 4.0, 3.0])


def least_gap_along(zone: ConvexZone, motion: Trajectory) -> float:
    """The least gap of the zone at 40 places of each row, from the arcs themselves."""
    moving = np.flatnonzero(np.diff(motion.arc_length) > 0.0)[::7]
    share = np.linspace(0.0, 1.0, 41)
    length = np.diff(motion.arc_length)[moving, None] * share
    kappa, theta = motion.curvature[moving, None], motion.heading[moving, None]
    middle = theta + 0.5 * kappa * length
    chord = length * np.sinc(0.5 * kappa * length / math.pi)
    x, y = motion.x[moving, None] + chord * np.cos(middle), motion.y[moving, None] + chord * np.sin(middle)
    square = motion.v[moving, None] ** 2 + 2.0 * motion.a[moving, None] * length
    poses = np.stack([x, y, theta + kappa * length], axis=2).reshape(-1, 3)
    return float(least_gap(zone, ROOM, poses, np.sqrt(np.maximum(square, 0.0)).ravel()).min())


@pytest.mark.parametrize(
    "zone",
    [
        EllipseZone(law=LAW, radius=0.3, lateral_ratio=0.4),
        EllipseZone(law=LAW, radius=0.3, lateral_ratio=0.3, ahead=1.1, behind=0.2),
        ProtectiveField(law=LAW, radius=0.3),
        ProtectiveField(law=LAW, radius=0.3, form="rectangle", side=0.05),
    ],
    ids=["ellipse", "one-sided", "capsule", "rectangle"],
)
@pytest.mark.parametrize("model", ["variational", "full"])
def test_a_profile_is_free_between_its_rows_and_no_slower_than_it_must(zone: GaugeZone, model: str) -> None:
    if model == "variational" and zone.inner_law() is None:
        return
    asked = problem(zone)
    motion = fastest_profile(asked, bend(), model=model, ends="safe")  # type: ignore[arg-type]
    gap = least_gap_along(zone, motion)
    assert gap >= 0.0
    if model == "variational":
        # nothing but the zone holds it back: it touches somewhere, but for the slow-down of the profile
        assert gap <= 1e-4


def test_a_profile_with_a_disc_as_zone_is_uniform_braking() -> None:
    """The rows of zones against the closed forms of uniform braking, which bound rows in another way."""
    uniform = fastest_profile(problem(None), bend(), model="full", ends="safe")
    zone = fastest_profile(problem(DiscZone(law=LAW, radius=0.3)), bend(), model="full", ends="safe")
    assert zone.travel_time == pytest.approx(uniform.travel_time, rel=1e-5)


def test_a_path_that_the_body_does_not_fit_on_is_refused() -> None:
    through = Path.from_arcs((1.0, 1.5), 0.0, [0.0], [10.0])
    with pytest.raises(PlanningError):
        fastest_profile(problem(EllipseZone(law=LAW, radius=0.3)), through, model="full", ends="safe")


def test_held_arcs_limit_the_speed_of_bends() -> None:
    """|kappa| D(v) is at most the share of the greatest turn that plans use, on every row."""
    zone = ProtectiveField(law=LAW, radius=0.3)
    asked = problem(zone, friction_reserve=True)
    motion = fastest_profile(asked, bend(), model="full", ends="safe")
    limit = TurnLimit.of(zone)
    assert limit is not None
    faster = np.maximum(motion.v[1:], motion.v[:-1])
    far = LAW.distance(faster) - LAW.margin
    assert np.all(np.abs(motion.curvature[:-1]) * far <= limit.greatest(far)[0])
    free = fastest_profile(problem(zone), bend(), model="full", ends="safe")
    assert motion.travel_time > free.travel_time


def against_differences(block: Block, z: Array) -> float:
    """Worst difference of a block's derivatives from central differences."""
    _, data = block.evaluate(z)
    analytic, step = block.jacobian(data), 1e-6
    columns = []
    for i in range(len(z)):
        sides = []
        for sign in (1.0, -1.0):
            moved = z.copy()
            moved[i] += sign * step
            sides.append(block.evaluate(moved)[0])
        columns.append((sides[0] - sides[1]) / (2.0 * step))
    return float(np.abs(analytic - np.stack(columns, axis=1)).max())


@pytest.mark.parametrize(
    "zone", [EllipseZone(law=LAW, radius=0.3, lateral_ratio=0.4), ProtectiveField(law=LAW, radius=0.3)]
)
def test_derivatives_of_the_zone_block(zone: GaugeZone) -> None:
    pieces = ConvexPieces.of(ROOM)
    count = len(pieces.corners)
    knot, piece = np.repeat(np.arange(3), count), np.tile(np.arange(count), 3)
    block = zone_block(Layout(2), zone, pieces, knot, piece)
    z = np.concatenate([[2.1, 4.3, 9.2], [1.4, 3.6, 2.2], [0.3, -0.4, 1.9], [0.8, 1.3, 0.5]])
    assert against_differences(block, z) < 1e-7


def test_derivatives_of_the_held_arc_block() -> None:
    zone = ProtectiveField(law=LAW, radius=0.3)
    limit = TurnLimit.of(zone)
    assert limit is not None
    block = held_arc_block(Layout(2), problem(zone), limit, np.array([0.4, 0.6]), np.arange(2))
    z = np.array([0.1, 0.35, 0.2, 0.8, 1.3, 0.5, 4.0])
    assert against_differences(block, z) < 1e-6


def test_a_zone_that_reaches_less_far_to_the_sides_is_faster() -> None:
    """In the model of the zone alone: disc around, the zone, disc in it; their optima are in this order."""
    zone = EllipseZone(law=LAW, radius=0.3, lateral_ratio=0.6)
    asked = problem(zone)
    relaxed, kind = asked.isotropic()
    assert kind == "inner"
    times = []
    for case in (problem(None), asked, relaxed):
        plan = plan_variational(case, bend_to_goal(), effort="quick")
        times.append(plan.travel_time)
    assert times[0] > 1.02 * times[1]
    assert times[1] > 1.001 * times[2]


def bend_to_goal() -> Path:
    """A safe way: over the block and down again, in straight pieces."""
    return Path.polyline(np.array([(1.0, 1.5), (4.0, 4.0), (7.0, 4.0), (11.0, 1.5)]))


def test_the_full_robot_with_a_protective_field_is_faster_than_with_a_disc() -> None:
    """Straight between the block and the point, 0.4 m beside the robot: only a disc must slow down."""
    field = replace(
        problem(ProtectiveField(law=LAW, radius=0.3), friction_reserve=True),
        start=End(position=(1.0, 3.2), speed="rest"),
        goal=End(position=(11.0, 3.2), speed="rest"),
    )
    straight = Path.polyline(np.array([(1.0, 3.2), (11.0, 3.2)]))
    uniform = plan_full(replace(field, zone=None), straight, effort="quick")
    assert uniform.path is not None
    plan = plan_full(field, uniform.path, effort="quick")
    assert field.zone is not None
    assert plan.travel_time < 0.95 * uniform.travel_time
    assert least_gap_along(field.zone, plan.trajectory) >= 0.0


def test_analytic_plans_obey_the_zone() -> None:
    zone = EllipseZone(law=LAW, radius=0.3, lateral_ratio=0.6)
    asked = problem(zone)
    relaxed, kind = stand_in(asked)
    plan = plan_variational(relaxed, bend_to_goal(), effort="quick")
    driven = with_zone(asked, plan, kind)
    assert driven.details["relaxation"] == {"kind": "inner", "travel_time": plan.travel_time}
    assert driven.travel_time > plan.travel_time
    assert least_gap_along(zone, driven.trajectory) >= 0.0


def test_zones_are_braking_zones() -> None:
    zone: BrakingZone = EllipseZone(law=LAW, radius=0.3)
    assert zone.isotropic is False
