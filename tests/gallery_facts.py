"""What holds of every scenario of the gallery: against exact or trusted travel times, and against itself."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gallery_runs import FEWEST, NAMES, STOPS, STUDIED

from systems.margins import MOST_FACTOR, OVER, analytic_demand, over_the_limit
from verify.evidence import read_result
from vnav_drake.plan import Trajectory
from vnav_drake.scenario import load_scenario

# Exact: cycloid along a wall (derived in test_collocation.py), straight line in the square-root plane,
# L / sqrt(2 a (W - rho)) with L = 30, W - rho = 1.5 (see the file). Intervals: a certified lower bound and
# the best class optimum known, from an earlier study with other methods, not derived in this repository.
EXACT = {
    "single_wall": 3.1956696464,
    "single_point": math.sqrt(2.0) * abs(np.sqrt(2.0 - 0.5j) - np.sqrt(-1.5 + 1.0j)),
    "corridor": 30.0 / math.sqrt(3.0),
}
OPTIMUM = {"warehouse": 25.4416876, "four_point_room": 7.317606429439}
GAPS = 25.0 / math.sqrt(0.2)  # no way through them is faster: derived in the file
TRUSTED = {
    "warehouse": (25.44124, 25.44170),
    "warehouse_gaps": (GAPS, 69.25),
    "four_point_room": (7.31757, 7.31761),
}
# Those whose optimum is no motion of the full robot, or whose optimum of one class was asked for: at rest the
# ends are not safe; friction and tip-over bind in bends; the corridors are faster than the gaps.
REFINED = {"warehouse_rest", "warehouse_slippery", "warehouse_tall", "warehouse_gaps"}
# From rest to rest, with the robot of Manor 2015, Sec. 2.8.
AT_REST = {
    "two_room_office",
    "obstacle_cluster_1",
    "obstacle_cluster_2",
    "city_blocks",
    "create_three_rectangles",
}
# Far from the limits at four times their speed: straight on, or by the robot of Manor 2015, Sec. 2.8, that
# brakes at 0.1 m/s^2, which is 16 times that then, of mu g = 5.886 m/s^2.
SLOW = {"corridor", *AT_REST}
# Relative: what the collocation may be above the optimum with at most 400 intervals; 1e-4 is asked for.
COARSE = 4e-5
WAREHOUSES = {"warehouse": 1.0, "warehouse_rest": 1.0, "warehouse_slippery": 1.0, "warehouse_tall": 3.0}


# With a braking zone that depends on the heading; their facts are in `test_gallery_zones`.
ZONED = {"corridor_ellipse", "corridor_field", "turning_field", "warehouse_field"}


def names(*, of_the_warehouse: bool) -> list[str]:
    """The scenarios with uniform braking in the warehouse, or all others of them."""
    plain = [name for name in NAMES if name not in ZONED]
    return [name for name in plain if name.startswith("warehouse") == of_the_warehouse]


def read_motion(file: Path) -> Trajectory:
    """The motion of a trajectory file."""
    return Trajectory(*np.loadtxt(file, delimiter=",", skiprows=1, unpack=True))


class GalleryFacts:
    """Tests of one result, in `folder`, a fixture of the module that inherits them."""

    @pytest.fixture
    def result(self, folder) -> dict[str, Any]:
        return read_result(folder)

    def test_every_scenario_is_certified_or_refined_and_holds_everywhere(self, result):
        certified = result["scenario"] not in REFINED | AT_REST
        assert result["verdict"] == ("certified" if certified else "refined")
        assert result["executed"] == ("speed_graph" if certified else "refined")
        values = {gate["name"]: gate.get("value") for gate in result["gates"]}
        assert values["constraint_violation"] <= 1e-6
        assert values["braking_margin"] >= 0.0
        assert {check["status"] for check in result["checks"]} == {"passed"}
        assert not result["missing"]

    def test_every_emergency_stop_ends_well(self, result):
        told, found = result["simulation"], result["simulation"]["emergency_stops"]
        studied = result["scenario"] == STUDIED
        assert found["instants"] == STOPS.get(result["scenario"], FEWEST)
        assert found["tried"] == 2 * found["instants"]
        assert (found["bad"], found["collisions"], found["falls"], found["not_stopped"]) == (0, 0, 0, 0)
        assert found["min_clearance"] > 0.0
        assert ("margin" in told) == ("robustness" in told) == studied

    def test_over_the_limit_is_flagged(self, result, folder):
        scenario = load_scenario(folder / "scenario.yaml")
        robot, motion = scenario.problem.robot, read_motion(folder / "trajectory.csv")
        demand, _ = analytic_demand(robot, motion)
        reachable = demand * MOST_FACTOR**2 >= OVER  # demand grows with the square of the speed
        told = result["simulation"]
        if result["scenario"] == STUDIED:
            assert ("over" in told["margin"]) == reachable
            found = told["margin"]["over"]
            assert found["flagged"]
            assert found["demand"] == pytest.approx(OVER)
            assert found["factor"] ** 2 * demand == pytest.approx(OVER)
            assert told["margin"]["factor"] < found["factor"]
            assert all(case["holds"] == (case["cause"] == "") for case in told["robustness"])
            assert all(0.0 <= case["least_load"] <= 1.0 for case in told["robustness"])
            return
        trial = over_the_limit(robot, motion, model=told["model"])
        assert (trial is not None) == reachable == (result["scenario"] not in SLOW)
        if trial is not None:
            assert trial.cause
            assert trial.factor**2 * demand == pytest.approx(OVER)

    def test_the_lower_bound_is_below_what_is_known_and_within_its_gate(self, result):
        name, lower = result["scenario"], result["lower_bound"]["travel_time"]
        times = [plan["travel_time"] for plan in result["plans"].values() if plan.get("reached", True)]
        assert lower <= min(times)  # those of the full model too
        if name in EXACT:
            assert lower <= EXACT[name]
        elif name == "four_point_room":
            assert lower <= TRUSTED[name][1]
        elif name in {*WAREHOUSES, "warehouse_gaps"}:  # over all ways, through the gaps or not
            assert lower <= TRUSTED["warehouse"][1] / math.sqrt(WAREHOUSES.get(name, 1.0))
        assert result["lower_bound"]["worst_slack"] >= 0.0
        gap = result["gaps"]["certified"]
        assert gap >= 0.0
        if name == "warehouse_gaps":
            assert gap >= GAPS / TRUSTED["warehouse"][1] - 1.0  # another way is that much faster
        else:
            assert gap <= 0.03
            assert result["gaps"]["certified_full"] >= 0.0

    def test_variational_times_agree_with_what_is_known(self, result):
        name, time = result["scenario"], result["plans"]["collocation"]["travel_time"]
        if name in EXACT:
            assert EXACT[name] <= time <= EXACT[name] * (1.0 + 2e-5)  # 1e-4 is asked for
        elif name in TRUSTED:
            low, high = TRUSTED[name]
            assert low <= time <= high * (1.0 + 2e-5)  # 5e-4 is asked for
        elif name in WAREHOUSES:
            low, high = TRUSTED["warehouse"]  # the same world: times scale with 1/sqrt(a_b)
            scale = math.sqrt(WAREHOUSES[name])
            assert low / scale <= time <= high / scale * (1.0 + 2e-5)
        else:  # nothing known of it but what is proven here
            exact = result["plans"]["speed_graph"]["exact_time"]
            assert result["lower_bound"]["travel_time"] <= exact <= time <= exact * (1.0 + COARSE)

    def test_the_speed_graph_is_certified_and_as_exact_as_what_is_known(self, result):
        plan, name = result["plans"]["speed_graph"], result["scenario"]
        assert plan["classes"][0]["certified"]
        assert plan["optimality_bound"] <= 1e-7 * plan["exact_time"]
        if name in EXACT:
            assert plan["exact_time"] == pytest.approx(EXACT[name], rel=1e-9)
        elif name in OPTIMUM:
            assert plan["exact_time"] == pytest.approx(OPTIMUM[name], rel=1e-8)
        elif name in WAREHOUSES:
            scale = math.sqrt(WAREHOUSES[name])
            assert plan["exact_time"] == pytest.approx(OPTIMUM["warehouse"] / scale, rel=1e-8)
        # rows are slowed by 1e-6 and by what proves their clearance between samples
        assert plan["exact_time"] <= plan["travel_time"] <= plan["exact_time"] * (1.0 + 1e-5)

    def test_classes_come_in_the_order_of_their_optimal_times_each_no_slower_than_in_the_graph(self, result):
        rows = result["plans"]["speed_graph"]["classes"]
        times = [row["travel_time"] for row in rows]
        assert times == sorted(times)
        assert [row["rank"] for row in rows] == list(range(1, len(rows) + 1))
        assert len({row["class"] for row in rows}) == len(rows)
        assert all(row["travel_time"] <= row["graph_time"] * (1.0 + 1e-9) for row in rows if row["certified"])
        assert rows[0]["class"] == result["plans"]["speed_graph"]["class"]

    def test_no_collocation_beats_the_optimum_of_its_class(self, result):
        assert (
            -COARSE <= result["gaps"]["analytic"] <= 1e-9
        )  # never above: both are safe rows of the same model
        best = result["plans"]["speed_graph"]
        assert result["plans"]["collocation"]["travel_time"] >= best["exact_time"]
        seeds = [row for row in result["plans"]["collocation"]["seeds"] if row["method"] == "speed_graph"]
        # one that starts in a slower class may have crossed a point between two knots into a better one
        assert all(row["travel_time"] >= best["exact_time"] for row in seeds if "travel_time" in row)
        assert {row["class"] for row in seeds} <= {row["class"] for row in best["classes"]}

    def test_every_plan_of_the_best_way_has_the_same_class(self, result):
        plans = result["plans"]
        assert plans["speed_graph"]["class"] == plans["collocation"]["class"] == plans["refined"]["class"]

    def test_the_vc_method_is_no_faster_than_the_variational_optimum_and_keeps_its_promises(self, result):
        if result["scenario"] == "warehouse_gaps":
            assert "vc_method" not in result["plans"]  # a class was asked for, the vc-method knows no classes
            return
        plan = result["plans"]["vc_method"]
        assert plan["travel_time"] >= result["plans"]["speed_graph"]["exact_time"]
        assert plan["travel_time"] >= result["lower_bound"]["travel_time"]
        assert plan["arc_time"] == pytest.approx(plan["route"]["arc_time"], rel=1e-9)
        assert plan["route"]["arc_time"] <= plan["other_route"]["arc_time"] * (1.0 + 1e-9)
        assert set(plan["violations"]) <= {"steering", "start", "goal"}
        assert bool(plan["violations"]) == bool(plan["shortfalls"])

    def test_seeds_of_one_class_lead_to_one_optimum(self, result):
        if result["scenario"] == "warehouse_gaps":
            assert "comparison" not in result["plans"]["collocation"]  # the speed graph alone seeds
            return
        rows = [row for row in result["plans"]["collocation"]["comparison"] if "travel_time" in row]
        assert {"speed_graph"} <= {row["method"] for row in rows}
        times: dict[str, list[float]] = {}
        for row in rows:
            times.setdefault(row["class"], []).append(row["travel_time"])
            assert row["iterations"] >= 1
        for found in times.values():
            assert max(found) <= min(found) * (1.0 + 1e-4)

    def test_the_dynamic_window_arrives_later_or_says_why_not(self, result):
        plan = result["plans"].get("dwa")
        if plan is None:
            assert result["scenario"] in REFINED  # nobody asked for it
        elif plan["reached"]:
            assert plan["travel_time"] >= result["lower_bound"]["travel_time"]
            assert not plan["violations"]
        else:
            assert plan["stuck"]["message"]
            assert set(plan["violations"]) <= {"goal"}

    def test_the_full_model_is_no_faster_than_what_bounds_it(self, result):
        time = result["plans"]["refined"]["travel_time"]
        name = result["scenario"]
        if name in EXACT:
            assert time >= EXACT[name]
        elif name == "warehouse_rest":
            # 25.44124 s plus sqrt(2 c)(sqrt 2 - 1) at each end at rest, clearance c = 1.5 and 1.6 m
            ends = sum(math.sqrt(2.0 * c) * (math.sqrt(2.0) - 1.0) for c in (1.5, 1.6))
            assert TRUSTED["warehouse"][0] + ends <= time <= 27.29
            assert result["end_cost"] == pytest.approx(ends, rel=1e-9)
        elif name == "warehouse_gaps":
            assert time >= GAPS
        elif name in AT_REST:
            assert result["end_cost"] > 0.0
            assert time >= result["lower_bound"]["travel_time"] + result["end_cost"]
        elif name == "office_floor":
            assert time >= result["lower_bound"]["travel_time"]
        else:
            low = TRUSTED.get(name, TRUSTED["warehouse"])[0] / math.sqrt(WAREHOUSES.get(name, 1.0))
            assert time >= low

    def test_the_voronoi_route_is_an_upper_bound_with_an_exact_time(self, result):
        if "voronoi_route" not in result["plans"]:
            assert result["scenario"] in {*REFINED, "office_floor", *AT_REST}  # nobody asked for it
            return
        route = result["plans"]["voronoi_route"]
        assert route["exact_time"] <= route["travel_time"] <= route["exact_time"] * (1.0 + 1e-5)
        assert route["travel_time"] >= result["plans"]["collocation"]["travel_time"] * (1.0 - 1e-6)

    def test_limits_are_held_back_only_where_the_motion_is_at_its_limit(self, result):
        slowed = "limit_share" in result["plans"]["refined"]
        assert slowed == (result["scenario"] in ("warehouse_slippery", "warehouse_tall"))
