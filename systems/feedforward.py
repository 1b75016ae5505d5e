"""What the vehicle must do to follow a trajectory: the inverse of the single-track model.

The planned path is that of the centre of mass, so its acceleration (a, v^2 kappa) is prescribed and the
body follows. With beta the angle from the body to the direction of travel and r the yaw rate,
`d(beta)/dt = v kappa - r`. The two lateral axle forces add up to the prescribed one, so the yaw equation
needs only the rear force, which follows from the rear slip `v sin(beta) - b r`. A jump of the curvature
therefore needs no jump of the body: beta follows kappa within half a wheelbase. Front force, slip and
steering angle come from what is left (Derived).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from systems.schedule import Demand, Samples, moving_average, paced
from systems.single_track import STEERING_TIME_CONSTANT, Body
from systems.tyre import (
    CORNERING_STIFFNESS,
    SLIP_REGULARISATION,
    brush_force,
    brush_slip,
    brush_slope,
    rolling_speed,
)
from vnav_drake.plan import Trajectory
from vnav_drake.robot import GRAVITY

Array = NDArray[np.float64]

FRICTION_USED = (
    0.98  # of the friction circle that feed-forward may ask for: beyond, the inverse tyre law is flat
)
YAW_FRICTION = 0.5  # share of the friction that turning the body (not the path) may take
SHORTEST_SMOOTHING = 0.06  # [s], of curvature: two time constants of the steering servo
LONGEST_SMOOTHING = 0.8  # [s]
SOFTEST = (
    0.15  # of the cornering stiffness: least secant used here, so that a plan beyond friction stays bounded
)
SLOW = 0.02  # [m/s]: below, the front wheel is set by geometry alone
PASSES = 4  # of the fixed point between drive force and steering angle, each gains about a digit


@dataclass(frozen=True, kw_only=True)
class SlippingDemand(Demand):
    """A `Demand` of tyres that slip."""

    front_stiffness: Array  # [N/(m/s)], lateral force lost per lateral velocity of the axle
    rear_stiffness: Array  # [N/(m/s)]
    steering_stiffness: Array  # [N/rad], lateral force gained per steering angle


def _body_motion(body: Body, v: Array, a: Array, kappa: Array, period: float) -> tuple[Array, Array]:
    """Angle beta from body to direction of travel [rad] and yaw rate r [rad/s] along the samples.

    Integrates d(beta)/dt = v kappa - r and k^2 dr/dt = b (left - 2 Y_r), Y_r the rear force over mass,
    from the steady turn of the first sample. The tyre is stiff, so its force is taken at the end of the step
    (secant stiffness of the step before): stable for every step.
    """
    b, k2, mu = body.half_base, body.gyration_squared, body.friction
    softest = SOFTEST * CORNERING_STIFFNESS
    rate = float(v[0] * kappa[0])
    side = min(max(float(v[0]) ** 2 * float(kappa[0]) / GRAVITY, -FRICTION_USED * mu), FRICTION_USED * mu)
    slip = -float(brush_slip(side, mu))
    across = b * rate + slip * rolling_speed(float(v[0]))
    sine = across / float(v[0]) if v[0] > SLIP_REGULARISATION else b * float(kappa[0])
    beta = math.asin(min(max(sine, -1.0), 1.0))
    betas, rates = [beta], [rate]
    for speed, gain, bend in zip(v[1:].tolist(), a[1:].tolist(), kappa[1:].tolist(), strict=True):
        cosine, sine = math.cos(beta), math.sin(beta)
        turn = speed * speed * bend
        forward, left = gain * cosine - turn * sine, gain * sine + turn * cosine
        load = GRAVITY * (0.5 + 0.5 * body.com_height * forward / (b * GRAVITY))  # rear, over mass
        force = brush_force(slip, mu)
        secant = max(force / slip if abs(slip) > 1e-6 else CORNERING_STIFFNESS, softest)
        damping = max(load, 0.0) * secant / rolling_speed(speed)  # rear force over mass and lateral velocity
        pull = period * b / k2
        rate = (rate + pull * (left + 2.0 * damping * speed * sine)) / (1.0 + 2.0 * b * pull * damping)
        slip = (speed * sine - b * rate) / rolling_speed(speed)
        beta += period * (speed * bend - rate)
        betas.append(beta)
        rates.append(rate)
    return np.array(betas), np.array(rates)


def demand(body: Body, trajectory: Trajectory, period: float, *, slowing: bool = True) -> SlippingDemand:
    """Sample a trajectory every `period` [s] and invert the vehicle along it.

    Curvature is averaged over the shortest time window (symmetric, so without delay) with which the steering
    servo's rate suffices and turning the body takes at most `YAW_FRICTION` of the friction.
    """
    samples = paced(trajectory, body.friction * GRAVITY if slowing else math.inf, period)
    width = SHORTEST_SMOOTHING
    while True:
        result = _demand(body, samples, period, width)
        turning = body.gyration_squared * np.abs(np.gradient(result.yaw_rate, period)).max()
        rate = np.abs(np.gradient(result.steering, period)).max()
        allowed = YAW_FRICTION * body.friction * GRAVITY * body.half_base
        if width >= LONGEST_SMOOTHING or (turning <= allowed and rate <= body.max_steering_rate):
            return result
        width *= 1.4


def _demand(body: Body, samples: Samples, period: float, width: float) -> SlippingDemand:
    v, a, course, count = samples.speed, samples.acceleration, samples.course, len(samples.speed)
    kappa = moving_average(samples.curvature, max(round(0.5 * width / period), 1))

    b, mu, h, weight = body.half_base, body.friction, body.com_height, body.mass * GRAVITY
    beta, turn = _body_motion(body, v, a, kappa, period)
    yaw = body.gyration_squared * np.gradient(turn, period) / b
    forward = a * np.cos(beta) - v * v * kappa * np.sin(beta)  # acceleration in the body's frame
    left = a * np.sin(beta) + v * v * kappa * np.cos(beta)
    share_f = np.clip(0.5 - 0.5 * h * forward / (b * GRAVITY), 0.05, 0.95)  # of the weight on the front axle
    share_r = 1.0 - share_f
    body_f = 0.5 * (left + yaw) / (GRAVITY * share_f)  # lateral force over load, in the body's frame
    body_r = 0.5 * (left - yaw) / (GRAVITY * share_r)
    rolling = np.hypot(v, SLIP_REGULARISATION)
    across, along = v * np.sin(beta) + b * turn, v * np.cos(beta)
    front_angle = np.where(v > SLOW, np.arctan2(across, along), np.arctan(2.0 * np.tan(beta)))
    steering, side_f, drive = front_angle, np.zeros(count), a / GRAVITY
    for _ in range(PASSES):
        cosine, sine = np.cos(steering), np.sin(steering)
        drive = (forward / GRAVITY + side_f * share_f * sine) / (share_f * cosine + share_r)
        drive = np.clip(drive, body.min_force / weight, body.max_force / weight)
        room = np.sqrt(np.maximum((FRICTION_USED * mu) ** 2 - drive * drive, 0.01 * mu * mu))
        side_f = np.clip((body_f - drive * sine) / cosine, -room, room)
        slip_f = -brush_slip(side_f, mu)
        # the wheel points where its axle moves, turned back by its slip angle
        steering = front_angle - np.arctan(slip_f * rolling / np.maximum(v, SLIP_REGULARISATION))
        steering = np.clip(steering, -body.max_steering, body.max_steering)
    slip_r = -brush_slip(np.clip(body_r, -room, room), mu)
    softest = SOFTEST * CORNERING_STIFFNESS
    front = weight * share_f * np.maximum(brush_slope(slip_f, mu), softest) / rolling
    return SlippingDemand(
        period=period,
        duration=samples.duration,
        arc_length=samples.arc_length,
        speed=v,
        course=course,
        heading=course - beta,
        lateral_velocity=v * np.sin(beta),
        yaw_rate=turn,
        steering=steering,
        steering_command=steering + STEERING_TIME_CONSTANT * np.gradient(steering, period),
        force=weight * drive,
        front_stiffness=front,
        rear_stiffness=weight * share_r * np.maximum(brush_slope(slip_r, mu), softest) / rolling,
        steering_stiffness=front * v,
    )
