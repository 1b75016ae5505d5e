"""Paths and trajectories are what their definition says: arcs end to end, constant acceleration a row."""

import math
from pathlib import Path as FilePath

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from vnav_drake.plan import COLUMNS, Path, Plan, Trajectory, arc_step

angles = st.floats(-math.pi, math.pi)
curvatures = st.one_of(st.just(0.0), st.floats(-3.0, 3.0))
lengths = st.floats(0.01, 5.0)
arcs = st.lists(st.tuples(curvatures, lengths), min_size=1, max_size=6).map(np.array)


def smooth_path(pieces: np.ndarray, heading: float = 0.3) -> Path:
    return Path.from_arcs((1.0, -2.0), heading, pieces[:, 0], pieces[:, 1])


def trajectory_of(path: Path, speed: np.ndarray) -> Trajectory:
    """Drive along a smooth path with v^2 linear in s on each piece, from a = dv^2 / (2 ds)."""
    a = np.diff(speed**2) / (2.0 * path.piece_length)
    time = np.concatenate([[0.0], np.cumsum(2.0 * path.piece_length / (speed[1:] + speed[:-1]))])
    end = path.end_heading[-1:]
    return Trajectory(
        time,
        path.x,
        path.y,
        np.append(path.heading, end),
        speed,
        np.append(a, a[-1]),
        np.append(path.curvature, path.curvature[-1]),
        np.full(len(speed), 1.0),
    )


@given(heading=angles, curvature=curvatures, length=lengths)
def test_arc_step_solves_the_equations_of_motion(heading: float, curvature: float, length: float):
    def derivative(s: float, _: np.ndarray) -> list[float]:
        return [math.cos(heading + curvature * s), math.sin(heading + curvature * s)]

    end = solve_ivp(derivative, (0.0, length), [0.0, 0.0], method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    assert arc_step(heading, curvature, length) == pytest.approx(end, abs=1e-10)


def test_quarter_turns_end_where_the_circle_does():
    # From the origin heading along x, a left quarter of radius 2 ends in (2, 2), a right one in (2, -2).
    x, y = arc_step(0.0, np.array([0.5, -0.5]), math.pi)
    assert x == pytest.approx([2.0, 2.0], abs=1e-15)
    assert y == pytest.approx([2.0, -2.0], abs=1e-15)


def test_arc_step_is_smooth_through_curvature_zero():
    # y = kappa s^2 / 2 + O(kappa^3): no cancellation at 1e-12.
    _, y = arc_step(0.0, np.array([-1e-12, 0.0, 1e-12]), 2.0)
    assert y == pytest.approx([-2e-12, 0.0, 2e-12], rel=1e-9)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_full_circle_closes(direction: float):
    pieces = np.array([0.5, 1.0, 2.5, 4.0 * math.pi - 4.0])  # radius 2: circumference 4 pi
    path = Path.from_arcs((3.0, 4.0), 1.0, np.full(4, 0.5 * direction), pieces)
    assert (path.x[-1], path.y[-1]) == pytest.approx((3.0, 4.0), abs=1e-14)
    assert path.end_heading[-1] - path.heading[0] == pytest.approx(direction * 2.0 * math.pi, rel=1e-14)
    assert path.length == pytest.approx(4.0 * math.pi, rel=1e-15)
    center = (3.0 - direction * 2.0 * math.sin(1.0), 4.0 + direction * 2.0 * math.cos(1.0))
    assert np.hypot(path.x - center[0], path.y - center[1]) == pytest.approx(2.0, rel=1e-14)


@given(pieces=arcs)
def test_path_from_arcs_has_no_kinks(pieces: np.ndarray):
    assert smooth_path(pieces).kinks == pytest.approx(np.zeros(len(pieces) - 1), abs=1e-14)


def test_kinks_of_a_polyline_are_its_turns():
    # A square walked left, then a sharp turn back right: 90, 90 degrees left, 135 right.
    path = Path.polyline([(0, 0), (1, 0), (1, 1), (0, 1), (1, 2)])
    assert path.kinks == pytest.approx(np.radians([90.0, 90.0, -135.0]), abs=1e-15)
    assert path.piece_length == pytest.approx([1.0, 1.0, 1.0, math.sqrt(2.0)])
    assert np.all(path.curvature == 0.0)


def test_headings_of_a_polyline_are_unwrapped():
    # Three turns of 120 degrees are one full turn.
    corners = [(math.cos(t), math.sin(t)) for t in 2.0 * math.pi / 3.0 * np.arange(5)]
    heading = Path.polyline(corners).heading
    assert heading[-1] - heading[0] == pytest.approx(2.0 * math.pi)


@given(pieces=arcs, cuts=st.lists(st.integers(1, 5), min_size=6, max_size=6))
def test_subdivided_path_is_the_same_curve(pieces: np.ndarray, cuts: list[int]):
    path = smooth_path(pieces)
    count = np.array(cuts[: len(pieces)])
    fine = path.subdivided(count)
    assert len(fine.heading) == count.sum()
    assert fine.length == pytest.approx(path.length, rel=1e-14)
    assert (fine.x[-1], fine.y[-1]) == (path.x[-1], path.y[-1])
    joints = np.concatenate([[0], np.cumsum(count)])
    assert np.array_equal(fine.x[joints], path.x)
    s = np.linspace(0.0, path.length, 57)
    for ours, given_path in zip(fine.at(s)[:3], path.at(s)[:3], strict=True):
        assert ours == pytest.approx(given_path, abs=1e-12)
    # each piece ends where the next begins
    dx, dy = arc_step(fine.heading, fine.curvature, fine.piece_length)
    assert fine.x[:-1] + dx == pytest.approx(fine.x[1:], abs=1e-12)
    assert fine.y[:-1] + dy == pytest.approx(fine.y[1:], abs=1e-12)


def test_subdivision_keeps_kinks():
    path = Path.polyline([(0, 0), (2, 0), (2, 3)]).subdivided(np.array([2, 3]))
    assert path.kinks == pytest.approx([0.0, math.pi / 2.0, 0.0, 0.0])
    assert path.x == pytest.approx([0, 1, 2, 2, 2, 2])
    assert path.y == pytest.approx([0, 0, 0, 1, 2, 3])


@given(pieces=arcs)
def test_path_is_parameterised_by_arc_length(pieces: np.ndarray):
    # Chords of 2000 steps of a curve with curvature at most 3: short by (kappa h)^2 / 24 of their length.
    path = smooth_path(pieces)
    s = np.linspace(0.0, path.length, 2001)
    x, y, heading, _ = path.at(s)
    chord = np.hypot(np.diff(x), np.diff(y))
    step = path.length / 2000
    assert np.all(chord <= step * (1.0 + 1e-9))
    assert np.all(chord >= step * (1.0 - (3.0 * step) ** 2 / 24.0) - 1e-12)
    assert (x[0], y[0], heading[0]) == pytest.approx((1.0, -2.0, 0.3))
    assert (x[-1], y[-1]) == pytest.approx((path.x[-1], path.y[-1]), abs=1e-12)


@given(pieces=arcs, speed=st.lists(st.floats(0.1, 3.0), min_size=7, max_size=7))
def test_trajectory_at_its_rows_gives_the_rows(pieces: np.ndarray, speed: list[float]):
    motion = trajectory_of(smooth_path(pieces), np.array(speed[: len(pieces) + 1]))
    x, y, heading, v, a, curvature = motion.at(motion.t)
    assert x == pytest.approx(motion.x, abs=1e-11)
    assert y == pytest.approx(motion.y, abs=1e-11)
    assert heading == pytest.approx(motion.heading, abs=1e-11)
    assert v == pytest.approx(motion.v, abs=1e-11)
    assert np.array_equal(a, motion.a)
    assert np.array_equal(curvature, motion.curvature)


@given(pieces=arcs, speed=st.lists(st.floats(0.1, 3.0), min_size=7, max_size=7))
def test_trajectory_between_rows_obeys_the_row_formulas(pieces: np.ndarray, speed: list[float]):
    path = smooth_path(pieces)
    motion = trajectory_of(path, np.array(speed[: len(pieces) + 1]))
    assert motion.length == pytest.approx(path.length, rel=1e-12)
    assert motion.arc_length == pytest.approx(np.append(0.0, np.cumsum(path.piece_length)), rel=1e-12)
    for i in range(len(pieces)):
        tau = np.linspace(0.0, 1.0, 9)[:-1] * (motion.t[i + 1] - motion.t[i])
        x, y, heading, v, a, curvature = motion.at(motion.t[i] + tau)
        assert v == pytest.approx(motion.v[i] + motion.a[i] * tau, abs=1e-11)
        # distance run by constant acceleration, then the place on the path at that arc length
        run = motion.v[i] * tau + 0.5 * motion.a[i] * tau**2
        there = path.at(path.piece_length[:i].sum() + run)
        assert (x, y, heading) == (
            pytest.approx(there[0], abs=1e-10),
            pytest.approx(there[1], abs=1e-10),
            pytest.approx(there[2], abs=1e-10),
        )
        assert np.all(a == motion.a[i])
        assert np.all(curvature == path.curvature[i])


def test_braking_to_rest_takes_twice_the_distance_over_the_speed():
    # 2 m/s to rest over 1 m: a = -2 m/s^2, T = 1 s; half way in time the speed is 1 m/s, 0.75 m on.
    motion = trajectory_of(Path.polyline([(0, 0), (1, 0)]), np.array([2.0, 0.0]))
    assert motion.travel_time == pytest.approx(1.0)
    x, _, _, v, a, _ = motion.at(0.5)
    assert (x, v, a) == pytest.approx((0.75, 1.0, -2.0))


def test_times_outside_the_motion_are_clipped():
    motion = trajectory_of(smooth_path(np.array([[0.2, 1.0], [-0.4, 2.0]])), np.array([1.0, 2.0, 0.5]))
    for value, row in zip(motion.at([-1.0, 99.0]), ("x", "y", "heading", "v"), strict=False):
        column = getattr(motion, row)
        assert value == pytest.approx([column[0], column[-1]], abs=1e-12)


def test_a_kink_turns_on_the_spot():
    # Two rows at t = 1 s: before it heading 0, from it on heading pi / 2.
    half_pi = math.pi / 2.0
    motion = Trajectory(
        t=np.array([0.0, 1.0, 1.0, 2.0]),
        x=np.array([0.0, 1.0, 1.0, 1.0]),
        y=np.array([0.0, 0.0, 0.0, 1.0]),
        heading=np.array([0.0, 0.0, half_pi, half_pi]),
        v=np.ones(4),
        a=np.zeros(4),
        curvature=np.zeros(4),
        clearance=np.ones(4),
    )
    x, y, heading, v, _, _ = motion.at([0.75, 1.0, 1.25])
    assert x == pytest.approx([0.75, 1.0, 1.0])
    assert y == pytest.approx([0.0, 0.0, 0.25])
    assert heading == pytest.approx([0.0, half_pi, half_pi])
    assert v == pytest.approx([1.0, 1.0, 1.0])
    assert motion.length == pytest.approx(2.0)


numbers = st.floats(allow_nan=False, allow_infinity=False, width=64)


@given(rows=st.lists(st.tuples(*[numbers] * len(COLUMNS)), min_size=2, max_size=20))
def test_csv_gives_back_every_bit(tmp_path_factory: pytest.TempPathFactory, rows: list[tuple[float, ...]]):
    table = np.array(rows)
    file: FilePath = tmp_path_factory.mktemp("csv") / "trajectory.csv"
    Trajectory(*table.T).to_csv(file)
    assert file.read_text().splitlines()[0] == "t,x,y,heading,v,a,curvature,clearance"
    back = np.loadtxt(file, delimiter=",", skiprows=1, ndmin=2)
    assert back.tobytes() == np.ascontiguousarray(table).tobytes()


def test_plan_reports_its_motion_and_keeps_its_details():
    motion = trajectory_of(Path.polyline([(0, 0), (3, 4)]), np.array([2.0, 3.0]))
    details = {"solver": "none"}
    plan = Plan(method="test", model="variational", trajectory=motion, details=details)
    details["solver"] = "changed later"
    # 5 m at a mean of 2.5 m/s
    assert (plan.length, plan.travel_time) == pytest.approx((5.0, 2.0))
    assert plan.details["solver"] == "none"
    with pytest.raises(TypeError):
        plan.details["solver"] = "changed"  # type: ignore[index]
