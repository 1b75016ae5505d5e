"""What a vehicle whose wheels roll without slip must do to follow a trajectory.

The planned path is that of the point midway between the axles. With beta the angle from the body to the
direction of travel and b half the wheelbase, the rear axle does not slip when the yaw rate is
r = v sin(beta) / b, so that d(beta)/dt = v kappa - v sin(beta) / b: a jump of the curvature needs no jump
of the body, which follows within half a wheelbase. The front axle does not slip when
tan(delta) = 2 tan(beta) (Derived; in a steady turn sin(beta) = kappa l / 2, Manor 2015, eq. A.1).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from systems.schedule import Demand, Samples, moving_average, paced, shrinking_average
from systems.single_track import gyration_squared
from vnav_drake.plan import Trajectory
from vnav_drake.robot import GRAVITY, Robot

Array = NDArray[np.float64]

WHEEL_RADIUS = 0.16  # of the wheelbase
SINK = 1e-3  # of the wheelbase, by which a wheel at rest sinks into the floor
STEERING_LAG = 0.02  # [s], of the steering servo, damping over stiffness
COMMAND_LAG = 0.005  # [s]: a command is held for 10 ms, and acts in the mean half of that late
YAW_FRICTION = 0.35  # share of the friction that turning the body (not the path) may take
SHORTEST_SMOOTHING = 0.06  # [s], of curvature, for a body that swings faster
LONGEST_SMOOTHING = 0.8  # [s]


@dataclass(frozen=True, kw_only=True)
class RollingDemand(Demand):
    """A `Demand` of wheels that roll."""

    curvature: Array  # (n,) [1/m], of the path, averaged


def rolling_demand(
    robot: Robot, trajectory: Trajectory, period: float, *, slowing: bool = True
) -> RollingDemand:
    """Sample a trajectory every `period` [s] and invert the rolling vehicle along it.

    Speed and curvature are averaged over one swing of the body on its tyres, for a ramp that lasts one swing
    leaves none behind; curvature over a longer time, where otherwise the steering rate would not suffice or
    turning the body take more than `YAW_FRICTION` of the friction. Windows are symmetric, so without delay.
    """
    swing = swing_time(robot)
    friction = robot.friction_acceleration if slowing else math.inf
    samples = _gentle(paced(trajectory, friction, period), swing, period)
    width = max(SHORTEST_SMOOTHING, swing)
    base, gyration = 0.5 * robot.wheelbase, gyration_squared(robot)
    while True:
        kappa = moving_average(samples.curvature, max(round(0.5 * width / period), 1))
        beta = _body_angle(samples.speed, kappa, base, period)
        steering = np.arctan(2.0 * np.tan(beta))
        yaw_rate = samples.speed * np.sin(beta) / base
        turning = gyration * np.abs(np.gradient(yaw_rate, period)).max()
        rate = np.abs(np.gradient(steering, period)).max()
        allowed = YAW_FRICTION * robot.friction_acceleration * base
        if width >= LONGEST_SMOOTHING or (turning <= allowed and rate <= robot.max_steering_rate):
            break
        width *= 1.4
    steering = np.clip(steering, -robot.max_steering, robot.max_steering)
    return RollingDemand(
        period=period,
        duration=samples.duration,
        arc_length=samples.arc_length,
        speed=samples.speed,
        course=samples.course,
        heading=samples.course - beta,
        lateral_velocity=samples.speed * np.sin(beta),
        yaw_rate=yaw_rate,
        steering=steering,
        steering_command=steering + (STEERING_LAG + COMMAND_LAG) * np.gradient(steering, period),
        force=robot.mass
        * _wheel_force(samples.acceleration, samples.speed, kappa, beta, steering, yaw_rate, robot, period),
        curvature=kappa,
    )


def swing_time(robot: Robot) -> float:
    """How long [s] the body takes to roll or pitch once to and fro on its tyres, the slower of both.

    A wheel at rest sinks by `SINK` l under m g / 4, so that tilting by a small angle about an axis with the
    wheels at distances +-d gives the moment m g (d^2 / (SINK l) - h) back; the inertia about the floor is
    that of the box, m (width^2 + height^2) / 12, and m h^2.
    """
    h, depth = robot.com_height, SINK * robot.wheelbase
    high = max(2.0 * h, 2.0 * WHEEL_RADIUS * robot.wheelbase)
    swings = []
    for width in (robot.wheelbase, robot.track):
        inertia = (width**2 + high**2) / 12.0 + h * h  # over mass
        stiffness = GRAVITY * (0.25 * width**2 / depth - h)
        swings.append(2.0 * math.pi * math.sqrt(inertia / stiffness) if stiffness > 0.0 else math.inf)
    return max(swings)


def _gentle(samples: Samples, width: float, period: float) -> Samples:
    """The same schedule with its changes of acceleration spread over `width` [s], without delay."""
    half = round(0.5 * width / period)
    speed = shrinking_average(samples.speed, half)
    return replace(
        samples,
        arc_length=shrinking_average(samples.arc_length, half),
        speed=speed,
        acceleration=np.append(np.diff(speed) / period, samples.acceleration[-1]),
    )


def _body_angle(v: Array, kappa: Array, base: float, period: float) -> Array:
    """beta [rad] along the samples, from the steady turn of the first; implicit, so stable for every step."""
    beta = math.asin(min(max(float(kappa[0]) * base, -1.0), 1.0))
    found = [beta]
    for speed, bend in zip(v[1:].tolist(), kappa[1:].tolist(), strict=True):
        rate = speed * period / base
        # sin(beta) linearised about the value before, at the end of the step
        slope = math.cos(beta)
        beta += (speed * bend * period - rate * math.sin(beta)) / (1.0 + rate * slope)
        found.append(beta)
    return np.array(found)


def _wheel_force(
    a: Array,
    v: Array,
    kappa: Array,
    beta: Array,
    steering: Array,
    yaw_rate: Array,
    robot: Robot,
    period: float,
) -> Array:
    """Force along the wheels, over mass [m/s^2]: what accelerates, and what turned front wheels take away.

    The front axle's share of the lateral force, half of v^2 kappa and k^2 r'/(2 b) for turning the body, acts
    across the turned wheel: sin(delta) of it pulls backwards.
    """
    base, gyration = 0.5 * robot.wheelbase, gyration_squared(robot)
    forward = a * np.cos(beta) - v * v * kappa * np.sin(beta)
    left = a * np.sin(beta) + v * v * kappa * np.cos(beta)
    front = 0.5 * (left + gyration * np.gradient(yaw_rate, period) / base)  # of the axle, in the body's frame
    share = np.clip(0.5 - 0.5 * robot.com_height * forward / (base * GRAVITY), 0.05, 0.95)
    # along: forward = d (share cos + 1 - share) - s sin, across: front = d share sin + s cos
    cosine, sine = np.cos(steering), np.sin(steering)
    force: Array = (forward + front * sine / cosine) / (share / cosine + 1.0 - share)
    return force
