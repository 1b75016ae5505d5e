"""Rules that join several keys of a scenario: geometry, the robot's body, friction, the two ends."""

from __future__ import annotations

import decimal
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from vnav_drake.braking import UniformBraking
from vnav_drake.robot import GRAVITY, Robot
from vnav_drake.scenario_file import MAX_FAULTS, Fault, KeyPath, show_value
from vnav_drake.scenario_spec import (
    CIRCLE_SIDES,
    MAX_VERTICES,
    CircleSpec,
    ObstacleSpec,
    RobotSpec,
    ScenarioSpec,
    WorldSpec,
)
from vnav_drake.scenario_zone_checks import zone_end_faults
from vnav_drake.world import INSIDE_TOLERANCE, Obstacle, World, WorldError, circle_obstacle
from vnav_drake.zones.convex_zone import ConvexZone

SMALLEST_DETAIL = 1e-6  # [m]: outlines that come closer to themselves cannot be told from a degenerate one
SAFE_SHARE = 1.0 - 1e-5  # of the safe speed, as a motion keeps a hair below it to be safe between its rows
# Of g l/(2 h), for four wheels. Measured: brakes that come on at once pitch robots over from 0.95 to 0.98 of
# it on, by robot and speed (docs/simulation.md).
BRAKING_SHARE = 0.9
LEAST_CLEARANCE = 1e-6  # [m], beyond the margin: below it an end has no safe speed worth the name
FRICTION_TOLERANCE = 1e-9  # relative: mu g may fall short of a_b by the rounding of a printed mu
MAX_CONTACTS = 100_000  # pairs of edges or of obstacles that meet: what uniting them may cost
_CHUNK = 64  # shapes asked at once
BODY_TOLERANCE = 1e-9  # [m]: wheels may stand on the rim of the disc up to rounding

Shapes = NDArray[np.object_]


def robot_faults(spec: ScenarioSpec) -> list[Fault]:
    """Faults of the robot alone: wheels outside its disc, brakes that it cannot have."""
    robot, faults = spec.robot, []
    reach = 0.5 * math.hypot(robot.wheelbase, robot.track)
    if robot.radius > 0.0 and reach > robot.radius + BODY_TOLERANCE:
        faults.append(
            Fault(
                ("robot", "radius"),
                f"wheelbase {robot.wheelbase:g} and track {robot.track:g} do not fit in the disc: the wheels "
                f"stand {reach:.6g} m from its centre; expected at least that (or 0 for a point robot) [m]",
            )
        )
    faults += _pitch_faults(spec)
    grip = robot.friction * GRAVITY
    if grip < robot.max_braking * (1.0 - FRICTION_TOLERANCE):
        faults.append(
            Fault(
                ("robot", "friction"),
                f"mu g = {grip:.12g} m/s^2 cannot carry max_braking = {robot.max_braking:g} m/s^2; "
                f"expected at least max_braking / {GRAVITY:g} = {robot.max_braking / GRAVITY:.17g}, "
                f"or max_braking at most {_possible(spec, 'max_braking')} [m/s^2]",
            )
        )
    elif spec.braking.friction_reserve and grip <= robot.max_braking * (1.0 + FRICTION_TOLERANCE):
        faults.append(
            Fault(
                ("braking", "friction_reserve"),
                "full braking takes all the friction (mu g = max_braking), so that none is left to turn; "
                "expected false, more friction or less max_braking",
            )
        )
    return faults


def pitch_limit(robot: RobotSpec) -> float:
    """g l/(2 h) [m/s^2]: whoever brakes or accelerates harder lifts an axle (moments about the other one)."""
    return math.inf if robot.com_height == 0.0 else 0.5 * GRAVITY * robot.wheelbase / robot.com_height


def rounded_down(number: float) -> str:
    """A positive number in at most six digits, no greater, so that it can be written where it is a limit."""
    return f"{float(decimal.Context(prec=6, rounding=decimal.ROUND_FLOOR).create_decimal(repr(number))):g}"


def _possible(spec: ScenarioSpec, key: str) -> str:
    """The greatest deceleration or acceleration [m/s^2] that friction and the height allow."""
    robot = spec.robot
    return rounded_down(min(robot.friction * GRAVITY, _pitch_share(spec, key) * pitch_limit(robot)))


def _pitch_share(spec: ScenarioSpec, key: str) -> float:
    """Of the pitch limit, that brakes (`key` max_braking) or drive may reach."""
    wheels = spec.robot.radius > 0.0 and spec.simulation.model != "single_track"
    return BRAKING_SHARE if wheels and key == "max_braking" else 1.0


def _pitch_faults(spec: ScenarioSpec) -> list[Fault]:
    robot, faults = spec.robot, []
    limit, grip = pitch_limit(robot), robot.friction * GRAVITY
    for key, axle in (("max_braking", "rear"), ("max_acceleration", "front")):
        share = _pitch_share(spec, key)
        if getattr(robot, key) <= share * limit:
            continue
        swing = "" if share == 1.0 else f", of which {share:g} remain as brakes that come on make it swing"
        message = (
            f"lifts the {axle} axle: a centre of mass {robot.com_height:g} m high above a wheelbase of "
            f"{robot.wheelbase:g} m allows g l/(2 h) = {limit:.6g} m/s^2{swing}, friction mu g = {grip:.6g} "
            f"m/s^2; expected at most {_possible(spec, key)} [m/s^2]"
        )
        faults.append(Fault(("robot", key), message))
    return faults


def build_robot(spec: RobotSpec) -> Robot:
    """The robot of a valid specification."""
    numbers = spec.model_dump()
    for limit in ("max_speed", "max_steering_rate"):
        numbers[limit] = math.inf if numbers[limit] is None else numbers[limit]
    return Robot(**numbers)


def build_world(spec: ScenarioSpec) -> tuple[World | None, list[Fault]]:
    """The world, or None and what is wrong with it."""
    world = spec.world
    faults = _boundary_faults(world)
    if faults:
        return None, faults
    hall = shapely.Polygon(world.boundary)
    shapely.prepare(hall)
    faults = _obstacle_faults(hall, world.obstacles)
    if faults:
        return None, faults
    try:
        return World.build(world.boundary, [_planned(hall, obstacle) for obstacle in world.obstacles]), []
    except WorldError as error:
        where: KeyPath = ("world", "obstacles")
        return None, [Fault(where if error.obstacle is None else (*where, error.obstacle), str(error))]
    except shapely.errors.GEOSException as error:
        return None, [Fault(("world", "obstacles"), f"cannot be united: {error}")]


def _boundary_faults(world: WorldSpec) -> list[Fault]:
    sizes = [len(o.vertices) if o.circle is None else CIRCLE_SIDES for o in world.obstacles]
    count = len(world.boundary) + sum(sizes)
    if count > MAX_VERTICES:
        message = (
            f"has {count:,} vertices (a circle counts {CIRCLE_SIDES}); expected at most {MAX_VERTICES:,}"
        )
        return [Fault(("world",), message)]
    message = outline_fault(world.boundary)
    return [Fault(("world", "boundary"), message)] if message else []


def outline_fault(vertices: Sequence[tuple[float, float]]) -> str:
    """What is wrong with the outline of a polygon of at least three vertices [m]; empty if nothing is."""
    if vertices[0] == vertices[-1]:
        return "repeats its first vertex at the end; leave that out, the ring closes by itself"
    ring = np.array(vertices, dtype=float)
    gaps = np.hypot(*(np.roll(ring, -1, axis=0) - ring).T)
    short = int(np.argmin(gaps))
    if gaps[short] < SMALLEST_DETAIL:
        other = (short + 1) % len(ring)
        return f"vertices {short} and {other} are the same point {vertices[short]}; expected distinct ones"
    polygon = shapely.Polygon(ring)
    if not polygon.is_valid:
        reason = shapely.is_valid_reason(polygon).replace("[", " at [")
        return f"crosses or touches itself or encloses no area ({reason}); expected a simple polygon"
    if shapely.minimum_clearance(polygon) < SMALLEST_DETAIL:
        return f"comes closer to itself than {SMALLEST_DETAIL:g} m; expected a simple polygon"
    return ""


def _obstacle_faults(hall: shapely.Polygon, obstacles: Sequence[ObstacleSpec]) -> list[Fault]:
    around = hall.buffer(INSIDE_TOLERANCE, join_style="mitre")
    shapely.prepare(around)
    faults: list[Fault] = []
    for i, obstacle in enumerate(obstacles):
        path: KeyPath = ("world", "obstacles", i, "vertices" if obstacle.circle is None else "circle")
        message = _shape_fault(obstacle) or _outside_fault(around, hall, obstacle)
        if message:
            faults.append(Fault(path, f"{obstacle_label(obstacle, i)}: {message}"))
        if len(faults) > MAX_FAULTS:
            break
    if not faults and _is_tangled(obstacles):
        message = f"touch or cross one another more than {MAX_CONTACTS:,} times; expected fewer"
        faults.append(Fault(("world", "obstacles"), message))
    return faults


def _is_tangled(obstacles: Sequence[ObstacleSpec]) -> bool:
    """Whether uniting the obstacles could take more time and memory than the size of the file suggests.

    What unites them grows with the number of edges that meet and of obstacles that overlap, which can be
    the square of their number.
    """
    shapes = [_solid(obstacle) for obstacle in obstacles]
    rings = [shapely.get_coordinates(shape) for shape in shapes]
    starts = np.concatenate([ring[:-1] for ring in rings] or [np.empty((0, 2))])
    ends = np.concatenate([ring[1:] for ring in rings] or [np.empty((0, 2))])
    edges = shapely.linestrings(np.stack([starts, ends], axis=1))
    return _has_contacts(np.array(shapes, dtype=object)) or _has_contacts(edges)


def _has_contacts(shapes: Shapes) -> bool:
    """Whether over `MAX_CONTACTS` pairs of shapes meet, apart from each with itself and two neighbours."""
    tree, limit, count = shapely.STRtree(shapes), 3 * len(shapes) + 2 * MAX_CONTACTS, 0
    for first in range(0, len(shapes), _CHUNK):  # bounds the memory of the answer, and stops early
        count += tree.query(shapes[first : first + _CHUNK], predicate="intersects").shape[1]
        if count > limit:
            return True
    return False


def obstacle_label(obstacle: ObstacleSpec, index: int) -> str:
    """How a message calls an obstacle."""
    return f"obstacle {index}" + (f" ({show_value(obstacle.name)})" if obstacle.name else "")


def _shape_fault(obstacle: ObstacleSpec) -> str:
    vertices = obstacle.vertices
    if len(vertices) == 2 and math.dist(*vertices) < SMALLEST_DETAIL:
        return "both ends of the wall are the same point; expected two"
    return outline_fault(vertices) if len(vertices) > 2 else ""


def _outside_fault(around: shapely.Polygon, hall: shapely.Polygon, obstacle: ObstacleSpec) -> str:
    """A circle is judged by its own radius: the polygon around it is wider by up to 0.054 %."""
    circle = obstacle.circle
    if circle is None:
        return (
            ""
            if around.covers(_geometry(obstacle.vertices))
            else "lies outside the boundary, at least in part"
        )
    center = shapely.Point(circle.center)
    if not hall.covers(center):
        return "its centre lies outside the boundary"
    excess = circle.radius - center.distance(hall.exterior)
    return "" if excess <= INSIDE_TOLERANCE else f"reaches {excess:.6g} m beyond the boundary"


def _solid(spec: ObstacleSpec) -> shapely.Geometry:
    if spec.circle is None:
        return _geometry(spec.vertices)
    return _geometry(circle_obstacle(spec.circle.center, spec.circle.radius, CIRCLE_SIDES).vertices)


def _geometry(vertices: Sequence[tuple[float, float]]) -> shapely.Geometry:
    if len(vertices) == 1:
        return shapely.Point(vertices[0])
    return shapely.LineString(vertices) if len(vertices) == 2 else shapely.Polygon(vertices)


def _planned(hall: shapely.Polygon, spec: ObstacleSpec) -> Obstacle:
    if spec.circle is None:
        return Obstacle(spec.vertices, spec.name)
    return _circle(hall, spec.circle, spec.name)


def _circle(hall: shapely.Polygon, circle: CircleSpec, name: str) -> Obstacle:
    """The polygon around a circle, cut at the boundary where only its corners reach beyond."""
    whole = circle_obstacle(circle.center, circle.radius, CIRCLE_SIDES, name)
    polygon = shapely.Polygon(whole.vertices)
    if hall.covers(polygon):
        return whole
    parts: Sequence[Any] = shapely.get_parts(polygon.intersection(hall)).tolist()
    inside = min(parts, key=lambda part: part.distance(shapely.Point(circle.center)))
    ring = shapely.get_coordinates(inside.exterior)[:-1].tolist()
    return Obstacle(tuple((x, y) for x, y in ring), name, whole.circle)


def end_faults(
    spec: ScenarioSpec, world: World, braking: UniformBraking, zone: ConvexZone | None = None
) -> list[Fault]:
    """Faults of start and goal: no floor, no clearance, a speed that cannot be braked, the same place."""
    outlines = _outlines(world)
    faults = []
    for name in ("start", "goal"):
        found = _end_faults(name, spec, world, outlines, braking, zone)
        faults += found or ([] if zone is None else zone_end_faults(name, spec, world, zone))
    if math.dist(spec.start.position, spec.goal.position) < SMALLEST_DETAIL:
        faults.append(Fault(("goal", "position"), "is the start's position; expected another place"))
    return faults


def _end_faults(
    name: str,
    spec: ScenarioSpec,
    world: World,
    outlines: Shapes,
    braking: UniformBraking,
    zone: ConvexZone | None,
) -> list[Fault]:
    end = spec.start if name == "start" else spec.goal
    place: KeyPath = (name, "position")
    point, radius = shapely.Point(end.position), spec.robot.radius
    if not world.boundary.contains(point):
        return [Fault(place, "lies outside or on the boundary; expected a point on the floor [m]")]
    gaps = shapely.distance(outlines, point)
    nearest = int(np.argmin(gaps))
    what = (
        obstacle_label(spec.world.obstacles[nearest], nearest)
        if nearest < len(outlines) - 1
        else "the boundary"
    )
    if gaps[nearest] == 0.0:
        return [Fault(place, f"lies in or on {what}; expected a point on the floor [m]")]
    clearance = float(world.distance(end.position)) - radius
    if clearance < braking.margin + LEAST_CLEARANCE:
        return [
            Fault(
                place,
                f"clearance {clearance:.6g} m to {what} (distance {gaps[nearest]:.6g} m, less the radius "
                f"{radius:g} m); expected at least {LEAST_CLEARANCE:g} m more than the braking margin "
                f"{braking.margin:g} m",
            )
        ]
    return _speed_faults(name, spec, clearance, braking, zone)


def _outlines(world: World) -> Shapes:
    """Obstacles as solid shapes, then the boundary's outline."""
    shapes = [_geometry(obstacle.vertices) for obstacle in world.obstacles]
    return np.array([*shapes, world.boundary.exterior], dtype=object)


def _speed_faults(
    name: str, spec: ScenarioSpec, clearance: float, braking: UniformBraking, zone: ConvexZone | None
) -> list[Fault]:
    speed = (spec.start if name == "start" else spec.goal).speed
    if isinstance(speed, str):
        return []
    if speed > braking.max_speed:
        return [
            Fault(
                (name, "speed"),
                f"is above robot.max_speed = {braking.max_speed:g}; expected at most that [m/s]",
            )
        ]
    safe = float(braking.speed(clearance)) * SAFE_SHARE
    if zone is None and speed > safe:
        return [
            Fault(
                (name, "speed"),
                f"cannot be braked within the clearance {clearance:.6g} m; "
                f"expected at most {safe:.9g} [m/s], or safe",
            )
        ]
    return []
