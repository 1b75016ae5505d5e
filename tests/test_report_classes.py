"""The speed graph in the report: ranked table, pictures of classes and graphs, the analytic gap."""

from __future__ import annotations

import copy
import re
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any

import numpy as np
import pytest
from report_case import HISTORY, corner_path, motion, warehouse, write_folder
from test_report import LARGEST_PAGE, Page, hash_of, policy_of, without_scripts

from verify.report import ClassDrawing, GraphDrawing, ReportExtras, SpeedGraphDrawing, write_report
from verify.report.drawings import MOST_LINES, share
from verify.report.figures_classes import MOST_CLASSES, draw_class_map, draw_newton
from verify.report.figures_graph import draw_graphs
from verify.report.numbers import fine_percent
from verify.report.palette import FLOOR, INK, RANKS, method, variable_of_colour
from verify.report.story import reference_plan, travel_times
from verify.report.story_classes import analytic_row, certificate, class_rows
from verify.report.wording import CONDITIONS
from vnav_drake.plan import Path
from vnav_drake.scenario import Scenario

OVER_THE_TOP = Path.polyline([(28.5, 1.9), (28.5, 29.0), (2.0, 29.0), (2.0, 22.0)])


def class_row(rank: int, name: str, time: float, **more: Any) -> dict[str, Any]:
    row = {"rank": rank, "class": name, "graph_time": 1.01 * time, "travel_time": time, "length": 47.0}
    return row | {"optimality_bound": 3.2e-10, "certified": True, "failed": []} | more


def with_speed_graph(folder: FilePath, scenario: Scenario) -> dict[str, Any]:
    """The case of `report_case`, its analytic plan the same motion as its variational collocation."""
    result = write_folder(folder, scenario)
    twin = (folder / "trajectories/collocation.csv").read_bytes()
    (folder / "trajectories/speed_graph.csv").write_bytes(twin)
    time = result["plans"]["collocation"]["travel_time"]
    rows = [
        class_row(2, "O2/boundary", 1.2 * time, certified=False, failed=["node", "novel_fault"],
                  full_profile_reason="bends with 9 1/m, the steering allows 2 1/m"),
        class_row(1, "O8/boundary", time, full_profile_time=1.1 * time),
    ]  # fmt: skip
    result["plans"]["speed_graph"] = {
        "travel_time": time, "length": 47.0, "model": "variational", "class": "O8/boundary",
        "exact_time": time, "optimality_bound": 3.2e-10, "classes": rows[::-1],
        "graph": {"kind": "sampled", "nodes": 1234, "edges": 5678},
    }  # fmt: skip
    result["plans"]["collocation"]["seeds"] = [
        {"method": "speed_graph", "class": "O8/boundary", "travel_time": 1.001 * time, "iterations": 9},
        {"method": "speed_graph", "class": "O2/boundary", "message": "no safe geometry"},
        {"method": "voronoi_route", "class": "O2/boundary", "travel_time": 99.0},
    ]
    result["gaps"]["analytic"] = -4e-7
    result["gates"].insert(0, {"name": "analytic_gap", "value": 4e-7, "limit": 0.01, "passed": True})
    return result


def drawing(scenario: Scenario) -> SpeedGraphDrawing:
    paths = (("O8/boundary", corner_path(2.4)), ("O2/boundary", OVER_THE_TOP))
    classes = [
        ClassDrawing(
            rank=rank,
            name=name,
            points=np.column_stack(path.at(np.linspace(0.0, path.length, 300))[:2]),
            motion=motion(scenario, path, share=1.0, ends=None),
            iteration_times=[26.0, 25.1, 25.001, 25.0],
            residuals=[0.3, 2e-2, 1e-4, 0.0],
        )
        for rank, (name, path) in enumerate(paths, 1)
    ]
    rng = np.random.default_rng(5)
    nodes = rng.uniform(1.0, 30.0, (400, 2))
    edges = nodes[rng.integers(0, 400, (5000, 2))]
    graphs = [
        GraphDrawing(kind="sampled", nodes=nodes, lines=edges[:700], shown=700, total=5000),
        GraphDrawing(kind="published", nodes=nodes[:40], lines=edges[:130], shown=90, total=90),
    ]
    return SpeedGraphDrawing(graphs=graphs, classes=classes)


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], str]:
    folder = tmp_path_factory.mktemp("report") / "warehouse"
    scenario = warehouse()
    result = with_speed_graph(folder, scenario)
    extras = ReportExtras(history=HISTORY, speed_graph=drawing(scenario))
    write_report(folder / "report.html", scenario=scenario, result=result, folder=folder, extras=extras)
    return result, (folder / "report.html").read_text(encoding="utf-8")


def page(
    folder: FilePath, scenario: Scenario, result: dict[str, Any], extras: ReportExtras | None = None
) -> str:
    """The page of a folder without evidence: nothing to draw but the result."""
    extras = extras or ReportExtras()
    write_report(folder / "r.html", scenario=scenario, result=result, folder=folder, extras=extras)
    return (folder / "r.html").read_text(encoding="utf-8")


def said(text: str) -> str:
    return Page(text).text.replace("\u00a0", " ")


def test_the_page_is_well_formed_with_a_section_on_classes(case):
    page = Page(case[1])
    sections = [a["id"] for tag, a in page.elements if tag == "h2"]
    assert sections[2:6] == ["explore-title", "classes", "bound", "times"]
    ids = [a["id"] for _, a in page.elements if "id" in a]
    assert len(ids) == len(set(ids))
    assert len(case[1].encode()) < LARGEST_PAGE


def test_classes_stand_in_the_order_of_their_rank_with_every_figure(case):
    time = case[0]["plans"]["collocation"]["travel_time"]
    first, second = class_rows(case[0])
    assert (first.rank, second.rank) == ("1", "2")
    assert first.travel_time == f"{time:.6f}\u00a0s"
    assert first.graph_time == f"{1.01 * time:.3f}\u00a0s"
    assert first.bound == "3.2\u00a0×\u00a010⁻¹⁰\u00a0s"
    assert (first.status, second.status) == ("certified", "not certified")
    assert first.gap == "−0.100\u00a0%"  # 1/1.001 - 1 = -0.0999 %
    assert second.gap == "–"  # nothing safe came of its seed, and the route's time is not its own
    words = said(case[1])
    assert "O8/boundary" in words
    assert "1 234 nodes and 5 678 edges" in words.replace("\u202f", " ")


def test_a_class_that_is_not_certified_says_which_condition_failed(case):
    assert class_rows(case[0])[1].failed == f"{CONDITIONS['node']}; novel fault"
    assert CONDITIONS["node"] in said(case[1])


def test_a_path_that_the_full_robot_cannot_follow_says_why(case):
    rows = class_rows(case[0])
    assert rows[0].full_profile.endswith("s")
    assert "the steering allows" in rows[1].full_profile


def test_the_analytic_gap_stands_first_among_the_times_with_its_sign(case):
    row = analytic_row(case[0])
    assert row.gap == "−4.0\u00a0×\u00a010⁻⁵\u00a0%"  # -4e-7 = -4e-5 %
    assert row.status == "passed"
    page = case[1]
    times = page[page.index('id="times"') :]
    assert times.index("Gap, analytic against collocation") < times.index("<table")
    assert "gap −4.0 × 10⁻⁵ %." in said(page)  # below the answer


def test_without_a_collocation_there_is_no_analytic_row(case):
    plans = {name: plan for name, plan in case[0]["plans"].items() if name != "collocation"}
    assert analytic_row({**case[0], "plans": plans}) is None


def test_gates_that_were_asked_for_are_said_at_once_and_at_the_classes(case, tmp_path):
    scenario = warehouse()
    scenario = replace(scenario, plan=replace(scenario.plan, through=("O4/O6", "O3/<b>O4")))
    words = said(page(tmp_path, scenario, case[0]))
    assert " m through O4/O6, O3/<b>O4, as asked" in words
    assert "only classes that pass O4/O6, O3/<b>O4 , in this order" in words
    assert "as asked" not in said(case[1])


def test_times_compare_with_the_speed_graph_where_there_is_one(case):
    assert reference_plan(case[0]) == "speed_graph"
    assert list(travel_times(case[0])).index("speed_graph") < list(travel_times(case[0])).index("collocation")


def test_a_best_class_that_is_not_certified_is_not_called_optimal():
    plan = {"optimality_bound": 1e-9, "classes": [class_row(1, "direct", 3.0, certified=False)]}
    assert certificate({"plans": {"speed_graph": plan}}) == "not certified as the optimum of its class"


@pytest.mark.parametrize(
    ("ratio", "text"),
    [(0.0, "+0.000 %"), (2.5e-3, "+0.250 %"), (-1.234e-6, "−1.2 × 10⁻⁴ %"), (3.1e-9, "+3.1 × 10⁻⁷ %")],
)
def test_small_gaps_keep_two_digits_and_their_sign(ratio, text):
    assert fine_percent(ratio).replace("\u00a0", " ") == text


def test_a_graph_with_many_edges_is_drawn_in_part_and_says_so():
    sampled, published = draw_graphs(warehouse().problem, drawing(warehouse()).graphs)
    words = sampled.caption.replace("\u202f", " ")
    assert "700 of 5 000 edges are drawn" in words
    assert "90 edges, all drawn" in published.caption
    # one outline: as many starts of a line as lines, within the one path that has most of them
    starts = max(len(re.findall("[Mm]", d)) for d in re.findall(r' d="([^"]*)"', sampled.svg))
    assert starts == 700


def test_a_large_graph_costs_no_more_than_its_points():
    # In hundredths of a pixel a step within 440 px has at most 7 characters a number ("-439.99"), and each
    # line two letters more; floor, axes and letters are the same for all graphs.
    rng = np.random.default_rng(3)
    lines = rng.uniform(1.0, 30.0, (MOST_LINES, 6, 2))
    few, many = (
        GraphDrawing(kind="sampled", nodes=lines[0], lines=part, shown=len(part), total=9999)
        for part in (lines[:1], lines)
    )
    small, large = draw_graphs(warehouse().problem, [few, many])
    assert len(large.svg) - len(small.svg) <= MOST_LINES * (6 * 2 * 7 + 2)
    assert len(small.svg) < 20_000  # letters with rims as outlines of their own would take more


def test_each_class_has_a_small_map_of_its_own_on_one_floor(case):
    text = without_scripts(case[1])
    maps = re.findall(r'<svg class="thumbnail".*?</svg>', text, flags=re.DOTALL)
    assert len(maps) == 2
    assert text.count('id="class-floor"') == 1
    for rank, picture in enumerate(maps, 1):
        assert f"var(--rank-{rank})" in picture
        assert 'href="#class-floor"' in picture
        assert len(picture) < 3000
    buttons = [a for a in Page(case[1]).all("button") if a.get("class") == "pick"]
    assert [(a["data-class"], a["aria-pressed"]) for a in buttons] == [("1", "false"), ("2", "false")]


def test_a_share_has_the_first_and_the_last_and_no_number_twice():
    assert share(5, 9).tolist() == [0, 1, 2, 3, 4]
    picked = share(100_000, 3000)
    assert (picked[0], picked[-1], len(set(picked.tolist()))) == (0, 99_999, 3000)


def test_classes_beyond_the_sixth_are_told_of_and_not_drawn():
    scenario = warehouse()
    one = drawing(scenario).classes[0]
    many = [
        ClassDrawing(rank=k, name=f"c{k}", points=one.points + 0.01 * k, motion=None) for k in range(1, 9)
    ]
    picture = draw_class_map(scenario.problem, many)
    assert "The 2 further ones are not drawn." in picture.caption
    assert len(RANKS) == MOST_CLASSES


def test_newtons_curves_leave_out_zeros_that_a_logarithm_cannot_show():
    pictures = draw_newton(drawing(warehouse()).classes)
    assert [p.key for p in pictures] == ["newton-residual", "newton-time"]
    # residuals 0.3 to 1e-4 and a zero; times 26, 25.1, 25.001 above the last, 25
    assert "class 1 from 0.30 to 1.0 × 10⁻⁴" in pictures[0].description.replace("\u00a0", " ")
    assert "class 1 from 1.0 to 0.0010" in pictures[1].description.replace("\u00a0", " ")
    assert draw_newton([]) == []


def _lightness(colour: str) -> float:
    """Relative luminance (WCAG 2.2): linear light, weighted."""
    parts = [int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts]
    return float(np.dot(linear, [0.2126, 0.7152, 0.0722]))


def test_ranks_are_ordered_by_lightness_alone_on_both_grounds():
    light, dark = ([_lightness(getattr(tone, ground)) for tone in RANKS] for ground in ("light", "dark"))
    assert np.all(np.diff(light) > 0.0)
    assert np.all(np.diff(dark) < 0.0)
    floor = [_lightness(getattr(FLOOR, ground)) for ground in ("light", "dark")]
    assert min((floor[0] + 0.05) / (value + 0.05) for value in light) > 2.0
    assert min((value + 0.05) / (floor[1] + 0.05) for value in dark) > 2.0


def test_every_rank_has_a_colour_of_its_own():
    assert {tone.light for tone in RANKS} <= set(variable_of_colour())
    assert len({tone.light for tone in RANKS} - {INK.light, method("speed_graph").light}) == len(RANKS)


def test_a_result_of_another_shape_still_gives_a_page(case, tmp_path):
    result = copy.deepcopy(case[0])
    result["plans"]["speed_graph"] |= {"classes": [None, 3, {"rank": "x", "failed": 7}], "graph": [1]}
    result["plans"]["collocation"]["seeds"] = "none"
    words = said(page(tmp_path, warehouse(), result))
    assert "The paths of the classes were not at hand." in words


def test_names_of_classes_are_never_markup(case, tmp_path):
    scenario = warehouse()
    result = copy.deepcopy(case[0])
    evil = "<script>alert(1)</script>/$x$\u202e"
    result["plans"]["speed_graph"]["classes"] = [class_row(1, evil, 25.0, certified=False, failed=[evil])]
    known = drawing(scenario).classes[0]
    named = ClassDrawing(rank=1, name=evil, points=known.points, motion=known.motion)
    extras = ReportExtras(speed_graph=SpeedGraphDrawing(classes=[named]))
    text = page(tmp_path, scenario, result, extras)
    shown = Page(text)
    run = re.findall(r"<script>(.*?)</script>", text, flags=re.DOTALL)
    assert sorted(map(hash_of, run)) == sorted(policy_of(shown)["script-src"])  # none but ours
    assert "<script>alert(1)</script>/$x$" in shown.text
