"""The fire extinguishers of Manor 2015, Sec. 3.7: can a robot be 50 m away within 60 s?

Derived: from rest to rest over a length L with acceleration a both ways and a cruising speed v, each ramp
lasts v / a and covers v^2 / (2 a), which v would cover in half of that time; so the time is L / v + v / a.
For a time t the least such v is (t - sqrt(t^2 - 4 L / a)) a / 2. In the middle of a corridor v needs
the clearance v^2 / (2 a_b).
"""

from __future__ import annotations

import dataclasses
import math

from benchmarks.reproduction.page import ROOT, Data, Row, table
from vnav_drake.braking import UniformBraking
from vnav_drake.problem import End, Problem
from vnav_drake.robot import Robot
from vnav_drake.scenario import load_scenario
from vnav_drake.vc_method import vc_method
from vnav_drake.world import World

WAREHOUSE = ROOT / "scenarios" / "warehouse.yaml"
# Sec. 3.7: "able to reach sites located 50 meters away from its start point within 60 seconds"
DISTANCE, TIME = 50.0, 60.0  # [m], [s]
TOP_SPEED = 1.0  # [m/s], "maximal speeds of about 1 m/sec" (Sec. 3.7)
INTERFACE_SPEED = 0.5  # [m/s]: iRobot, "Create Open Interface" (2006), commands 137 and 145, -500 to 500 mm/s
RADIUS = 0.17  # [m], about that of the Create
ACCELERATIONS = {"warehouse and office floor, Sec. 3.7": 1.0, "Create, Sec. 2.8": 0.1}  # [m/s^2], both ways
DOOR = 0.9  # [m], an ordinary door; ours


def cruising_speed(length: float, time: float, acceleration: float) -> float:
    """Least cruising speed [m/s] that covers `length` [m] in `time` [s] from rest to rest.

    Raises
    ------
    ValueError : even without a greatest speed it takes longer.
    """
    square = time * time - 4.0 * length / acceleration
    if square < 0.0:
        raise ValueError(f"{length:g} m take {2.0 * math.sqrt(length / acceleration):.3g} s at least")
    return 0.5 * acceleration * (time - math.sqrt(square))


def robot(acceleration: float, max_speed: float = math.inf) -> Robot:
    """A disc as wide as the Create."""
    return Robot(
        radius=RADIUS,
        mass=4.0,
        wheelbase=0.2,
        track=0.2,
        com_height=0.05,
        friction=0.6,
        max_braking=acceleration,
        max_acceleration=acceleration,
        max_speed=max_speed,
    )


def corridor(width: float, acceleration: float) -> Problem:
    """Along the middle of a straight corridor of this width [m], half of it away from the end walls."""
    half = 0.5 * width
    return Problem(
        world=World.build([(0.0, 0.0), (DISTANCE + width, 0.0), (DISTANCE + width, width), (0.0, width)]),
        robot=robot(acceleration),
        braking=UniformBraking(max_braking=acceleration),
        start=End(position=(half, half), speed="rest"),
        goal=End(position=(half + DISTANCE, half), speed="rest"),
    )


def _case(acceleration: float) -> Data:
    speed = cruising_speed(DISTANCE, TIME, acceleration)
    clearance = speed * speed / (2.0 * acceleration)
    width = 2.0 * (clearance + RADIUS)
    door = math.sqrt(2.0 * acceleration * (0.5 * DOOR - RADIUS))
    return {
        "acceleration": acceleration,
        "speed": speed,
        "clearance": clearance,
        "width": width,
        "door_speed": door,
        "planned": vc_method(corridor(width, acceleration)).realisation.trajectory.travel_time,
        "warehouse": _in_warehouse(acceleration),
    }


def _in_warehouse(acceleration: float) -> Data:
    """The vc-method's motion through the warehouse, at most TOP_SPEED fast, from rest to rest."""
    asked = load_scenario(WAREHOUSE).problem
    asked = dataclasses.replace(
        asked,
        robot=robot(acceleration, TOP_SPEED),
        braking=UniformBraking(max_braking=acceleration, max_speed=TOP_SPEED),
        start=dataclasses.replace(asked.start, speed="rest"),
        goal=dataclasses.replace(asked.goal, speed="rest"),
    )
    found = vc_method(asked).realisation
    return {"time": found.trajectory.travel_time, "length": found.path.length}


def measure() -> Data:
    """What the printed figure asks of speed, clearance and corridor."""
    return {
        "printed": {"distance": DISTANCE, "time": TIME, "top_speed": TOP_SPEED, "place": "Sec. 3.7"},
        "mean_speed": DISTANCE / TIME,
        "interface": {"speed": INTERFACE_SPEED, "least_time": DISTANCE / INTERFACE_SPEED},
        "radius": RADIUS,
        "door": DOOR,
        "cases": {name: _case(a) for name, a in ACCELERATIONS.items()},
    }


def summary(data: Data) -> list[Row]:
    """The one printed figure."""
    p, widths = data["printed"], [case["width"] for case in data["cases"].values()]
    return [
        Row(
            what="fire extinguishers: 50 m from the docking station",
            place=p["place"],
            printed=f"{p['time']:g} s",
            ours=f"needs a corridor {min(widths):.2f} m wide (1 m/s²) or {max(widths):.1f} m (0.1 m/s²)",
            note=f"plausible for a fast robot; a Create takes {data['interface']['least_time']:g} s or more",
        )
    ]


def section(data: Data) -> str:
    """What the page says."""
    p, interface = data["printed"], data["interface"]
    widest = max(data["cases"].values(), key=lambda case: case["width"])
    rows, hall = [], []
    for name, case in data["cases"].items():
        rows.append(
            (
                name,
                f"{case['acceleration']:g} m/s²",
                f"{case['speed']:.4f} m/s",
                f"{case['clearance']:.3f} m",
                f"{case['width']:.2f} m",
                f"{case['planned']:.3f} s",
                f"{case['door_speed']:.3f} m/s",
            )
        )
        way = case["warehouse"]
        mean = way["length"] / way["time"]
        hall.append(
            (
                f"{case['acceleration']:g} m/s²",
                f"{way['length']:.1f} m",
                f"{way['time']:.1f} s",
                f"{mean:.3f} m/s",
                "yes" if mean >= data["mean_speed"] else "no",
            )
        )
    return "\n".join(
        [
            "## Fire extinguishers: 50 m in 60 s",
            "",
            'Manor 2015, Sec. 3.7, on an experiment in the ground floor of an office building: "the iRobot'
            " was able to"
            ' reach sites located 50 meters away from its start point within 60 seconds". No map, path or'
            f" speed is given. This is a plausibility check: {p['distance']:g} m in {p['time']:g} s are"
            f" {data['mean_speed']:.3f} m/s on average, more where the way bends. From rest to rest with"
            " acceleration a both ways and cruising speed v it takes L/v + v/a, and v needs the clearance"
            " v²/(2 a_b):",
            "",
            table(
                (
                    "limits",
                    "a = a_b",
                    "cruising speed",
                    "clearance",
                    "corridor at least",
                    "vc-method there",
                    f"speed in a door of {data['door']:g} m",
                ),
                rows,
            ),
            f"The robot is taken as {2.0 * data['radius']:g} m wide, as the Create. The planner's motion"
            f" along the middle of such a corridor takes the {p['time']:g} s that the formula says (slowed"
            " by three parts in a million at most, which keeps what is proven between samples).",
            "",
            "With 1 m/s² an ordinary corridor will do. With the 0.1 m/s² of Sec. 2.8 the answer is exactly"
            f" the top speed that the text names, {p['top_speed']:g} m/s, but safe braking from it takes"
            f" {widest['clearance']:.3g} m: no office corridor is that wide. So, unless it led through"
            " halls, the run either had stronger brakes than Sec. 2.8, or did not keep the braking distance"
            " of Chapter 3.",
            "",
            "A **contradiction** remains with the robot itself: the Create's drive commands end at"
            f" {interface['speed']:g} m/s a wheel (iRobot, Create Open Interface, commands 137 and 145),"
            " with which"
            f' {p["distance"]:g} m take at least {interface["least_time"]:g} s. The text gives "about 1'
            ' m/sec".',
            "",
            "Our warehouse with this robot, at most 1 m/s fast, from rest to rest:",
            "",
            table(
                ("a = a_b", "path", "vc-method", "mean speed", f"fast enough ({data['mean_speed']:.3f} m/s)"),
                hall,
            ),
            "A building of such corridors supports the printed figure with the brakes of Sec. 3.7 and not"
            " with those of Sec. 2.8.",
        ]
    )
