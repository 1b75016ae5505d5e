"""Field sets as a stage: fields fitted to the planned route, its motion under them, and their files.

The files are inputs to a safety case, which has much more to say: the scanner's resolution, response and
mounting, the brakes' wear, who may be in the way.
"""

from __future__ import annotations

import csv
import io
import json
from dataclasses import dataclass, replace
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vnav_drake.collocation import Effort, plan_full
from vnav_drake.convex import ConvexPieces
from vnav_drake.field_fitting import FieldRun, drive_fields, fit_fields, path_along, with_fields
from vnav_drake.plan import Path, Plan, Trajectory
from vnav_drake.problem import Problem
from vnav_drake.scenario import Scenario
from vnav_drake.zones.catalogue import field_set as given_fields
from vnav_drake.zones.field_set import TANGENTS, FieldSet
from vnav_drake.zones.touch import into_body, separation

Array = NDArray[np.float64]
Index = NDArray[np.int64]

FILE, TABLE = "fields.json", "fields.csv"
SCHEMA = 1  # of fields.json
STATEMENT = "Inputs to a safety case, not a safety case."
TYPE = "field_set"
COLUMNS = (
    *("case", "v_max_m_per_s", "ahead", "behind", "to_each_side", "braking_distance", "reaction_distance"),
    *("margin", "side_supplement", "least_separation", "range", "watched_for_s", "polygon"),
)


@dataclass(frozen=True, kw_only=True)
class FieldsStage:
    """A plan under a field set."""

    plan: Plan  # retimed
    field_set: FieldSet
    problem: Problem  # with the field set as its zone
    run: FieldRun
    base: dict[str, Any]  # type and parameters of the base zone, as the scenario gives them
    about: dict[str, Any]  # for result.json


def asks_for_fields(scenario: Scenario) -> bool:
    """Whether the scenario's zone is a field set."""
    return scenario.spec.braking.zone.type == TYPE


class FieldPlanner:
    """Plans again under the fields of a stage, and knows which stage each plan is from."""

    def __init__(self, scenario: Scenario, first: FieldsStage) -> None:
        self._scenario = scenario
        self._stages = [first]

    def again(self, problem: Problem, path: Path, effort: Effort) -> Plan:
        """The motion near a path within the problem's limits. Raises PlanningError where there is none."""
        base = plan_full(problem, path, effort=effort)
        stage = run_fields(self._scenario, base, problem=problem, field_set=self._stages[0].field_set)
        self._stages.append(stage)
        return stage.plan

    def of(self, plan: Plan) -> FieldsStage:
        """The stage whose motion this is; the first where none is."""
        found = [stage for stage in self._stages if stage.plan.trajectory is plan.trajectory]
        return found[0] if found else self._stages[0]


def run_fields(
    scenario: Scenario, plan: Plan, *, problem: Problem | None = None, field_set: FieldSet | None = None
) -> FieldsStage:
    """Fit or take the fields the scenario asks for and drive the planned path under them.

    Parameters
    ----------
    plan : of the full model, made with the base zone.
    problem : the scenario's, or with other limits of the robot. field_set : those known already.

    Raises
    ------
    PlanningError : a field is not free where it must be, or there are no fields to be had.
    """
    parameters = scenario.spec.braking.zone.parameters
    problem = scenario.problem if problem is None else problem
    robot = problem.robot
    reserve = robot.reserved_lateral_acceleration() if problem.friction_reserve else None
    if field_set is None:
        field_set = given_fields(parameters, problem.braking, robot.radius, reserve)
    if field_set is None:
        field_set = fit_fields(problem, plan.trajectory, parameters["count"])
    run = drive_fields(problem, plan.trajectory, field_set, dwell=parameters["dwell"])
    about = {
        "count": len(field_set.max_speeds),
        "fitted": field_set.polygons is None,
        "max_speeds": list(field_set.max_speeds),
        "cost": run.trajectory.travel_time / plan.travel_time - 1.0,
        "base_time": plan.travel_time,  # [s]
        "switches": len(run.switches),
        "shortest_stay": shortest_stay(run),
        "scanner_range": field_set.scanner_range(),
    }
    retimed = replace(
        plan,
        trajectory=run.trajectory,
        path=path_along(run.trajectory),
        details={**plan.details, "fields": dict(about)},
    )
    return FieldsStage(
        plan=retimed,
        field_set=field_set,
        problem=with_fields(problem, field_set),
        run=run,
        base=parameters["base"],
        about=about,
    )


def shortest_stay(run: FieldRun) -> float:
    """The shortest time [s] between two switches; that of the whole motion where there are fewer than two."""
    t = run.trajectory.t[run.switches]
    return float(np.diff(t).min()) if len(t) > 1 else run.trajectory.travel_time


def least_separations(problem: Problem, run: FieldRun) -> list[float | None]:
    """How near the field that is watched comes to anything at the rows of the motion, by case [m].

    None for a field that is never watched.
    """
    pieces = ConvexPieces.of(problem.world)
    motion, fields = run.trajectory, run.field_set
    found: list[float | None] = []
    for case, speed in enumerate(fields.max_speeds):
        watched = run.case == case
        node = np.flatnonzero(
            watched | np.concatenate([[False], watched[:-1]])
        )  # its rows begin and end there
        if len(node) == 0:
            found.append(None)
            continue
        extent = float(np.hypot(*fields.polygon(case).T).max())
        reach = np.maximum(problem.world.distance(np.column_stack([motion.x, motion.y])[node]), 0.0) + extent
        of, piece = pieces.near(np.column_stack([motion.x, motion.y])[node], reach)
        found.append(_least(fields, pieces, motion, node[of], piece, speed))
    return found


def _least(
    fields: FieldSet, pieces: ConvexPieces, motion: Trajectory, row: Index, piece: Index, speed: float
) -> float:
    corners = into_body(pieces.corners[piece], motion.x[row], motion.y[row], motion.heading[row])
    return float(separation(fields, corners, np.full(len(row), speed)).gap.min())


def write_fields(folder: FilePath, stage: FieldsStage) -> None:
    """Write fields.json and fields.csv into the folder."""
    told = as_data(stage)
    text = json.dumps(told, indent=1, allow_nan=False) + "\n"
    (folder / FILE).write_text(text, encoding="utf-8")
    (folder / TABLE).write_text(_table(stage, told), encoding="utf-8")


def as_data(stage: FieldsStage) -> dict[str, Any]:
    """fields.json: fields from the least to the largest, where each is watched, what a scanner must see."""
    run, fields = stage.run, stage.field_set
    motion, law = run.trajectory, fields.law
    s = motion.arc_length
    first = np.concatenate([[0], run.switches])
    least = least_separations(stage.problem, run)
    stay = np.diff(motion.t, append=motion.t[-1])
    return {
        "schema": SCHEMA,
        "statement": STATEMENT,
        "base": stage.base,
        "fitted": fields.polygons is None,
        "polygons": "the fields themselves"
        if fields.polygons is not None
        else f"around the fields, of {TANGENTS} tangents and more: the fields lie within",
        "supplements": {
            "reaction_time": law.reaction_time,  # [s]
            "max_braking": law.max_braking,  # [m/s^2]
            "margin": law.margin,  # [m]
            "side": float(getattr(fields.base, "side", 0.0)),  # [m]
        },
        "cases": [
            {
                "case": case + 1,
                "max_speed": speed,
                "polygon": fields.polygon(case).tolist(),
                "watched_for": float(stay[run.case == case].sum()),  # [s]
            }
            for case, speed in enumerate(fields.max_speeds)
        ],
        "chosen_by": "place" if run.dwell > 0.0 else "speed",
        "dwell": run.dwell,  # [s]
        "switches": [
            {"s": s[i], "t": motion.t[i], "x": motion.x[i], "y": motion.y[i], "case": int(run.case[i]) + 1}
            for i in first.tolist()
        ],
        "least_separation": least,  # [m], at the rows
        "scanner_range": fields.scanner_range(),  # [m]
    }


def _table(stage: FieldsStage, told: dict[str, Any]) -> str:
    """fields.csv: the same for people, one row a field, lengths in m."""
    extra, lines = told["supplements"], io.StringIO()
    lines.write(f"# {STATEMENT} Lengths in m, x ahead of the robot's centre, y to its left.\n")
    writer = csv.writer(lines, lineterminator="\n")
    writer.writerow(COLUMNS)
    for case, least in zip(told["cases"], told["least_separation"], strict=True):
        x, y = np.asarray(case["polygon"]).T
        speed = case["max_speed"]
        figures = [
            *(x.max(), -x.min(), np.abs(y).max()),
            *(speed**2 / (2.0 * extra["max_braking"]), speed * extra["reaction_time"]),
            *(extra["margin"], extra["side"]),
        ]
        corners = "; ".join(f"{a:.5f} {b:.5f}" for a, b in zip(x, y, strict=True))
        nearest = "" if least is None else f"{least:.4f}"
        reach, seconds = f"{np.hypot(x, y).max():.4f}", f"{case['watched_for']:.2f}"
        written = [f"{value:.4f}" for value in (speed, *figures)]
        writer.writerow([case["case"], *written, nearest, reach, seconds, corners])
    return lines.getvalue()
