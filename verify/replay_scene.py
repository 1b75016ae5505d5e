"""The replay's scene in Meshcat: light and camera, world, paths on the floor, the robot at its own origin."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from pydrake.geometry import Box, Cylinder, Meshcat, Rgba, Sphere
from pydrake.math import RigidTransform, RotationMatrix

from verify import replay_shapes as shapes
from verify.replay_motion import WHEELS, Frames, ZoneStep, key_rows, wheel_places, wheel_radius
from verify.report.palette import CASING, FLOOR, INK, LIMIT, MUTED, PAPER, RACK, RACK_EDGE, RULE, method
from verify.report.speed_scale import speed_colours
from vnav_drake.plan import Trajectory
from vnav_drake.problem import Problem
from vnav_drake.robot import Robot
from vnav_drake.world import World

Array = NDArray[np.float64]

ROOT = "/replay"
ROBOT = f"{ROOT}/robot"
BRAKING, BRAKING_STOP = f"{ROBOT}/braking", f"{ROBOT}/braking_stop"  # discs of radius 1 m: calm, and red
BRAKING_COLOUR = method("speed_graph").light
UNIFORM, UNIFORM_COLOUR = f"{ROBOT}/uniform", method("uniform").light  # a rim of radius 1 m, beside a zone

RISE_SHARE = 1.0 / 45.0  # height of what stands on the floor over the world's diameter
LEDGE_SHARE = 0.12  # height of the outer wall over that: what touches it stays visible
LAYER_SHARE = 2e-4  # distance between what lies on the floor over the world's diameter
RIBBON_SHARE = 1.0 / 200.0  # width of the planned path over the world's diameter
MARK_SHARE = 1.0 / 130.0  # radius of a point robot's marker over the world's diameter
PATH_POINTS = 900  # of the planned path, evenly along it
PLACE_TOLERANCE = 2e-5  # of animated places, over the world's diameter

# Light: what lies flat gets exactly its own colour (three.js: 1 / pi of what falls on it), sides are darker.
AMBIENT = 0.6  # share that comes from everywhere
LIGHT = (-4.0, -6.0, 12.0)  # from where the rest comes

FIELD = math.radians(36.0)  # of view, from top to bottom
ASPECTS = tuple(0.4 * 1.1**k for k in range(22))  # width over height of windows, up to 3
MARGIN = 1.03  # the onlooker stands further away than need be
ELEVATION = math.radians(58.0)  # of the onlooker, to the south: the picture stands as on the map


def _rgba(colour: str, alpha: float = 1.0) -> Rgba:
    return Rgba(*(int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5)), alpha)


def _mesh(meshcat: Meshcat, path: str, triangles: Array, colour: Rgba) -> None:
    if len(triangles):
        vertices = np.asfortranarray(triangles.reshape(-1, 3).T)
        faces = np.asfortranarray(np.arange(vertices.shape[1], dtype=np.int32).reshape(-1, 3).T)
        meshcat.SetTriangleMesh(path, vertices, faces, colour)


def build_world(meshcat: Meshcat, problem: Problem) -> None:
    """Light, camera, floor, walls, obstacles, start and goal."""
    world, size = problem.world, problem.world.diameter
    for path in ("/Grid", "/Axes", "/Lights/SpotLight", "/Lights/PointLightNegativeX"):
        meshcat.SetProperty(path, "visible", False)
    meshcat.SetProperty("/Lights/PointLightPositiveX", "visible", False)
    meshcat.SetProperty("/Lights/AmbientLight/<object>", "intensity", math.pi * AMBIENT)
    meshcat.SetProperty("/Lights/FillLight/<object>", "position", list(LIGHT))
    sun = math.pi * (1.0 - AMBIENT) * math.hypot(*LIGHT) / LIGHT[2]
    meshcat.SetProperty("/Lights/FillLight/<object>", "intensity", sun)
    paper = _rgba(PAPER.light)
    for half in ("top_color", "bottom_color"):
        meshcat.SetProperty("/Background/<object>", half, [paper.r(), paper.g(), paper.b()])
    rise = RISE_SHARE * size
    ground = shapes.plate([world.boundary], 0.0)
    _mesh(meshcat, f"{ROOT}/floor", ground, _rgba(FLOOR.light))
    standing = shapes.solids(world)
    around = shapes.extruded(shapes.outer_wall(world), LEDGE_SHARE * rise)
    _mesh(meshcat, f"{ROOT}/boundary", around, _rgba(MUTED.light))
    _mesh(meshcat, f"{ROOT}/obstacles", shapes.extruded(standing, rise), _rgba(RACK.light))
    edges = shapes.outlines(standing)
    if len(edges):
        ends = np.concatenate([edges, np.full((len(edges), 2, 1), rise)], axis=-1)
        start, end = (np.asfortranarray(ends[:, k].T) for k in (0, 1))
        meshcat.SetLineSegments(f"{ROOT}/edges", start, end, 1.0, _rgba(RACK_EDGE.light))
    _ends(meshcat, problem)
    meshcat.SetCamera(Meshcat.PerspectiveCamera(fov=math.degrees(FIELD), near=1e-3 * size, far=20.0 * size))
    first = views(world)[-1]
    meshcat.SetCameraPose(first["eye"], first["target"])


def views(world: World) -> list[dict[str, Any]]:
    """From where to see the whole world, for windows of each of `ASPECTS`: `eye` and `target` (3,) [m]."""
    corners = shapely.get_coordinates(world.boundary)
    foot = np.column_stack([corners, np.zeros(len(corners))])
    points = np.concatenate([foot, foot + np.array([0.0, 0.0, RISE_SHARE * world.diameter])])
    found = []
    for aspect in ASPECTS:
        eye, target = view(points, aspect)
        found.append({"aspect": aspect, "eye": eye.tolist(), "target": target.tolist()})
    return found


def view(points: Array, aspect: float) -> tuple[Array, Array]:
    """Where an onlooker stands (3,) and looks (3,) [m] to see all `points` (n, 3) [m], in the middle.

    Derived: of a point that lies a to the right, b up and c towards the onlooker, |a| and |b| may be at most
    (D - c) times the tangents h of half the fields of view, D being the distance. Moved up by s, the window
    holds all when max(b + c h) - D h <= s <= min(b - c h) + D h: there is such an s from D =
    (max(b + c h) - min(b - c h)) / (2 h) on, and the same across.
    """
    back = np.array([0.0, -math.cos(ELEVATION), math.sin(ELEVATION)])
    right = np.array([1.0, 0.0, 0.0])
    up = np.cross(back, right)
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    off = points - middle
    toward = off @ back
    distance, target = 0.0, middle
    for axis, half in ((right, aspect * math.tan(0.5 * FIELD)), (up, math.tan(0.5 * FIELD))):
        least, most = float(np.min(off @ axis - toward * half)), float(np.max(off @ axis + toward * half))
        distance = max(distance, 0.5 * (most - least) / half)
        target = target + 0.5 * (most + least) * axis
    return target + MARGIN * distance * back, target


def _ends(meshcat: Meshcat, problem: Problem) -> None:
    """A ring around the start, a flag at the goal."""
    size = problem.world.diameter
    radius = max(problem.robot.radius, 1.5 * MARK_SHARE * size)
    green = method("refined").light
    for name, end, colour in (("start", problem.start, INK.light), ("goal", problem.goal, green)):
        rim = shapes.ring(0.82 * radius, radius, 0.5 * LAYER_SHARE * size, end.point)
        _mesh(meshcat, f"{ROOT}/{name}", rim, _rgba(colour))
    foot, tall = np.array([*problem.goal.point, 0.0]), 2.4 * RISE_SHARE * size
    meshcat.SetObject(f"{ROOT}/goal/pole", Cylinder(0.012 * tall, tall), _rgba(INK.light))
    meshcat.SetTransform(f"{ROOT}/goal/pole", RigidTransform(foot + np.array([0.0, 0.0, 0.5 * tall])))
    cloth = foot + tall * np.array([[[0.0, 0.0, 1.0], [0.0, 0.0, 0.66], [0.5, 0.0, 0.83]]])
    _mesh(meshcat, f"{ROOT}/goal/flag", cloth, _rgba(green))


def build_paths(
    meshcat: Meshcat, problem: Problem, trajectory: Trajectory, motion: Frames, stops: Sequence[Array]
) -> None:
    """Planned path, driven path and emergency stops, one above the other on the floor."""
    size = problem.world.diameter
    layer, half = LAYER_SHARE * size, 0.5 * RIBBON_SHARE * size
    run = trajectory.arc_length
    along = np.linspace(run[0], run[-1], PATH_POINTS)
    rising = np.append(True, np.diff(run) > 0.0)
    x, y, _, v, _, _ = trajectory.at(np.interp(along, run[rising], trajectory.t[rising]))
    band, owner = shapes.ribbon(np.column_stack([x, y]), half, layer)
    if len(band):
        colours = _linear(speed_colours(v, top_speed(trajectory)))[owner].reshape(-1, 3)
        vertices, faces = band.reshape(-1, 3), np.arange(3 * len(band), dtype=np.int32).reshape(-1, 3)
        arrays = (np.asfortranarray(table.T) for table in (vertices, faces, colours))
        meshcat.SetTriangleColorMesh(f"{ROOT}/plan", *arrays)
    rows = key_rows(np.column_stack([motion.x, motion.y]), PLACE_TOLERANCE * size)
    driven = np.column_stack([motion.x, motion.y])[rows]
    _mesh(
        meshcat, f"{ROOT}/driven", shapes.ribbon(driven, 0.22 * half, 2.0 * layer)[0],
        _rgba(method("simulation").light),
    )  # fmt: skip
    for i, line in enumerate(stops):
        reach = max(problem.robot.radius, 2.0 * half)
        end = shapes.ring(reach - 0.6 * half, reach, 3.0 * layer, line[-1])
        way = shapes.ribbon(line, 0.6 * half, 3.0 * layer)[0]
        _mesh(meshcat, f"{ROOT}/stops/{i}", np.concatenate([way, end]), _rgba(LIMIT.light))


def _linear(colours: Array) -> Array:
    """Colours at corners as light: three.js takes them without the curve of sRGB (IEC 61966-2-1)."""
    return np.where(colours <= 0.04045, colours / 12.92, ((colours + 0.055) / 1.055) ** 2.4)


def top_speed(trajectory: Trajectory) -> float:
    """Greatest speed [m/s] of a motion, the end of the scale of colours; 1 for one that stands."""
    return float(trajectory.v.max()) or 1.0


def build_robot(meshcat: Meshcat, problem: Problem, zone: Sequence[ZoneStep] = ()) -> None:
    """The robot at its own origin: the centre of mass over the floor, x forwards, y to the left.

    With `zone` its outlines are what must be free, and of the disc of uniform braking the rim alone is drawn.
    """
    robot, size = problem.robot, problem.world.diameter
    layer = LAYER_SHARE * size
    for path, colour in ((BRAKING, BRAKING_COLOUR), (BRAKING_STOP, LIMIT.light)):
        for k, step in enumerate(zone):
            around = step.outline
            _mesh(meshcat, f"{path}/{k}/area", shapes.fan(around, 4.0 * layer), _rgba(colour, 0.28))
            _mesh(meshcat, f"{path}/{k}/rim", shapes.rim(around, 0.97, 4.5 * layer), _rgba(colour))
        if not zone:
            _mesh(meshcat, f"{path}/area", shapes.ring(0.0, 1.0, 4.0 * layer), _rgba(colour, 0.28))
            _mesh(meshcat, f"{path}/rim", shapes.ring(0.97, 1.0, 4.5 * layer), _rgba(colour))
    if zone:
        _mesh(meshcat, f"{UNIFORM}/rim", shapes.ring(0.985, 1.0, 3.5 * layer), _rgba(UNIFORM_COLOUR))
    if robot.radius == 0.0:
        radius = MARK_SHARE * size
        meshcat.SetObject(f"{ROBOT}/marker", Sphere(radius), _rgba(CASING.light))
        meshcat.SetTransform(f"{ROBOT}/marker", RigidTransform([0.0, 0.0, radius]))
        return
    _mesh(
        meshcat, f"{ROBOT}/disc", shapes.ring(0.94 * robot.radius, robot.radius, 5.0 * layer),
        _rgba(CASING.light),
    )  # fmt: skip
    _body(meshcat, robot)


def _body(meshcat: Meshcat, robot: Robot) -> None:
    """A box whose middle is the centre of mass, and four wheels with a spoke each that shows them turn."""
    wheel = wheel_radius(robot)
    wide = 0.45 * wheel
    length, width = robot.wheelbase + wheel, robot.track - 1.2 * wide
    tall = max(2.0 * (robot.com_height - 0.6 * wheel), 0.5 * wheel)
    middle = max(robot.com_height, 0.5 * tall)
    box = Box(length, max(width, wide), tall)
    meshcat.SetObject(f"{ROBOT}/chassis", box, _rgba(method("simulation").light))
    meshcat.SetTransform(f"{ROBOT}/chassis", RigidTransform([0.0, 0.0, middle]))
    nose = [0.5 * length - 0.12 * length, 0.0, middle + 0.5 * tall]
    meshcat.SetObject(f"{ROBOT}/nose", Box(0.24 * length, max(width, wide), 0.1 * tall), _rgba(PAPER.light))
    meshcat.SetTransform(f"{ROBOT}/nose", RigidTransform(nose))
    across = RotationMatrix.MakeXRotation(0.5 * math.pi)
    for name, place in zip(WHEELS, wheel_places(robot), strict=True):
        path = f"{ROBOT}/{name}"
        meshcat.SetTransform(path, RigidTransform([*place, wheel]))
        meshcat.SetObject(f"{path}/spin/tyre", Cylinder(wheel, wide), _rgba(CASING.light))
        meshcat.SetTransform(f"{path}/spin/tyre", RigidTransform(across, np.zeros(3)))
        meshcat.SetObject(f"{path}/spin/spoke", Box(1.6 * wheel, 1.08 * wide, 0.3 * wheel), _rgba(RULE.light))
