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
CREATE = ROOT / "scenarios" / "create_three_rectangles.yaml"
# Sec. 3.7: "able to reach sites located 50 meters away from its start point within 60 seconds"
DISTANCE, TIME = 50.0, 60.0  # [m], [s]
TOP_SPEED = 1.0  # [m/s], "maximal speeds of about 1 m/sec" (Sec. 3.7)
INTERFACE_SPEED = 0.5  # [m/s]: iRobot, "Create Open Interface" (2006), commands 137 and 145, -500 to 500 mm/s
ACCELERATIONS = {"warehouse and office floor, Sec. 3.7": 1.0, "Create, Sec. 2.8": 0.1}  # [m/s^2], both ways
DOOR = 0.9  # [m], an ordinary door; ours
OFFICE = 3.0  # [m], the widest that we call an ordinary corridor; ours
EXACT = 1e-6  # of a speed, far above rounding


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
    """The Create of Sec. 2.8, with other brakes and drive [m/s^2], and a greatest speed [m/s]."""
    create = load_scenario(CREATE).problem.robot
    return dataclasses.replace(
        create, max_braking=acceleration, max_acceleration=acceleration, max_speed=max_speed
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
    radius = robot(acceleration).radius
    width = 2.0 * (clearance + radius)
    door = math.sqrt(2.0 * acceleration * (0.5 * DOOR - radius))
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
        "radius": robot(min(ACCELERATIONS.values())).radius,
        "ordinary": OFFICE,
        "door": DOOR,
        "cases": {name: _case(a) for name, a in ACCELERATIONS.items()},
    }


def summary(data: Data) -> list[Row]:
    """The one printed figure."""
    p, cases = data["printed"], sorted(data["cases"].values(), key=lambda case: case["width"])
    widths = " or ".join(f"{case['width']:.2f} m ({case['acceleration']:g} m/s²)" for case in cases)
    least = data["interface"]["least_time"]
    possible = [case for case in cases if case["width"] <= data["ordinary"]]
    note = "plausible for a fast robot" if possible else "no ordinary corridor is as wide"
    note += f"; a Create takes {least:g} s or more" if least > p["time"] else "; a Create can keep to it"
    return [
        Row(
            what=f"fire extinguishers: {p['distance']:g} m from the docking station",
            place=p["place"],
            printed=f"{p['time']:g} s",
            ours=f"needs a corridor at least as wide as {widths}",
            note=note,
        )
    ]


def _widths(data: Data) -> str:
    """What kind of corridor each acceleration asks for."""
    top, texts = data["printed"]["top_speed"], []
    for name, case in data["cases"].items():
        text = f"With {case['acceleration']:g} m/s² ({name})"
        if case["width"] <= data["ordinary"]:
            texts.append(f"{text} an ordinary corridor will do.")
            continue
        if abs(case["speed"] / top - 1.0) < EXACT:
            text += f" the answer is exactly the top speed that the text names, {top:g} m/s, but safe braking"
        else:
            text += f" it takes {case['speed']:.3g} m/s, and safe braking"
        texts.append(
            f"{text} from it takes {case['clearance']:.3g} m: no office corridor is that wide. So, unless it"
            " led through halls, the run either had stronger brakes, or did not keep the braking distance"
            " of Chapter 3."
        )
    return " ".join(texts)


def _at_the_wheels(data: Data) -> str:
    """Whether the Create's drive commands allow the run."""
    p, interface = data["printed"], data["interface"]
    facts = (
        f"the Create's drive commands end at {interface['speed']:g} m/s a wheel (iRobot, Create Open"
        f" Interface, commands 137 and 145), with which {p['distance']:g} m take at least"
        f' {interface["least_time"]:g} s. The text gives "about {p["top_speed"]:g} m/sec".'
    )
    if interface["least_time"] > p["time"]:
        return f"A **contradiction** remains with the robot itself: {facts}"
    return f"The robot itself allows it: {facts}"


def _in_halls(data: Data) -> str:
    """What the warehouse says of the printed figure."""
    enough: dict[bool, list[str]] = {True: [], False: []}
    for case in data["cases"].values():
        way = case["warehouse"]
        enough[way["length"] / way["time"] >= data["mean_speed"]].append(f"{case['acceleration']:g} m/s²")
    parts = [
        f"{verb} {' and '.join(enough[fast])}"
        for fast, verb in ((True, "supports the printed figure with"), (False, "does not support it with"))
        if enough[fast]
    ]
    return f"A building of such corridors {', and '.join(parts)}."


def section(data: Data) -> str:
    """What the page says."""
    p = data["printed"]
    slow = max(case["planned"] / p["time"] - 1.0 for case in data["cases"].values())
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
            f"The robot is the Create of Sec. 2.8, {2.0 * data['radius']:g} m wide. The planner's motion"
            f" along the middle of such a corridor takes the {p['time']:g} s that the formula says, and"
            f" {1e6 * slow:.1f} parts in a million more, which keeps what is proven between samples.",
            "",
            _widths(data),
            "",
            _at_the_wheels(data),
            "",
            f"Our warehouse with this robot, at most {p['top_speed']:g} m/s fast, from rest to rest:",
            "",
            table(
                ("a = a_b", "path", "vc-method", "mean speed", f"fast enough ({data['mean_speed']:.3f} m/s)"),
                hall,
            ),
            _in_halls(data),
        ]
    )
