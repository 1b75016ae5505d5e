"""The warehouse of Manor 2015, Sec. 3.7: both printed times, in both readings of where the target is."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.optimize import brentq

from benchmarks.figures import BLUE, INK, ORANGE, draw_room
from benchmarks.reproduction.page import Data, Row, table
from benchmarks.reproduction.warehouse_map import GAPS, along_arcs, passage, problem, shortest_way
from vnav_drake.homotopy import class_of
from vnav_drake.problem import Problem
from vnav_drake.speed_graph import ClassOptimum, speed_graph
from vnav_drake.speed_profile import fastest_profile
from vnav_drake.vc_method import realise, vc_method
from vnav_drake.voronoi import VoronoiDiagram, build_diagram

# Sec. 3.7
PRINTED_BEST, PRINTED_SHORTEST = 31.2, 42.9  # [s]
PRINTED_HEIGHT = 30.0  # [m]
ROWS, RACK, GAP, CORRIDOR = 4, 5.0, 1.0, 4.0  # number, [m], [m], [m]
PRINTED_AXIS = 70.0  # [s], where the axis of Fig. 3.12 ends
FIT = 0.05  # of a printed time, within which ours is said to fit it; the classes lie farther apart
FIT_RATIO = 0.01  # of the printed ratio, which the rounding of its times makes uncertain by 0.3 %
CLASSES = {"right": 6, "left": 12}  # until the printed class is among them
HEIGHTS = (1.0, 8.0)  # [m], of starts in the right corridor among which one is fitted
SAMPLES = 241  # of a speed profile


def measure() -> Data:
    """Both readings, and the start with which the first printed time comes out."""
    height = fitted_height()
    return {
        "printed": {
            "best": PRINTED_BEST,
            "shortest": PRINTED_SHORTEST,
            "axis": PRINTED_AXIS,
            "height": PRINTED_HEIGHT,
            "rows": ROWS,
            "rack": RACK,
            "gap": GAP,
            "corridor": CORRIDOR,
            "place": "Sec. 3.7, Fig. 3.12",
        },
        "max_braking": problem().robot.max_braking,
        "radius": problem().robot.radius,
        "readings": {name: reading(name) for name in CLASSES},
        "fitted": {"start": [problem().start.position[0], height], **_times(height)},
    }


def reading(name: str) -> Data:
    """All that is computed with the target at one corner of O1."""
    asked = problem(name)
    diagram = build_diagram(asked.world, asked.robot.radius)
    result = speed_graph(asked, diagram, classes=CLASSES[name], with_published=False)
    best, short = result.classes[0], _printed_class(asked, diagram, name)
    vc = vc_method(asked, diagram)
    slow = realise(asked, along_arcs(asked, diagram, result.gates, short.name))
    way = shortest_way(asked)
    return {
        "start": list(asked.start.position),
        "target": list(asked.goal.position),
        "best": _optimum(asked, best),
        "shortest": _optimum(asked, short),
        "gaps": [passage(asked, a, b) for a, b in GAPS[name]],
        "shortest_way": {
            "name": class_of(result.gates, way),
            "length": float(np.hypot(*np.diff(way, axis=0).T).sum()),
        },
        "classes": [
            {"name": c.name, "time": c.travel_time, "length": c.length, "certified": c.certified}
            for c in result.classes
        ],
        "order_certain": result.certain,
        "vc_method": {
            "time": vc.realisation.trajectory.travel_time,
            "length": vc.realisation.path.length,
            "same_class": class_of(result.gates, vc.realisation.path) == best.name,
            "published_cost_time": vc.other.travel_time,
            "same_route": vc.same_route,
            "shortfalls": list(vc.realisation.shortfalls),
        },
        "vc_method_in_gaps": {"time": slow.trajectory.travel_time, "length": slow.path.length},
    }


def _printed_class(asked: Problem, diagram: VoronoiDiagram, name: str) -> ClassOptimum:
    tokens = tuple(f"{a}/{b}" for a, b in GAPS[name])
    return speed_graph(asked, diagram, classes=1, through=tokens, with_published=False).classes[0]


def _optimum(asked: Problem, found: ClassOptimum) -> Data:
    motion = fastest_profile(asked, found.path, model="variational")
    t = np.linspace(0.0, motion.travel_time, SAMPLES)
    x, y, _, _ = found.path.at(np.linspace(0.0, found.path.length, SAMPLES))
    return {
        "name": found.name,
        "time": found.travel_time,
        "bound": found.optimality_bound,
        "certified": found.certified,
        "length": found.length,
        "profile": {"t": np.round(t, 6).tolist(), "speed": np.round(motion.at(t)[3], 6).tolist()},
        "points": np.round(np.column_stack([x, y]), 4).tolist(),
    }


def _times(height: float) -> dict[str, float]:
    """Optima [s] of both classes with the target on the right and the start at another height [m]."""
    asked = problem("right", (problem().start.position[0], height))
    diagram = build_diagram(asked.world, asked.robot.radius)
    best = speed_graph(asked, diagram, classes=1, with_published=False).classes[0]
    return {"best": best.travel_time, "shortest": _printed_class(asked, diagram, "right").travel_time}


def fitted_height() -> float:
    """Height [m] of the start in the right corridor from which the fastest class takes the printed time."""
    return float(brentq(lambda h: _times(float(h))["best"] - PRINTED_BEST, *HEIGHTS, xtol=1e-4))


def least_time(data: Data) -> float:
    """[s], that any path of the printed class spends in the gaps of a reading."""
    return math.fsum(gap["least_time"] for gap in data["gaps"])


def summary(data: Data) -> list[Row]:
    """Both times and the height."""
    printed, right, left = data["printed"], data["readings"]["right"], data["readings"]["left"]
    corners = "target at the lower right corner of O1 (at the lower left)"
    return [
        Row(
            what="warehouse, fastest class",
            place=printed["place"],
            printed=f"{printed['best']} s",
            ours=f"{right['best']['time']:.2f} s ({left['best']['time']:.4f} s)",
            note=corners,
        ),
        Row(
            what="warehouse, class of the shortest path",
            place=printed["place"],
            printed=f"{printed['shortest']} s",
            ours=f"{right['shortest']['time']:.2f} s ({left['shortest']['time']:.2f} s)",
            note=f"the same; at the lower left less than {least_time(left):.1f} s is impossible",
        ),
        Row(
            what="warehouse, height of the hall",
            place="Sec. 3.7",
            printed=f"{printed['height']:g} m",
            ours=f"{_height(data):g} m",
            note="contradiction: the printed parts add up to ours"
            if _height(data) != printed["height"]
            else "agrees",
        ),
    ]


def _height(data: Data) -> float:
    p = data["printed"]
    return float(p["rows"] * p["rack"] + (p["rows"] - 1) * p["gap"] + 2.0 * p["corridor"])


def section(data: Data) -> str:
    """What the page says."""
    return "\n".join(
        [
            "## Warehouse: the long way is the fast one",
            "",
            'Manor 2015, Sec. 3.7: eight racks, a robot of 0.8 m with a_b = 1 m/s², a start "at the'
            ' delivery counter" in the lower right corner and a target "at the lower corner of the storage'
            ' rack O1". The geometrically shortest path runs between O4 and O6, between O3 and O4, "and'
            ' finally reaches" the target "while passing between O1 and O3". A rack has two lower'
            " corners. With the target at the right one the path ends at the mouth of the gap between O1"
            " and O3; at the left one (as in `scenarios/warehouse.yaml`) it goes through it. Both are"
            " **reconstructions** in these two points alone.",
            "",
            "![Both readings](images/reproduction_warehouse.svg)",
            "",
            table(("", "printed", "target right", "target left"), _rows(data)),
            *_verdict(data),
            "",
            *_proofs(data),
            "",
            _on_vc(data["readings"]["left"]["vc_method"]),
        ]
    )


def _rows(data: Data) -> list[tuple[str, str, str, str]]:
    printed = data["printed"]
    both = [data["readings"][name] for name in ("right", "left")]

    def row(what: str, value: str, ours: Any) -> tuple[str, str, str, str]:
        return (what, value, ours(both[0]), ours(both[1]))

    def yes(reading: Data) -> str:
        way, short = reading["shortest_way"], reading["shortest"]["name"]
        return f"{'yes' if way['name'] == short else 'no, ' + way['name']} ({way['length']:.2f} m)"

    return [
        row("target", "", lambda r: f"({r['target'][0]:g}, {r['target'][1]:g})"),
        row("fastest class, optimum", f"{printed['best']} s", lambda r: f"{r['best']['time']:.4f} s"),
        row("printed class, optimum", f"{printed['shortest']} s", lambda r: f"{r['shortest']['time']:.4f} s"),
        row(
            "ratio of the two",
            f"{printed['shortest'] / printed['best']:.3f}",
            lambda r: f"{r['shortest']['time'] / r['best']['time']:.3f}",
        ),
        row("least time in the gaps of the printed class", "", lambda r: f"{least_time(r):.2f} s"),
        row("the printed class is the shortest", "yes", yes),
        row("vc-method's motion", "", lambda r: f"{r['vc_method']['time']:.4f} s"),
        row(
            "above the optimum",
            "",
            lambda r: (
                _percent(r["vc_method"]["time"], r["best"]["time"])
                + (", same class" if r["vc_method"]["same_class"] else ", another class")
            ),
        ),
        row(
            "vc-method's motion in the printed class", "", lambda r: f"{r['vc_method_in_gaps']['time']:.4f} s"
        ),
    ]


def _verdict(data: Data) -> list[str]:
    printed, fitted = data["printed"], data["fitted"]
    right, left = data["readings"]["right"], data["readings"]["left"]
    fits = max(_off(right, printed).values()) <= FIT
    times = [right[key]["time"] for key in ("best", "shortest")]
    miss = 100.0 * abs(fitted["shortest"] / printed["shortest"] - 1.0)
    text = [
        f"**The printed times {'fit' if fits else 'do not fit'} a target at the lower right corner.**",
        "With the start of our scenario",
        _how_near(right, printed) + ".",
        _which_is_shortest(right, left),
        f"The fastest one there is of the class {right['best']['name']}.",
    ]
    if fits:
        text.append("The reading was chosen for this agreement; no number was fitted.")
    text.append(
        "With the start moved along the middle of its corridor to"
        f" ({fitted['start'][0]:g}, {fitted['start'][1]:.2f}) the first time is {fitted['best']:.2f} s, and"
        f" the second {fitted['shortest']:.2f} s, {miss:.1f} % from what is printed."
    )
    if max(times) < printed["axis"]:
        text.append(
            f"What does not fit: the axis of Fig. 3.12 is labelled up to {printed['axis']:g} s, and neither"
            " motion takes that long."
        )
    return [" ".join(text), "", _on_the_left(left, printed)]


def _off(reading: Data, printed: Data) -> dict[str, float]:
    """How far both times are from those printed, as a part of them, whatever the sign."""
    return {key: abs(reading[key]["time"] / printed[key] - 1.0) for key in ("best", "shortest")}


def _how_near(right: Data, printed: Data) -> str:
    off = _off(right, printed)
    worst = f"{100.0 * max(off.values()):.1f} %"
    ratio, wanted = right["shortest"]["time"] / right["best"]["time"], printed["shortest"] / printed["best"]
    if max(off.values()) <= FIT:
        near = f"both come out within {worst}"
    else:
        near = (
            f"the first comes out {100.0 * off['best']:.1f} % off and the second"
            f" {100.0 * off['shortest']:.1f} %"
        )
    same = abs(ratio / wanted - 1.0) <= FIT_RATIO
    told = "agrees" if same else f"is {ratio:.3f} for {wanted:.3f}"
    return f"{near}, and their ratio, which does not depend on a_b, {told}"


def _which_is_shortest(right: Data, left: Data) -> str:
    there, here = (r["shortest_way"]["name"] == r["shortest"]["name"] for r in (right, left))
    if there and not here:
        end = "is the shortest there, and is not with the target at the left"
    elif there:
        end = "is the shortest there, and with the target at the left too"
    elif here:
        end = "is not the shortest there, but is with the target at the left"
    else:
        end = "is not the shortest there, nor with the target at the left"
    return f"The path named as the shortest {end}."


def _on_the_left(left: Data, printed: Data) -> str:
    wanted = printed["shortest"]
    times = [c["time"] for c in left["classes"]]
    below, above = [t for t in times if t < wanted], [t for t in times if t >= wanted]
    near = [t for t in times if abs(t / wanted - 1.0) <= FIT]
    head = (
        f"{len(near)} of the classes found come within {100.0 * FIT:g} % of the printed time"
        if near
        else "no class found has the printed time"
    )
    certified = all(c["certified"] for c in left["classes"])
    return (
        f"With the target at the lower left corner {head}: {len(below)} take less than {wanted} s"
        + (f" ({', '.join(f'{t:.2f} s' for t in below)})" if below else "")
        + (f", the next one {above[0]:.2f} s" if above else "")
        + f". The optima are {'all' if certified else 'not all'} certified; their order"
        f" {'is' if left['order_certain'] else 'is not'} certain unless the graph overestimates a class far"
        " more than any that was refined."
    )


def _proofs(data: Data) -> list[str]:
    printed, left = data["printed"], data["readings"]["left"]
    gaps = left["gaps"]
    metres = math.fsum(gap["length"] for gap in gaps)
    speed = max(gap["speed"] for gap in gaps)
    exact = "√0.2 = " if math.isclose(speed, math.sqrt(0.2)) else ""
    rows, rack, gap, corridor = (printed[k] for k in ("rows", "rack", "gap", "corridor"))
    total = _height(data)
    wanted, least = printed["shortest"], {name: least_time(r) for name, r in data["readings"].items()}
    contradicts = total != printed["height"]
    if least["left"] > wanted:
        claim = f"**{wanted} s is impossible with the target at the left.**"
    else:
        claim = f"**{wanted} s is not ruled out by the gaps with the target at the left.**"
    return [
        f"**{'Contradiction' if contradicts else 'No contradiction'}: the height.** {rows} racks of"
        f" {rack:g} m, {rows - 1} gaps of {gap:g} m and 2"
        f" corridors of {corridor:g} m make {rows} · {rack:g} + {rows - 1} · {gap:g} + 2 · {corridor:g} ="
        f" {total:g} m; printed {printed['height']:g} m. Ours has {total:g} m.",
        "",
        f"{claim} *No path through all three gaps takes less than {least['left']:.1f} s.* Proof. Such a path"
        " runs through",
        "",
        table(
            ("gap between", "width", "length", "clearance at most", "speed at most", "time at least"),
            [
                (
                    g["between"],
                    f"{g['width']:g} m",
                    f"{g['length']:g} m",
                    f"{g['clearance']:.2g} m",
                    f"{g['speed']:.4f} m/s",
                    f"{g['least_time']:.2f} s",
                )
                for g in gaps
            ],
        ),
        "Between parallel sides a width w apart no place is farther than w/2 from both, so the clearance of"
        f" a disc of radius {data['radius']:g} m is at most w/2 - {data['radius']:g} m there, and v² / (2"
        f" a_b) ≤ d allows {exact}{speed:.4f} m/s at most. The gaps are {metres:g} m long together and do"
        f" not overlap, and a path through a gap is no shorter than the gap. So it takes {metres:g} /"
        f" {speed:.4f} = {least['left']:.2f} s in the gaps alone. ∎ With the target at the right the"
        f" third gap is not passed, and the same argument gives {least['right']:.2f} s, which {wanted} s"
        f" {'respects' if wanted >= least['right'] else 'breaks too'}.",
    ]


def _on_vc(vc: Data) -> str:
    text = (
        f"The vc-method's motion in `scenarios/warehouse.yaml` ({vc['time']:.2f} s, {vc['length']:.2f} m)"
        " follows the Voronoi arcs with a_max = a_b = 1 m/s², its corners rounded."
    )
    if not vc["same_route"]:
        text += (
            " With the edge cost as published it would take another route, of"
            f" {vc['published_cost_time']:.2f} s along the arcs."
        )
    return text + (" It cannot meet: " + "; ".join(vc["shortfalls"]) + "." if vc["shortfalls"] else "")


def _percent(time: float, optimum: float) -> str:
    return f"{100.0 * (time / optimum - 1.0):.1f} %"


def figures(data: Data) -> dict[str, Figure]:
    """Both paths on the map, and their speed over time as in Fig. 3.12, for both readings."""
    figure = Figure(figsize=(7.4, 6.4), layout="constrained")
    axes = figure.subplots(2, 2, width_ratios=(1.0, 1.25))
    for (plan, speed), name in zip(axes, ("right", "left"), strict=True):
        found = data["readings"][name]
        _map(plan, problem(name), found)
        plan.set_title(f"target at the lower {name} corner of O1")
        _profiles(speed, found, data["printed"])
    return {"warehouse": figure}


def _map(axes: Axes, asked: Problem, found: Data) -> None:
    draw_room(axes, asked)
    axes.set_ylabel("y [m]")
    for obstacle in asked.world.obstacles:
        x, y = np.mean(np.array(obstacle.vertices), axis=0)
        axes.text(x, y, obstacle.name, ha="center", va="center", color=INK, fontsize=8)
    for key, colour in (("best", BLUE), ("shortest", ORANGE)):
        axes.plot(*np.array(found[key]["points"]).T, color=colour, lw=1.8, zorder=4)


def _profiles(axes: Axes, found: Data, printed: Data) -> None:
    for key, colour, height in (("best", BLUE, 2.95), ("shortest", ORANGE, 2.7)):
        t, v = (np.array(found[key]["profile"][k]) for k in ("t", "speed"))
        axes.plot(t, v, color=colour)
        axes.annotate(
            f"{found[key]['time']:.1f} s", (t[-1], v[-1]), (3, 3), textcoords="offset points", color=colour
        )
        axes.axvline(printed[key], color=colour, lw=0.8, ls=":")
        axes.text(printed[key], height, f" printed {printed[key]} s", color=colour, fontsize=8)
    least = least_time(found)
    axes.axvline(least, color=INK, lw=0.8, ls="--")
    axes.text(least, 2.45, f" gaps alone {least:.1f} s", color=INK, fontsize=8)
    axes.set(xlabel="time [s]", ylabel="speed [m/s]", xlim=(0, 80), ylim=(0, 3.2))
