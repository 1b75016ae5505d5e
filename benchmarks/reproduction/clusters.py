"""Table 2.1 of Manor 2015: the vc-method against the dynamic window approach (DWA), Sec. 2.7.2.

Fig. 2.16 cannot be read: the three maps are scenarios laid out in the manner of the text, so that times come
near the printed ones. What is measured beyond the table is whether the outcome hangs on how DWA is read.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from benchmarks.figures import draw_room
from benchmarks.reproduction.page import ROOT, Data, Row, table
from verify.report.palette import method
from vnav_drake.dwa import DwaRun, Objective, plan_dwa
from vnav_drake.dwa.window import Choices
from vnav_drake.plan import Trajectory
from vnav_drake.problem import Problem
from vnav_drake.scenario import load_scenario
from vnav_drake.vc_method import VcResult, vc_method

Array = NDArray[np.float64]

PLACE = "Table 2.1"
# Scenario: times [s] and lengths [m] of the vc-method and of DWA, as printed.
PRINTED = {
    "obstacle_cluster_1": {"vc_method": (24.0, 4.85), "dwa": (39.0, 4.37)},
    "obstacle_cluster_2": {"vc_method": (31.0, 6.25), "dwa": (52.0, 2.63)},
    "city_blocks": {"vc_method": (24.0, 5.04), "dwa": (46.0, 4.38)},
}
EXAMPLES = dict(zip(PRINTED, ("i", "ii", "iii"), strict=True))
OTHERS = ("warehouse", "four_point_room")  # not laid out for this comparison
UNIT = (1.0, 1.0, 1.0)
# How the text may be read, and how much hangs on the weights: weights, step [s] (None: the window).
SETTINGS: tuple[tuple[tuple[float, float, float], float | None], ...] = (
    (UNIT, None),
    (UNIT, 0.5),
    (UNIT, 0.25),
    (UNIT, 0.1),
    ((2.0, 1.0, 1.0), None),
    ((1.0, 2.0, 1.0), None),
    ((1.0, 1.0, 2.0), None),
    ((4.0, 1.0, 1.0), None),
    ((1.0, 4.0, 1.0), None),
    ((1.0, 1.0, 4.0), None),
)
WINDOW = 1.0  # [s], Sec. 2.7.2
LOOKS = 17  # along a motion of DWA
SAMPLES = 201  # of a path and of a speed profile
NEAR_LENGTH = 0.1  # relative: printed lengths that ours come near
NAMES = {"vc_method": "vc-method", "dwa": "DWA"}


class LeastClearance(Objective):
    """dist as the least clearance along the motion and its stop, over the greatest in the room."""

    def freedom(self, problem: Problem, options: Choices) -> Array:
        """At LOOKS samples; (n, k)."""
        part = np.linspace(0.0, 1.0, LOOKS)[:, None, None]
        points, _ = options.arcs.at(part * (options.moving + options.stopping))
        greatest = float(problem.braking.distance(self.top_speed)) - problem.braking.margin
        return np.asarray(problem.clearance(points).min(axis=0) / greatest)


def problem_of(name: str) -> Problem:
    """The question of a scenario of ours."""
    return load_scenario(ROOT / "scenarios" / f"{name}.yaml").problem


def outcome(run: DwaRun) -> Data:
    """What came of a run of DWA."""
    found: Data = {"reached": run.reached, "time": run.travel_time, "length": run.length}
    if run.stuck is not None:
        found["stuck"] = run.stuck.reason
    return found


def _drawn(trajectory: Trajectory) -> Data:
    """Path [m] and speed [m/s] at even parts of the length, and the least clearance of the rows [m]."""
    along = trajectory.arc_length
    part = np.linspace(0.0, 1.0, SAMPLES)
    # the time at each length: v^2 is linear in the length between rows
    row = np.clip(np.searchsorted(along, part * along[-1], side="right") - 1, 0, len(along) - 2)
    left = part * along[-1] - along[row]
    speed = np.sqrt(np.maximum(np.square(trajectory.v[row]) + 2.0 * trajectory.a[row] * left, 0.0))
    mean = 0.5 * (trajectory.v[row] + speed)
    time = trajectory.t[row] + np.divide(left, mean, out=np.zeros_like(left), where=mean > 0.0)
    x, y, *_ = trajectory.at(time)
    return {
        "path": np.round(np.column_stack([x, y]), 4).tolist(),
        "speed": np.round(speed, 4).tolist(),
        "least_clearance": float(trajectory.clearance.min()),
    }


def _vc_method(result: VcResult) -> Data:
    motion = result.realisation.trajectory
    return {
        "time": motion.travel_time,
        "length": motion.length,
        "shortfalls": list(result.realisation.shortfalls),
        "same_route_by_published_cost": result.same_route,
        **_drawn(motion),
    }


def _settings(problem: Problem) -> list[DwaRun]:
    """DWA as in SETTINGS, then with the other reading of its clearance."""
    runs = [plan_dwa(problem, weights=w, window=WINDOW, step=s) for w, s in SETTINGS]
    return [*runs, plan_dwa(problem, weights=UNIT, window=WINDOW, objective=LeastClearance)]


def measure() -> Data:
    """Both methods on the three maps, and DWA with other settings, there and on two maps more."""
    examples: Data = {}
    for name, printed in PRINTED.items():
        problem = problem_of(name)
        runs = _settings(problem)
        examples[name] = {
            "printed": {key: {"time": t, "length": s} for key, (t, s) in printed.items()},
            "vc_method": _vc_method(vc_method(problem)),
            "dwa": {**outcome(runs[0]), "decisions": runs[0].decisions, **_drawn(runs[0].trajectory)},
            "settings": [outcome(run) for run in runs],
        }
    others: Data = {}
    for name in OTHERS:
        problem = problem_of(name)
        motion = vc_method(problem).realisation.trajectory
        others[name] = {
            "vc_method": {"time": motion.travel_time, "length": motion.length},
            "settings": [outcome(run) for run in _settings(problem)],
        }
    settings = [{"weights": list(w), "step": WINDOW if s is None else s} for w, s in SETTINGS]
    return {
        "place": PLACE,
        "window": WINDOW,
        "settings": [*settings, {"weights": list(UNIT), "step": WINDOW, "clearance": True}],
        "examples": examples,
        "others": others,
    }


def ratio(row: Data) -> float:
    """Time of the vc-method over that of DWA."""
    return float(row["vc_method"]["time"] / row["dwa"]["time"])


def _ratio(row: Data) -> str:
    """The ratio, where there is one: a run that got stuck has no time to the target."""
    return f"{ratio(row):.2f}" if row["dwa"].get("reached", True) else "none"


def summary(data: Data) -> list[Row]:
    """Times of the three examples."""
    return [
        Row(
            what=f"example ({EXAMPLES[name]}), time of the vc-method / of DWA",
            place=data["place"],
            printed=f"{row['printed']['vc_method']['time']:g} s / {row['printed']['dwa']['time']:g} s"
            f" = {ratio(row['printed']):.2f}",
            ours=f"{row['vc_method']['time']:.1f} s / {_told(row['dwa'])} = {ratio(row):.2f}"
            if row["dwa"]["reached"]
            else f"{row['vc_method']['time']:.1f} s / {_told(row['dwa'])}",
            note="reconstruction, laid out so that times come near" + _lengths_apart(row),
        )
        for name, row in data["examples"].items()
    ]


def _lengths_apart(row: Data) -> str:
    """Whose way has another length than printed, as a clause; empty when both come within a tenth."""
    apart = [
        called
        for key, called in NAMES.items()
        if abs(row[key]["length"] / row["printed"][key]["length"] - 1.0) > NEAR_LENGTH
    ]
    return f"; not so the length of the way of {' and '.join(apart)}" if apart else ""


def _told(found: Data) -> str:
    return f"{found['time']:.1f} s" if found["reached"] else f"stuck ({found['stuck'].replace('_', ' ')})"


def _comparison(data: Data) -> str:
    rows = []
    for name, row in data["examples"].items():
        printed = row["printed"]
        for key, called in NAMES.items():
            ours = row[key]
            rows.append(
                (
                    f"({EXAMPLES[name]}) `{name}`" if key == "vc_method" else "",
                    called,
                    f"{printed[key]['time']:g} s",
                    _told({"reached": True, **ours}),
                    f"{printed[key]['length']:.2f} m",
                    f"{ours['length']:.2f} m",
                    f"{100.0 * ours['least_clearance']:.1f} cm",
                    f"{ratio(printed):.2f} / {_ratio(row)}" if key == "vc_method" else "",
                )
            )
    head = ("example", "method", "time printed", "ours", "length printed", "ours", "least clearance, ours")
    return table((*head, "time vc / DWA: printed / ours"), rows)


def _sensitivity(data: Data) -> str:
    rows = {**data["examples"], **data["others"]}
    head = ["weights: heading, dist, speed", "step"]
    head += [f"({EXAMPLES[name]})" if name in EXAMPLES else f"`{name}`" for name in rows]
    lines = [["**vc-method**", "", *(_way(row["vc_method"]) for row in rows.values())]]
    for k, setting in enumerate(data["settings"]):
        called = ", ".join(f"{w:g}" for w in setting["weights"])
        called += "; *clearance*" if setting.get("clearance") else ""
        ways = [_way(row["settings"][k]) for row in rows.values()]
        lines.append([called, f"{setting['step']:g} s", *ways])
    return table(head, lines)


def _way(found: Data) -> str:
    told = _told({"reached": True, **found})
    return f"{told}, {found['length']:.2f} m" if found.get("reached", True) else told


def section(data: Data) -> str:
    """What the page says."""
    examples = data["examples"]
    short = sorted({s for row in examples.values() for s in row["vc_method"]["shortfalls"]})
    other = [EXAMPLES[n] for n, r in examples.items() if not r["vc_method"]["same_route_by_published_cost"]]
    lines = [
        "## The vc-method against the dynamic window approach",
        "",
        "Manor 2015, Sec. 2.7.2: a cluster of obstacles in a rectangular room with two targets, and city"
        " blocks. **Reconstructions**: Fig. 2.16 cannot be read. Layouts follow the text, with the robot of"
        " Sec. 2.8 (0.1 m/s² both ways, turning radius 0.3 m), from rest to rest: in (i) DWA passes between"
        " obstacles, in (ii) it takes a narrow passage to a target in sight, in (iii) a narrow one between"
        " blocks, while the vc-method goes round. The widths of passages and corridors were chosen so that"
        " times come near those printed, so that they do confirms nothing.",
        "",
        _comparison(data),
        _verdict(examples),
        "",
    ]
    for name in examples:
        file = f"images/reproduction_{_picture(name)}.svg"
        lines += [f"![Example ({EXAMPLES[name]}): map and speeds]({file})", ""]
    lines += [
        "Speed over arc length as a part of the whole, in the manner of Fig. 2.17.",
        "",
        "### Does the outcome hang on how DWA is read?",
        "",
        'The text gives a "time-window of one second", within which "the robot moves along a circular arc",'
        f" and unit weights. Here the robot chooses an arc and a speed for {data['window']:g} s and keeps to"
        " it for so long (step); the other usual reading plans for the window and chooses again sooner. On"
        " our three maps the straight way to the target is free, which leaves little to decide; so two maps"
        " that were not laid out for this comparison stand beside them. The first row is the vc-method.",
        "",
        _sensitivity(data),
        _counted(data),
        "",
        "*Clearance*: the term dist as the least clearance along the motion, its stop included, over the"
        ' greatest in the room, as "the minimal distance to the surrounding obstacles" may be read too.'
        " Everywhere else it is the free way along the arc, as in Fox, Burgard and Thrun 1997.",
        "",
        "In one thing DWA is changed, in its favour: of a circle, half a turn counts as free way. A small"
        " circle meets no obstacle at all, so with unit weights it would be worth as much as the freest way,"
        " and the robot would turn in circles.",
        "",
        "By the published edge cost the vc-method takes "
        + (f"another route in ({'), ('.join(other)})" if other else "the same routes")
        + ". What its motions cannot meet: "
        + ("; ".join(short) if short else "nothing, every limit is kept")
        + ".",
    ]
    return "\n".join(lines)


def _verdict(examples: Data) -> str:
    slower = [n for n, r in examples.items() if r["dwa"]["reached"] and ratio(r) < 1.0]
    shorter = [n for n in slower if examples[n]["dwa"]["length"] < examples[n]["vc_method"]["length"]]
    if len(slower) < len(examples):
        rest = "), (".join(EXAMPLES[n] for n in examples if n not in slower)
        return f"DWA is not slower in ({rest}), against what is printed."
    crawl = [min(row["dwa"]["speed"][SAMPLES // 4 : -SAMPLES // 4]) for row in examples.values()]
    off = [(EXAMPLES[n], r["dwa"]["length"], r["printed"]["dwa"]["length"]) for n, r in examples.items()]
    far = ", ".join(f"({n}) {ours:.2f} m for {told:.2f} m" for n, ours, told in off if ours < 0.95 * told)
    return (
        "DWA is slower in all three, as printed"
        + (", on the shorter way each time" if len(shorter) == len(examples) else "")
        + ": in a passage of little clearance the braking condition holds the robot at"
        f" {100.0 * min(crawl):.0f} to {100.0 * max(crawl):.0f} cm/s, and DWA looks no farther than its"
        " window and the stop after it."
        + (f" Not reproduced is the length of DWA's way: {far}. Our gaps are straight." if far else "")
    )


def _counted(data: Data) -> str:
    """How the runs on all maps compare with the vc-method."""
    parts = []
    for rows, where in ((data["examples"], "our three maps"), (data["others"], "the two others")):
        runs = [(r["vc_method"]["time"], f) for r in rows.values() for f in r["settings"]]
        there = [(time, found) for time, found in runs if found["reached"]]
        faster = sum(found["time"] <= time for time, found in there)
        shares = [time / found["time"] for time, found in there]
        text = f"On {where} {len(there) or 'none'} of {len(runs)} runs reach the target"
        if shares:
            text += (
                f", {faster or 'none'} of them as fast as the vc-method; its time is {min(shares):.2f} to"
                f" {max(shares):.2f} of theirs"
            )
        parts.append(f"{text}.")
    return " ".join(parts)


def _picture(name: str) -> str:
    return f"clusters_{name}"


def figures(data: Data) -> dict[str, Figure]:
    """One for each example: both paths on the map, and their speeds."""
    return {_picture(name): _figure(name, row) for name, row in data["examples"].items()}


def _figure(name: str, row: Data) -> Figure:
    figure = Figure(figsize=(7.2, 3.1), layout="constrained")
    room, speed = figure.subplots(1, 2, width_ratios=(1.0, 1.1))
    draw_room(room, problem_of(name))
    room.set_ylabel("y [m]")
    part = np.linspace(0.0, 1.0, SAMPLES)
    for key, called in NAMES.items():
        look: Any = {"color": method(key).light, "lw": 1.8, "zorder": 4}
        room.plot(*np.array(row[key]["path"]).T, **look)
        speed.plot(part, 100.0 * np.array(row[key]["speed"]), **look)
        _name(speed, key, f"{called}, {_told({'reached': True, **row[key]})}", row[key]["speed"])
    top = 100.0 * max(max(row[key]["speed"]) for key in NAMES)
    speed.set(xlabel="arc length as a part of the whole", ylabel="speed [cm/s]", xlim=(0, 1))
    speed.set_ylim(0.0, 5.0 * math.ceil(1.1 * top / 5.0))
    return figure


def _name(axes: Axes, key: str, text: str, speed: list[float]) -> None:
    """Beside the middle of its curve."""
    k = SAMPLES // 2
    height = 100.0 * max(speed[k - 45 : k + 46])
    axes.annotate(
        text, (0.5, height), (0, 5), textcoords="offset points", ha="center", color=method(key).text
    )
