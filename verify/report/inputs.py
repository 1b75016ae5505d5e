"""What was asked for, as rows of a table: robot, braking law and ends."""

from __future__ import annotations

import math

from verify.report.text import label
from vnav_drake.problem import Problem


def robot_rows(problem: Problem) -> list[tuple[str, str, str]]:
    """Limit, value with unit, where it comes from."""
    robot, braking = problem.robot, problem.braking

    def limited(value: float, unit: str) -> str:
        return f"{value:g}\u00a0{unit}" if math.isfinite(value) else "not limited"

    return [
        ("Radius", limited(robot.radius, "m"), "disc that contains the body"),
        ("Mass", limited(robot.mass, "kg"), ""),
        ("Wheelbase", limited(robot.wheelbase, "m"), ""),
        ("Track", limited(robot.track, "m"), ""),
        ("Height of the centre of mass", limited(robot.com_height, "m"), ""),
        ("Friction μ", f"{robot.friction:g}", f"μg = {robot.friction_acceleration:.3f} m/s², eq. (A.2)"),
        ("Braking a_b", limited(robot.max_braking, "m/s²"), "eq. (3.13)"),
        ("Acceleration a_max", limited(robot.max_acceleration, "m/s²"), "drive limit"),
        ("Top speed v_max", limited(robot.max_speed, "m/s"), ""),
        (
            "Steering ω_max",
            limited(robot.max_steering, "rad"),
            f"|κ| ≤ {robot.max_curvature:.3f} 1/m, eq. (A.1)",
        ),
        ("Steering rate", limited(robot.max_steering_rate, "rad/s"), ""),
        ("Tip-over", limited(round(robot.tip_acceleration, 3), "m/s²"), "g w / 2h, eq. (A.3)"),
        ("Reaction time", limited(braking.reaction_time, "s"), "braking law"),
        ("Braking margin", limited(braking.margin, "m"), "braking law"),
        (
            "Braking zone",
            "disc" if problem.zone is None else label(problem.zone.type_name) or "unnamed",
            "the same in every direction" if problem.zone is None else "turns with the heading",
        ),
        (
            "Friction reserve",
            "kept" if problem.friction_reserve else "not asked for",
            "full braking while turning",
        ),
        ("Start", _end(problem.start.position, problem.start.speed), ""),
        ("Goal", _end(problem.goal.position, problem.goal.speed), ""),
    ]


def _end(position: tuple[float, float], speed: float | str) -> str:
    pace = f"speed {speed}" if isinstance(speed, str) else f"speed {speed:g} m/s"
    return f"({position[0]:g}, {position[1]:g}) m, {pace}".replace("-", "−")
