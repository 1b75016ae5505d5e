"""The dynamic window approach: what it may choose, what it prefers, and what comes of it."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import assume, given, reject, settings
from hypothesis import strategies as st
from judged import scenario
from worlds import ROOM, SIDE, moved, moved_world, obstacle_lists, rooms

from verify.library import check
from vnav_drake.braking import UniformBraking
from vnav_drake.dwa import plan_dwa
from vnav_drake.dwa.goal import arc_to_goal, goal_curvature
from vnav_drake.dwa.objective import Objective, best, half_turn, top_speed
from vnav_drake.dwa.run import MOST_DECISIONS, MOST_WINDOWS, most_decisions_of
from vnav_drake.dwa.window import (
    Arcs,
    choices,
    curvature_window,
    free_length,
    greatest_deceleration,
    window_speeds,
)
from vnav_drake.problem import End, PlanningError, Problem
from vnav_drake.robot import Robot
from vnav_drake.scenario import ScenarioError
from vnav_drake.world import Obstacle, World

HALL = [(0, 0), (40, 0), (40, 10), (0, 10)]
RULES = ("boundary", "clearance", "braking_distance", "friction_circle", "tip_over", "steering", "drive")
RULES += ("speed", "travel_time")
ROBOT = Robot(radius=0.3)


def wall(*vertices):
    return {"vertices": [list(v) for v in vertices]}


def hall(*obstacles, **changes):
    world = {"boundary": [list(v) for v in HALL], "obstacles": list(obstacles)}
    ends = {"start": {"position": [5.0, 5.0]}, "goal": {"position": [35.0, 5.0]}}
    return scenario(**{"world": world, **ends, **changes})


def drive(case, **options):
    """The run, and what the judge says of it; every rule but those of the ends must hold in any case."""
    run = plan_dwa(case.problem, **options)
    found = {c.name: c for c in check(case, run.plan)}
    for rule in RULES:
        assert found[rule].status == "passed", found[rule].message
    assert found["start"].status == "passed", found["start"].message
    assert (found["goal"].status == "passed") == run.reached, found["goal"].message
    assert (run.stuck is None) == run.reached
    return run


# What comes of it


def test_corridor_is_driven_at_most_at_the_speed_limit():
    # 30 m, nowhere faster than V = sqrt(2 * 1 * 1.5) (half-width 2 m, radius 0.5 m). The straight line on
    # the centre is admissible: heading 1, and no arc is freer or faster; only the ends can cost time.
    run = drive(scenario())
    assert run.reached
    assert run.travel_time >= 30 / math.sqrt(3)
    assert run.length == pytest.approx(30.0, rel=1e-9)


def test_a_run_is_repeated_exactly():
    case = hall(wall((18, 4), (20, 4), (20, 7), (18, 7)))
    one, other = (plan_dwa(case.problem).trajectory for _ in range(2))
    for column in ("t", "x", "y", "heading", "v", "a", "curvature", "clearance"):
        assert np.array_equal(getattr(one, column), getattr(other, column))


@pytest.mark.parametrize("step", [None, 0.25])
def test_an_obstacle_in_the_way_is_passed(step):
    # The box reaches 1 m below the line between the ends and 2 m above it, so the centre of the disc of
    # radius 0.5 m is somewhere over x = 18 to 20 at least 1.5 m off that line: no path is shorter than
    # sqrt(13^2 + 1.5^2) + sqrt(15^2 + 1.5^2) + 2, straight to there, 2 m along, and straight on.
    run = drive(hall(wall((18, 4), (20, 4), (20, 7), (18, 7))), step=step)
    assert run.reached
    assert run.length > math.hypot(13, 1.5) + math.hypot(15, 1.5) + 2


def trap():
    """A pocket 6 m deep and 4 m wide, open to the left, on the straight way to the goal."""
    return wall((14, 3), (22, 3), (22, 7), (14, 7), (14, 6.9), (21.9, 6.9), (21.9, 3.1), (14, 3.1))


def test_a_pocket_on_the_way_is_a_trap():
    # The goal is straight ahead, behind the pocket's end at x = 21.9, so that the disc stops at x = 21.4 at
    # the latest. There no arc of a car leads on, and it has no reverse gear.
    run = drive(hall(trap()))
    assert not run.reached
    assert run.stuck.reason == "no_admissible_arc"
    assert 20.0 < run.stuck.place[0] <= 21.4
    assert run.stuck.place[1] == pytest.approx(5.0)
    assert run.stuck.time == run.travel_time
    assert run.trajectory.v[-1] == 0.0
    assert run.goal_distance == pytest.approx(35.0 - run.stuck.place[0])
    assert run.plan.details["stuck"]["reason"] == run.stuck.reason


def test_a_gap_narrower_than_the_robot_is_not_entered():
    # The gap is 0.9 m wide, the disc 1 m: its centre never passes x = 20.
    run = drive(hall(wall((20, 0), (20, 4.55)), wall((20, 5.45), (20, 10))))
    assert not run.reached
    assert run.stuck is not None
    assert run.trajectory.x.max() < 20.0
    assert run.trajectory.v[-1] == 0.0


def test_start_heading_is_kept():
    run = drive(hall(start={"position": [10.0, 5.0], "heading": 2.0}))
    assert run.reached
    assert run.trajectory.heading[0] == 2.0


def test_without_start_heading_the_robot_faces_the_goal_in_an_open_hall():
    # Heading, free way and speed are greatest straight towards the goal, along the axis of the hall.
    run = drive(hall())
    assert run.trajectory.heading[0] == 0.0
    assert run.trajectory.v[0] > 0.0


def test_rest_at_both_ends():
    run = drive(
        hall(start={"position": [5.0, 5.0], "speed": "rest"}, goal={"position": [35.0, 5.0], "speed": "rest"})
    )
    assert run.reached
    assert run.trajectory.v[0] == 0.0
    assert run.trajectory.v[-1] == 0.0
    # rest to rest over 30 m with 1 m/s^2 at most at both ends: 2 sqrt(30) s
    assert run.travel_time >= 2.0 * math.sqrt(30.0)


def test_goal_heading_is_met_by_two_arcs():
    run = drive(hall(goal={"position": [35.0, 6.0], "heading": 0.3}))
    assert run.reached
    assert run.trajectory.heading[-1] == pytest.approx(0.3, abs=1e-9)


@pytest.mark.parametrize(
    "changes",
    [
        {"robot": {"max_steering_rate": 0.4}},
        {"robot": {"friction": 1.0 / 9.81}},  # mu g = a_b: turning and braking share all the friction
        {"robot": {"com_height": 0.6}},
        {"robot": {"max_speed": 0.8, "max_acceleration": 0.3}},
        {"braking": {"reaction_time": 0.3, "margin": 0.2}},
        {"braking": {"friction_reserve": True}},
    ],
    ids=["steering_rate", "slippery", "tall", "slow", "reaction", "reserve"],
)
def test_every_limit_is_kept(changes):
    case = hall(wall((18, 4), (20, 4), (20, 7), (18, 7)), wall((28, 3)), **changes)
    drive(case)
    drive(case, step=0.5)


def test_slow_wheels_turn_while_the_robot_waits():
    # Brought to rest by the box, the robot needs an arc that its wheels reach only after some windows: it
    # waits, and in each window of 1 s the wheels turn by 0.2 rad at most.
    case = hall(
        wall((18, 4), (20, 4), (20, 7), (18, 7)),
        robot={"max_steering_rate": 0.2},
        start={"position": [5.0, 5.0], "heading": 0.0, "speed": "rest"},
    )
    rows = drive(case).trajectory
    waiting = np.flatnonzero((rows.v[:-1] == 0.0) & (rows.v[1:] == 0.0) & (np.diff(rows.t) > 0.0))
    assert len(waiting) > 0
    angle = np.array([case.problem.robot.steering_angle(k) for k in rows.curvature])
    assert np.all(np.abs(angle[waiting] - angle[waiting - 1]) <= 0.2)
    assert np.all(angle[waiting] != angle[waiting - 1])


@settings(max_examples=5)
@given(obstacles=obstacle_lists, goal=st.tuples(st.floats(2.0, 18.0), st.floats(2.0, 18.0)))
def test_rows_are_safe_in_random_worlds(obstacles, goal):
    # `drive` has the judge look at every rule of the full robot, all along, wherever the run ends.
    world = {
        "boundary": [list(v) for v in ROOM],
        "obstacles": [{"vertices": [list(v) for v in o.vertices]} for o in obstacles],
    }
    try:
        case = scenario(
            world=world,
            start={"position": [1.5, 10.0], "heading": 0.0},
            goal={"position": list(goal), "speed": "rest"},
        )
    except ScenarioError:
        reject()  # an end in an obstacle
    assume(math.dist(goal, (1.5, 10.0)) > 0.1)
    drive(case, most_decisions=20)


def test_a_start_in_a_dead_end_that_it_faces_is_stuck_at_once():
    # Radius 0.5 m in an alcove 1.2 m wide, 0.02 m before its end: the smallest circle is 0.75 m, so
    # that no arc leads out forwards, and the robot has no reverse gear.
    case = hall(
        wall(
            (10, 4.4), (14, 4.4), (14, 5.6), (10, 5.6), (10, 5.59), (13.99, 5.59), (13.99, 4.41), (10, 4.41)
        ),
        start={"position": [13.47, 5.0], "heading": 0.0, "speed": "rest"},
    )
    run = drive(case)
    assert not run.reached
    assert run.stuck.place == pytest.approx((13.47, 5.0), abs=0.02)
    assert run.trajectory.v[-1] == 0.0


def test_numbers_out_of_range_are_refused():
    problem = hall().problem
    with pytest.raises(ValueError, match="weights"):
        plan_dwa(problem, weights=(0.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="weights"):
        plan_dwa(problem, weights=(1.0, -1.0, 1.0))
    with pytest.raises(ValueError, match="window"):
        plan_dwa(problem, window=math.inf)
    with pytest.raises(ValueError, match="step"):
        plan_dwa(problem, step=1.5)
    with pytest.raises(ValueError, match="most_decisions"):
        plan_dwa(problem, most_decisions=0)
    with pytest.raises(PlanningError, match="same point"):
        plan_dwa(dataclasses.replace(problem, goal=problem.start))


def test_a_budget_that_is_too_small_is_said():
    run = drive(hall(), most_decisions=3)
    assert run.stuck.reason == "too_many_decisions"
    assert run.decisions == 3
    assert run.stuck.time == pytest.approx(3.0)  # three windows
    assert "budget of 3 decisions is spent" in run.stuck.message


def test_the_budget_is_one_of_motion_whatever_the_step(monkeypatch):
    # Four steps of 0.25 s make a window: three windows are twelve decisions, and 3 s as without a step.
    monkeypatch.setattr("vnav_drake.dwa.run.MOST_WINDOWS", 3)
    case = hall(start={"position": [5.0, 5.0], "heading": 0.0, "speed": 1.0})
    for step, decisions in ((None, 3), (0.25, 12)):
        run = drive(case, step=step)
        assert (run.stuck.reason, run.decisions) == ("too_many_decisions", decisions)
        assert run.stuck.time == pytest.approx(3.0)


def test_the_budget_is_bounded_for_small_steps():
    # 20 000 decisions are 400 s of motion at the least step of a scenario file, 0.02 s.
    assert most_decisions_of(1.0, 1.0) == MOST_WINDOWS
    assert most_decisions_of(1.0, 0.5) == 2 * MOST_WINDOWS
    assert most_decisions_of(1.0, 0.02) == MOST_DECISIONS == 20_000
    assert most_decisions_of(1.0, 1e-6) == MOST_DECISIONS


def test_a_slow_drive_with_a_small_step_does_not_stand():
    # After ten steps of 0.02 s at 0.01 m/s^2 it has moved 2e-4 m, slower than 1e-3 of the top speed (over
    # 3 m/s, half-width 5 m); after ten windows of 1 s it has moved 0.5 m.
    case = hall(
        robot={"max_acceleration": 0.01}, start={"position": [5.0, 5.0], "heading": 0.0, "speed": "rest"}
    )
    assert drive(case, step=0.02, most_decisions=15).stuck.reason == "too_many_decisions"


def test_a_start_that_cannot_stop_is_refused():
    # 5 m/s along the hall, facing the end wall 2 m away: it would take 12.5 m.
    problem = hall().problem
    end = End(position=(38.0, 5.0), speed=5.0, heading=0.0)
    with pytest.raises(PlanningError, match="stop safely"):
        plan_dwa(dataclasses.replace(problem, start=end))


# What it may choose


def problem_in(world, robot=ROBOT, **law):
    end = End(position=(1.0, 1.0))
    braking = UniformBraking(max_braking=robot.max_braking, max_speed=robot.max_speed, **law)
    return Problem(world=world, robot=robot, braking=braking, start=end, goal=end)


@settings(max_examples=25)
@given(
    boundary=rooms,
    obstacles=obstacle_lists,
    place=st.tuples(st.floats(1.0, SIDE - 1.0), st.floats(1.0, SIDE - 1.0)),
    heading=st.floats(-3.0, 3.0),
    part=st.floats(0.0, 1.0),
    lag=st.sampled_from([0.0, 0.4]),
)
def test_admissible_motions_keep_the_braking_condition(boundary, obstacles, place, heading, part, lag):
    # Dense samples of each motion, its stop included, from v = v0 + a t: none may break what was promised
    # for all instants. Conversely what has 0.2 m to spare at each instant must be admissible (the bound
    # between nodes costs less here: nodes are at most 0.3 m apart, and 0.3 m from any obstacle).
    problem = problem_in(World.build(boundary, obstacles), reaction_time=lag)
    room = float(problem.clearance(place))
    if room < 0.05:
        return
    speed = part * float(problem.safe_speed(place))
    bends = np.linspace(-1.0, 1.0, 7) * problem.robot.max_curvature
    arcs = Arcs(np.array(place), np.full(7, heading), bends)
    speeds = window_speeds(problem, np.array(place), speed, 1.0, 8)
    found = choices(problem, arcs, speed, speeds, 1.0)
    grip = problem.robot.friction_acceleration
    for n, after in enumerate(speeds):
        turn = max(after, speed) ** 2 * np.abs(bends)
        dec = greatest_deceleration(problem, after, bends)
        t = np.linspace(0.0, 1.0, 200)[:, None]
        v1 = speed + (after - speed) * t + 0.0 * bends
        s1 = speed * t + 0.5 * (after - speed) * t**2 + 0.0 * bends
        t2 = t * after / np.maximum(dec, 1e-3)
        v2, s2 = after - dec * t2, s1[-1] + after * t2 - 0.5 * dec * t2**2
        v, s = np.maximum(np.concatenate([v1, v2]), 0.0), np.concatenate([s1, s2])
        margin = (problem.clearance(arcs.at(s)[0]) - problem.braking.distance(v)).min(axis=0)
        physical = (np.hypot(after - speed, turn) <= grip) & (turn <= problem.lateral_limit) & (dec > 0.0)
        assert np.all(margin[found.admissible[n]] >= -1e-12)
        assert np.all(physical[found.admissible[n]])
        if max(after, speed) > 0.0:
            spare = problem.clearance(arcs.at(s)[0]).min(axis=0) > 0.3
            sure = physical & (margin > 0.2) & (dec > 1e-3) & spare & (turn < 0.99 * grip)
            assert np.all(found.admissible[n][sure])


def test_deceleration_in_a_turn_is_the_rest_of_the_friction_circle():
    # 3-4-5: mu g = 5, v^2 kappa = 2^2 * 0.75 = 3 leave 4 m/s^2; straight ahead all of a_b = 4.5.
    robot = Robot(radius=0.3, friction=5.0 / 9.81, max_braking=4.5)
    problem = problem_in(World.build(HALL), robot)
    got = greatest_deceleration(problem, 2.0, np.array([0.75, 0.0, 2.0]))
    assert got == pytest.approx([4.0, 4.5, 0.0], rel=1e-8)


def test_the_window_is_what_the_drive_can_reach():
    # From 1 m/s with 1 m/s^2 both ways within 0.5 s, in the middle of the hall (V = sqrt(2 * 4.7) there).
    problem = problem_in(World.build(HALL))
    assert window_speeds(problem, np.array([20.0, 5.0]), 1.0, 0.5, 3) == pytest.approx([0.5, 1.0, 1.5])
    # 0.02 m from the wall, at rest, with a strong drive: no arc allows more than v^2/2 = 0.02 + v/4.
    problem = problem_in(World.build(HALL), Robot(radius=0.3, max_acceleration=3.0))
    slow = window_speeds(problem, np.array([20.0, 0.32]), 0.0, 0.5, 2)
    assert slow[0] == 0.0
    assert slow[1] ** 2 / 2 == pytest.approx(0.02 + slow[1] / 4)


def test_the_steering_rate_bounds_the_window_of_curvature():
    robot = Robot(radius=0.3, max_steering_rate=0.5)
    low, high = curvature_window(robot, 0.2, 0.4)
    now = robot.steering_angle(0.2)
    assert robot.steering_angle(high) - now == pytest.approx(0.2)  # 0.5 rad/s for 0.4 s
    assert now - robot.steering_angle(low) == pytest.approx(0.2)
    assert curvature_window(robot, None, 0.4) == pytest.approx((-robot.max_curvature, robot.max_curvature))
    assert curvature_window(robot, 0.2, 60.0) == pytest.approx((-robot.max_curvature, robot.max_curvature))


# What it prefers


def test_free_length_ends_at_contact():
    # Radius 0.3 m at (20, 5): straight ahead 19.7 m to the end wall. A left circle of radius R = 10 m has
    # its contact with the wall y = 10 where R (1 - cos(phi)) = 4.7. A circle of radius 2 m meets nothing.
    problem = problem_in(World.build(HALL))
    arcs = Arcs(np.array([20.0, 5.0]), np.zeros(3), np.array([0.0, 0.1, 0.5]))
    expected = [19.7, 10.0 * math.acos(1.0 - 0.47), 30.0]
    got = free_length(problem, arcs, 30.0)
    # CONTACT before it along the straight arc; on the slanting one that much over the sine of the angle
    assert got == pytest.approx(expected, abs=0.005)
    assert np.all(got <= np.array(expected) + 30.0 / 200)


def test_the_terms_of_the_objective_lie_between_zero_and_one_and_are_those_of_the_source():
    # At (20, 5), straight arcs to the left and the right, window 1 s, from 1 to 1 m/s; goal on the right.
    # head: 1 towards the goal, 0 away from it. dist: 19.7 m over 20 m. vel: 1 over 4.
    problem = problem_in(World.build(HALL))
    arcs = Arcs(np.array([20.0, 5.0]), np.array([0.0, math.pi]), np.zeros(2))
    options = choices(problem, arcs, 1.0, np.array([1.0]), 1.0)
    values = [
        Objective(weights=w, goal=np.array([39.0, 5.0]), top_speed=4.0, look=20.0).values(problem, options)[0]
        for w in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (2.0, 3.0, 4.0))
    ]
    assert values[0] == pytest.approx([1.0, 0.0])
    assert values[1] == pytest.approx([19.7 / 20, 19.7 / 20], abs=1e-4)  # up to the contact tolerance
    assert values[2] == pytest.approx([0.25, 0.25])
    assert values[3] == pytest.approx(2 * values[0] + 3 * values[1] + 4 * values[2])


def test_head_is_taken_where_the_robot_comes_to_rest():
    # A left circle of radius 2 m at 1 m/s: 1 m within the window, and 1^2 / (2 * 1) m until it stands, since
    # friction (5.9 m/s^2) leaves full braking beside the turn (0.5 m/s^2). 1.5 m turn it by 0.75 rad about
    # (20, 7). Seen from there the goals lie ahead, a right angle to the left, and behind.
    problem = problem_in(World.build(HALL))
    options = choices(
        problem, Arcs(np.array([20.0, 5.0]), np.zeros(1), np.array([0.5])), 1.0, np.ones(1), 1.0
    )
    assert options.admissible.all()
    rest = np.array([20.0 + 2.0 * math.sin(0.75), 7.0 - 2.0 * math.cos(0.75)])
    for bearing, head in ((0.0, 1.0), (math.pi / 2, 0.5), (math.pi, 0.0)):
        towards = np.array([math.cos(0.75 + bearing), math.sin(0.75 + bearing)])
        objective = Objective(weights=(1.0, 0.0, 0.0), goal=rest + towards, top_speed=4.0, look=20.0)
        assert objective.values(problem, options)[0] == pytest.approx([head], abs=1e-9)


def test_half_a_turn_of_a_circle_counts_as_its_free_way():
    # Half a circle of curvature k is pi / |k| long. Radius 0.3 m at (20, 5) of the hall: circles of radius
    # 2 m meet nothing, so that 2 pi of 20 m count; straight ahead it is 19.7 m to the end wall.
    assert half_turn(np.array([0.5, -0.25, 0.0])) == pytest.approx([2 * math.pi, 4 * math.pi, math.inf])
    problem = problem_in(World.build(HALL))
    arcs = Arcs(np.array([20.0, 5.0]), np.zeros(3), np.array([0.0, 0.5, -0.5]))
    options = choices(problem, arcs, 1.0, np.array([1.0]), 1.0)
    objective = Objective(weights=(0.0, 1.0, 0.0), goal=np.array([39.0, 5.0]), top_speed=4.0, look=20.0)
    values = objective.values(problem, options)[0]
    assert values == pytest.approx([19.7 / 20, 2 * math.pi / 20, 2 * math.pi / 20], abs=1e-4)


@pytest.mark.parametrize("step", [None, 0.5, 0.25, 0.1])
def test_towards_a_goal_in_sight_the_robot_does_not_circle(step):
    # Nothing stands in the way of 6 m in a room of 50 x 40 m: whoever turns by less than half a turn
    # altogether, left and right, comes nearer all the time.
    hall_case = scenario(
        world={"boundary": [[-20, 0], [30, 0], [30, 40], [-20, 40]]},
        start={"position": [0.0, 1.0]},
        goal={"position": [6.0, 2.0]},
    )
    run = drive(hall_case, step=step)
    assert run.reached
    assert np.abs(np.diff(run.trajectory.heading)).sum() < math.pi


def test_the_first_of_equal_choices_is_taken():
    values = np.array([[-math.inf, 1.0], [1.0 + 1e-12, 0.5]])
    assert best(values) == (0, 1)
    assert best(np.full((2, 2), -math.inf)) is None


def test_the_top_speed_is_that_of_the_widest_place():
    # The middle of the hall, 4.7 m from disc to wall; the grid adds at most half its diagonal.
    problem = problem_in(World.build(HALL))
    assert math.sqrt(2 * 4.7) <= top_speed(problem) <= math.sqrt(2 * (4.7 + 0.2))


# The last arc


@given(heading=st.floats(-3.0, 3.0), bearing=st.floats(-1.5, 1.5), size=st.floats(0.1, 20.0))
def test_the_last_arc_begins_with_the_heading_and_ends_at_the_goal(heading, bearing, size):
    place = np.array([3.0, -2.0])
    goal = place + size * np.array([math.cos(heading + bearing), math.sin(heading + bearing)])
    path = arc_to_goal(place, heading, End(position=tuple(goal)))
    assert (path.x[-1], path.y[-1]) == pytest.approx(tuple(goal), abs=1e-9)
    assert path.heading[0] == heading
    # an arc turns by twice the angle between its first tangent and its chord
    assert path.end_heading[-1] - heading == pytest.approx(2.0 * bearing, abs=1e-9)
    assert goal_curvature(place, np.array([heading]), goal) == pytest.approx(path.curvature, abs=1e-9)


def test_there_is_no_last_arc_to_a_goal_behind():
    assert arc_to_goal(np.zeros(2), 0.0, End(position=(-1.0, 0.5))) is None


def test_a_moved_world_is_driven_in_the_same_time():
    # The same problem turned and shifted; no choices tie, as nothing in it is symmetric.
    boundary, box = [(0, 0), (14, 0), (15, 9), (1, 10)], Obstacle(((6, 3.2), (8, 3), (7.5, 6), (6.1, 5.7)))
    times = []
    for angle, shift in ((0.0, (0.0, 0.0)), (0.7, (5.0, -3.0))):
        start, goal = (moved(p, angle, shift) for p in ((2.0, 4.0), (12.5, 5.0)))
        problem = Problem(
            world=moved_world(boundary, [box], angle, shift),
            robot=Robot(radius=0.3),
            braking=UniformBraking(max_braking=1.0),
            start=End(position=tuple(start), heading=0.2 + angle),
            goal=End(position=tuple(goal)),
        )
        run = plan_dwa(problem)
        assert run.reached
        times.append(run.travel_time)
    assert times[1] == pytest.approx(times[0], rel=1e-6)
