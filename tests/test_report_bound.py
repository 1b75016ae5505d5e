"""The lower bound in the report: bracket, isochrones, slack, and what is said where there is no bound."""

from __future__ import annotations

import math
import re
import shutil
from dataclasses import replace
from decimal import Decimal
from pathlib import Path
from typing import Any

import certificate_case
import numpy as np
import pytest
import shapely
from hypothesis import example, given
from hypothesis import strategies as st
from report_case import corner_path, motion, warehouse, write_folder
from test_report import HOSTILE, LARGEST_PAGE, Page, without_scripts
from test_report_classes import _lightness

from verify.judge.question import read_question
from verify.report import ReportExtras, write_index, write_report
from verify.report.answer import answer
from verify.report.bound import BoundMesh, bernstein, long_sides, read_bound
from verify.report.figures_bound import Closing, draw_closing
from verify.report.figures_potential import MOST_BANDS, Way, draw_potential, draw_slack, isochrone_step
from verify.report.figures_time import BracketData, BracketRow, draw_bracket
from verify.report.numbers import bracket, percent_beside, seconds_proven
from verify.report.palette import BANDS, SLACKS, variable_of_colour
from verify.report.story import gate_rows
from verify.report.story_bound import bound_story, bracket_sentence, closing, full_sentence, upper
from verify.report.story_times import time_rows
from vnav_drake.plan import Trajectory

FILE = "certificate.npz"
LOWERED = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
START, GOAL = np.array([28.5, 1.9]), np.array([2.0, 22.0])  # of the warehouse


def quadratic(points: np.ndarray) -> np.ndarray:
    """Rises from the start to the goal; its second derivatives are 2, 1 and 4."""
    x, y = np.asarray(points).T
    return (32.0 - x) ** 2 + (32.0 - x) * y + 2.0 * y**2


def handmade() -> dict[str, np.ndarray]:
    """A certificate of the warehouse on a mesh of 1 m whose u is a multiple of `quadratic`."""
    mesh = certificate_case.grid(range(33), range(32))
    return certificate_case.make(read_question(warehouse().data), *mesh, quadratic)


def with_bound(folder: Path) -> dict[str, Any]:
    """The case of `report_case` with that certificate, and a result as the judge would word it."""
    result = write_folder(folder, warehouse())
    arrays = handmade()
    (folder / FILE).write_bytes(certificate_case.packed(arrays))
    proven = float(arrays["travel_time"])
    best, refined = (result["plans"][name]["travel_time"] for name in ("collocation", "refined"))
    result["lower_bound"] = {
        "holds": True, "travel_time": proven, "triangles": len(arrays["triangles"]),
        "dropped": len(arrays["dropped"]), "exact": False, "worst_slack": 1e-12, "compute_time": 8.0,
        "method": "quadratic certificate (second-order cone program)", "stopped": "budget",
        "statement": "No motion takes less.",
        "rounds": [
            {"triangles": n, "lower_bound": share * proven, "status": "Solved", "seconds": t}
            for n, share, t in ((400, 0.8, 0.5), (800, 0.7, 2.0), (1500, 1.0, 8.0))
        ],
    }  # fmt: skip
    result["end_cost"] = 1.25
    result["gaps"] |= {"certified": best / proven - 1.0, "certified_full": refined / (proven + 1.25) - 1.0}
    result["missing"] = []
    return result


def page(folder: Path, result: dict[str, Any]) -> str:
    file = folder / "report.html"
    write_report(file, scenario=warehouse(), result=result, folder=folder, extras=ReportExtras())
    return file.read_text(encoding="utf-8")


def said(text: str) -> str:
    return Page(text).text.replace("\u00a0", " ").replace("\u202f", " ")


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any], str]:
    folder = tmp_path_factory.mktemp("bound") / "warehouse"
    result = with_bound(folder)
    return folder, result, page(folder, result)


@pytest.fixture(scope="module")
def mesh(case) -> BoundMesh:
    found, reason = read_bound(case[0])
    assert reason == ""
    return found


@pytest.fixture
def copied(case, tmp_path: Path) -> Path:
    """A folder with the scenario and the certificate alone: no other pictures to draw."""
    for name in ("scenario.yaml", FILE):
        shutil.copy(case[0] / name, tmp_path)
    return tmp_path


def factor(mesh: BoundMesh) -> float:
    """The certificate's u is this multiple of `quadratic`."""
    return float(mesh.controls[0, 0] / quadratic(mesh.corners[:1, 0])[0])


# the pictures' numbers


def test_the_potential_is_quadratic_between_the_corners(mesh):
    points = np.random.default_rng(3).uniform([0.0, 0.0], [32.0, 3.9], (500, 2))  # the bottom corridor
    np.testing.assert_allclose(mesh.potential(points), factor(mesh) * quadratic(points), rtol=1e-12)


def test_there_is_no_potential_where_the_robot_cannot_be(mesh):
    inside = np.array([[9.0, 24.5], [20.3, 6.1], [-1.0, 3.0]])  # two racks, outside
    assert np.isnan(mesh.potential(inside)).all()
    assert mesh.dropped == 8 * 10 * 5 * 2  # the cells of 1 m of eight racks, cut in two


def test_what_is_drawn_as_linear_pieces_has_the_potential_at_every_corner(mesh):
    points, triangles, u = mesh.pieces()
    np.testing.assert_allclose(u, factor(mesh) * quadratic(points), rtol=1e-12)
    area = shapely.area(shapely.polygons(points[triangles]))
    np.testing.assert_allclose(area.sum(), 32 * 31 - 8 * 50)  # hall without racks
    assert len(np.unique(np.round(points, 9), axis=0)) == len(points)  # pieces share corners: no cracks
    assert len(triangles) <= 120_000


def test_a_quadratic_keeps_its_bernstein_values():
    # The blossom: c_ij of f(l) = (l . s)^2 is s_i s_j.
    s = np.array([2.0, -1.0, 0.5])
    controls = np.array([4.0, 1.0, 0.25, -2.0, -0.5, 1.0])
    shares = np.random.default_rng(1).dirichlet([1.0, 1.0, 1.0], 50)
    np.testing.assert_allclose(bernstein(controls, shares), (shares @ s) ** 2, atol=1e-14)


def test_sides_on_one_line_are_drawn_as_one():
    # 4 x 3 cells: 4 lines across and 5 up, but the first upright line lacks its middle side, so is two.
    x, y = np.meshgrid(np.arange(5), np.arange(4), indexing="ij")
    lattice = np.stack([x.ravel(), y.ravel()], 1) * 7
    across = [(4 * i + j, 4 * (i + 1) + j) for i in range(4) for j in range(4)]
    up = [(4 * i + j, 4 * i + j + 1) for i in range(5) for j in range(3) if (i, j) != (0, 1)]
    sides = np.random.default_rng(2).permutation(np.array([*across, *up]))
    lines = long_sides(lattice, sides)
    assert len(lines) == 4 + 5 + 1
    length = np.hypot(*(lattice[lines[:, 1]] - lattice[lines[:, 0]]).T).sum()
    assert length == 7 * len(sides)


def test_no_side_at_all_is_no_line():
    assert long_sides(np.zeros((3, 2), dtype=np.int64), np.empty((0, 2), dtype=np.int64)).shape == (0, 2)


@given(st.floats(1e-3, 1e5))
def test_isochrones_are_round_numbers_and_few(total):
    step = isochrone_step(total)
    assert total / step <= MOST_BANDS * (1.0 + 1e-12)
    assert total / step > MOST_BANDS / 2.5 * (1.0 - 1e-12)  # 2 to 5 is the widest stride
    assert round(step / 10.0 ** math.floor(math.log10(step * (1.0 + 1e-9))), 9) in (1.0, 2.0, 5.0)


def test_tones_are_ordered_by_lightness_alone_on_both_grounds():
    for tones in (SLACKS, BANDS):
        light, dark = ([_lightness(getattr(tone, ground)) for tone in tones] for ground in ("light", "dark"))
        assert np.all(np.diff(light) < 0.0)  # tight and late ones stand out
        assert np.all(np.diff(dark) > 0.0)
    assert {tone.light for tone in (*SLACKS, *BANDS)} <= set(variable_of_colour())


# the page


def test_the_section_shows_all_pictures_and_the_page_stays_well_formed(case):
    text = case[2]
    ids = [a["id"] for _, a in Page(text).elements if "id" in a]
    assert len(ids) == len(set(ids))
    assert {
        "figure-bound-potential",
        "figure-bound-slack",
        "figure-bound-zoom",
        "figure-bound-closing",
    } <= set(ids)
    wanted = re.findall(r"url\(#([^)]+)\)", without_scripts(text))
    assert set(wanted) <= set(ids)
    assert len(text.encode()) < LARGEST_PAGE
    section = text[text.index('id="bound"') : text.index('id="times"')]
    assert "Not shown." not in section
    assert "var(--slack-5)" in section  # scaled to its limit, so some triangle is tight
    assert f"var(--band-{len(BANDS)})" in section


def test_the_answer_and_the_section_say_what_is_proven(case):
    _, result, text = case
    sentence = bracket_sentence(result).replace("\u00a0", " ")
    assert said(text).count(sentence) == 2
    assert sentence.startswith("No path of any homotopy class can take less than ")
    assert "verify check --exact" in said(text)
    assert "docs/certificate.md" in said(text)
    assert "No motion takes less." in said(text)
    assert "its budget of triangles was spent" in said(text)


def test_the_bracket_of_the_full_robot_adds_the_cost_of_its_ends(case):
    _, result, _ = case
    words = full_sentence(result).replace("\u00a0", " ")
    assert "E = 1.250 s" in words
    least = result["lower_bound"]["travel_time"] + 1.25
    told = float(re.search(r"cannot take less than ([0-9.]+) s", words)[1])
    assert 0.0 <= least - told < 1e-3
    assert "E =" not in full_sentence({**result, "end_cost": 0.0})
    assert "cannot take less" in full_sentence({**result, "end_cost": 0.0})
    assert full_sentence({**result, "gaps": {}}) == ""


def test_without_a_gap_the_bound_still_stands(case):
    result = {**case[1], "gaps": {}}
    assert upper(result) == (None, "")
    assert "the best found" not in bracket_sentence(result)
    told = float(re.search(r"less than ([0-9.]+)", bracket_sentence(result))[1])
    assert 0.0 <= result["lower_bound"]["travel_time"] - told < 1e-3


def test_the_best_time_is_that_of_the_certified_gap(case):
    time, name = upper(case[1])
    assert name == "collocation"
    assert time == pytest.approx(case[1]["plans"]["collocation"]["travel_time"], rel=1e-12)


@pytest.mark.parametrize(
    ("low", "high", "words"),
    [
        (25.44049, 25.44161, ("25.4404", "25.4416")),  # 1.1 ms apart: four decimals tell them apart
        (3.19566951, 3.19566962, ("3.19566951", "3.19566962")),  # 0.11 us: eight
        (20.0, 26.0, ("20.000", "26.000")),
    ],
)
def test_a_bracket_has_the_decimals_that_tell_its_ends_apart(low, high, words):
    assert bracket(low, high) == tuple(f"{word}\u00a0s" for word in words)


@given(st.floats(0.01, 1e4), st.floats(1e-9, 1.0))
def test_a_bracket_never_promises_more_than_is_proven(low, gap):
    high = low * (1.0 + gap)
    shown = [Decimal(word.removesuffix("\u00a0s")) for word in bracket(low, high)]
    step = Decimal(1).scaleb(shown[1].as_tuple().exponent)
    assert shown[0] <= Decimal(low)
    assert shown[0] < shown[1] or low == high
    assert abs(shown[1] - Decimal(high)) <= step  # half of it, but where that would close the bracket


def test_one_motion_has_one_time_in_a_paragraph():
    # Both sentences round 8.13449 s to nearest, whatever the bound below it.
    result = {
        "executed": "refined", "plans": {"refined": {"travel_time": 8.13449}}, "verdict": "refined",
        "lower_bound": {"travel_time": 7.9}, "gaps": {"certified_full": 8.13449 / 7.9 - 1.0},
    }  # fmt: skip
    assert "its motion takes 8.134\u00a0s: gap" in full_sentence(result)
    assert "gets there in 8.134\u00a0s" in answer(result)[0]


def test_the_full_bracket_is_told_of_the_motion_that_is_executed():
    result = {
        "executed": "speed_graph", "lower_bound": {"travel_time": 10.0}, "gaps": {"certified_full": 0.07},
        "plans": {"speed_graph": {"travel_time": 10.5}, "refined": {"travel_time": 10.7}},
    }  # fmt: skip
    words = full_sentence(result).replace("\u00a0", " ")
    assert "the motion to execute, that of the speed graph, takes 10.500 s." in words
    assert words.endswith("7.00 %, is that of the refined motion, which takes 10.700 s.")
    assert "its motion takes 10.700 s: gap 7.00 %." in full_sentence(
        {**result, "executed": "refined"}
    ).replace("\u00a0", " ")


@pytest.mark.parametrize(
    ("name", "value", "limit", "shown", "wanted"),
    [
        ("certified_gap", 4.7e-6, 1e-7, "4.7 × 10⁻⁴ %", "≤ 10⁻⁵ %"),
        ("certified_gap", 4.7e-6, 0.03, "< 0.001 %", "≤ 3 %"),  # below the limit either way
        ("certified_gap", 0.030001, 0.03, "3.0001 %", "≤ 3 %"),
        ("refinement_gap", -4.7e-6, 0.05, "> −0.001 %", "≤ 5 %"),
        ("analytic_gap", 0.01, 0.01, "1.00 %", "≤ 1 %"),
        ("constraint_violation", 1.004e-6, 1e-6, "1.004 × 10⁻⁶", "≤ 10⁻⁶"),
        ("braking_margin", 0.0499999, 0.05, "49.9999 mm", "≥ 0.05 m"),
        ("braking_margin", -1e-12, 0.0, "> −1 nm", "≥ 0 m"),
        ("braking_margin", 0.0, 0.0, "0 m", "≥ 0 m"),
    ],
)
def test_a_gate_shows_on_which_side_of_its_limit_it_is(name, value, limit, shown, wanted):
    gate = {"name": name, "value": value, "limit": limit, "passed": None}
    row = gate_rows({"gates": [gate]})[0]
    assert (row.value.replace("\u00a0", " "), row.limit.replace("\u00a0", " ")) == (shown, wanted)


@example(limit=0.22, off=-2e-16)  # 16 digits of the float and of its shortest name differ
@given(st.floats(1e-12, 10.0), st.floats(-1e-3, 1e-3) | st.sampled_from([0.0, 2e-16, -2e-16]))
def test_percentages_are_never_on_the_other_side_of_a_limit(limit, off):
    ratio = limit * (1.0 + off)
    text = percent_beside(ratio, limit).replace("\u00a0", "").replace("−", "-").removesuffix("%")
    if text.startswith("<"):
        assert ratio < 1e-5 <= limit
        return
    number, _, power = text.partition("×10")
    shown = Decimal(number).scaleb(int(power.translate(LOWERED) or 0)) / 100
    bound = Decimal(repr(limit))
    assert (shown > bound, shown < bound) == (ratio > limit, ratio < limit)


def test_gap_and_bound_show_their_side_wherever_they_stand(tmp_path):
    result = {
        "verdict": "refined", "lower_bound": {"travel_time": 10.0, "rounds": [{"lower_bound": 9.9999999}]},
        "executed": "collocation", "end_cost": 0.0,
        "plans": {"collocation": {"travel_time": 10.000047}}, "gaps": {"certified": 4.7e-6},
        "gates": [{"name": "certified_gap", "value": 4.7e-6, "limit": 1e-7, "passed": False}],
    }  # fmt: skip
    assert bracket_sentence(result).endswith("gap 4.7\u00a0×\u00a010⁻⁴\u00a0%.")
    write_index(tmp_path / "index.html", [("a", result)])
    assert "4.7 × 10⁻⁴ %" in said((tmp_path / "index.html").read_text())
    assert bound_story(result).rounds[0][1] == "9.999999\u00a0s"  # seven nines, rounded down


@pytest.mark.parametrize(("gap", "near"), [(0.01, True), (0.2, False), (None, False)])
def test_captions_claim_no_more_than_the_gap_allows(mesh, gap, near):
    whole = motion(warehouse(), corner_path(2.4), share=1.0, ends=None)
    way = Way(method="collocation", motion=whole, gap=gap)
    caption = draw_potential(warehouse().problem, mesh, way).caption
    assert ("right angles" in caption) is near
    assert ("The best path known takes 20.0\u00a0% longer" in caption) is (gap == 0.2)
    slack = draw_slack(warehouse().problem, mesh, way)[0].caption
    assert ("the fastest ways do not pass there" in slack) is near


def test_a_single_round_closes_nothing():
    one = Closing(triangles=np.array([1500.0]), seconds=np.array([0.4]), lower=np.array([6.215857]),
                  upper=6.215887, upper_method="collocation")  # fmt: skip
    picture = draw_closing(one)
    assert picture.heading == "The bracket after the only round"
    assert "6.215887\u00a0s" in picture.description  # 30 us apart: six decimals
    worse = replace(
        one, triangles=np.array([9.0, 99.0]), seconds=np.array([1.0, 2.0]), lower=np.array([2.0, 1.0])
    )
    assert draw_closing(worse).heading == "The bracket, round by round"


def test_a_worse_round_does_not_open_the_bracket_again(case):
    curves = closing(case[1])
    proven = case[1]["lower_bound"]["travel_time"]
    np.testing.assert_allclose(curves.best, [0.8 * proven, 0.8 * proven, proven])
    np.testing.assert_array_equal(curves.seconds, [0.5, 2.0, 8.0])
    rows = bound_story(case[1]).rounds
    assert [row[0] for row in rows] == ["400", "800", "1\u202f500"]


def test_a_single_round_and_no_best_time_can_be_drawn():
    one = Closing(triangles=np.array([1500.0]), seconds=np.array([0.4]), lower=np.array([2.5]), upper=None,
                  upper_method="")  # fmt: skip
    picture = draw_closing(one)
    assert "1 500 triangles, 0.40 s: 2.500 s" in picture.description.replace("\u00a0", " ").replace(
        "\u202f", " "
    )


def test_the_times_have_the_bound_as_a_row_and_a_shaded_side(case):
    table = said(case[2])
    assert "In the shaded times lie no motions at all" in table
    bracket_svg = next(
        svg for svg in re.findall(r"<svg.*?</svg>", case[2], flags=re.DOTALL) if 'id="bracket-title"' in svg
    )
    assert "var(--bad-fill)" in bracket_svg
    assert f"{2 * (32 * 31 - 8 * 50)} triangles".replace("1184", "1 184") in table  # cells of 1 m, cut in two


@pytest.mark.parametrize(("proven", "words"), [(25.4486, "25.448"), (3.0, "3.000"), (0.00099, "0.000")])
def test_bounds_are_rounded_down_wherever_they_stand(proven, words, tmp_path):
    result = {"lower_bound": {"travel_time": proven}, "verdict": "refined"}
    assert time_rows(result)[0].travel_time == f"{words}\u00a0s"
    assert seconds_proven(proven) == f"{words}\u00a0s"
    write_index(tmp_path / "index.html", [("a", result)])
    assert f"{words} s" in said((tmp_path / "index.html").read_text())
    rows = [BracketRow(method="lower_bound", travel_time=proven)]
    assert f"{words}\u00a0s" in draw_bracket(BracketData(rows=rows, reference="", executed="")).description


def test_a_short_path_in_a_wide_world_is_drawn_from_near(case, mesh):
    problem = warehouse().problem
    x = np.linspace(28.5, 27.5, 20)
    still = np.zeros_like(x)
    short = Trajectory(28.5 - x, x, still + 1.9, still + np.pi, still + 1.0, still, still, still + 1.0)
    near = draw_potential(problem, mesh, Way(method="collocation", motion=short))
    assert "around the path" in near.caption
    whole = Way(method="collocation", motion=motion(warehouse(), corner_path(2.4), share=1.0, ends=None))
    assert "around the path" not in draw_potential(problem, mesh, whole).caption
    assert "crosses" not in draw_potential(problem, mesh, None).description


def test_the_index_shows_the_gap_to_the_bound_for_the_ends_asked_for(case, tmp_path):
    gap = case[1]["gaps"]["certified_full"]  # the motion executed is that of the full robot
    write_index(tmp_path / "index.html", [("warehouse", case[1])])
    assert f"{100.0 * gap:.1f} %" in said((tmp_path / "index.html").read_text())


# what is said where there is nothing to show


def test_without_a_bound_the_reason_stands_in_place_of_the_picture(copied, case):
    result = {key: value for key, value in case[1].items() if key != "lower_bound"}
    result["missing"] = [{"stage": "lower_bound", "reason": "the solver did not converge"}]
    text = page(copied, result)
    section = said(text[: text.index('<section aria-labelledby="times"')] + "</main></body></html>")
    assert "Not shown. No lower bound was computed: the solver did not converge." in section
    assert "figure-bound" not in text
    assert "In the shaded times" not in section


def test_a_missing_file_is_named(copied, case):
    (copied / FILE).unlink()
    words = said(page(copied, case[1]))
    assert f"No picture of it: {FILE} was not written." in words
    assert "The bracket closes" in words


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04", b"not an archive"])
def test_a_broken_file_is_a_reason_and_not_an_error(copied, content):
    (copied / FILE).write_bytes(content)
    found, reason = read_bound(copied)
    assert found is None
    assert reason.startswith(FILE)


def test_a_certificate_that_does_not_hold_is_not_drawn(copied, case):
    arrays = handmade()
    arrays["u_vertex"] = arrays["u_vertex"] * 1.001
    arrays["u_edge"] = arrays["u_edge"] * 1.001
    (copied / FILE).write_bytes(certificate_case.packed(certificate_case.sealed(arrays)))
    text = page(copied, case[1])
    assert "No picture of it: the certificate is refused:" in said(text)
    assert "figure-bound-potential" not in text


def test_a_refused_certificate_says_why(case):
    reasons = [f"triangle {i} is too steep" for i in range(20)]
    result = {**case[1], "lower_bound": {"holds": False, "reasons": reasons, "triangles": 5}}
    story = bound_story(result)
    assert story.sentences == ()
    assert story.missing.startswith("The certificate is refused: triangle 0 is too steep; ")
    assert story.missing.endswith("and 12 more")  # eight are told
    assert closing(result) is None
    check = {"name": "certificate", "trajectory": "lower_bound", "status": "failed", "message": "S moved"}
    assert bound_story({"checks": [check]}).missing == "The certificate is refused: S moved"


@pytest.mark.parametrize(
    "bound",
    [{"travel_time": "soon"}, {"travel_time": 1e300},
     {"travel_time": 20.0, "rounds": [None, {"triangles": 3}, 7]},
     {"travel_time": 20.0, "rounds": {"a": 1}, "stopped": 3, "statement": ["x"]}],
)  # fmt: skip
def test_a_result_of_another_shape_still_gives_a_page(copied, case, bound):
    words = said(page(copied, {**case[1], "lower_bound": bound}))
    assert "Lower bound: nothing can be faster" in words


def test_a_bound_of_zero_is_no_bound():
    story = bound_story({"lower_bound": {"travel_time": 0.0, "holds": True}})
    assert story.missing == "The certificate proves no more than zero seconds."
    assert bracket_sentence({"lower_bound": {"travel_time": 0.0}}) == ""


def test_text_from_files_is_never_markup(copied, case):
    bound = {**case[1]["lower_bound"], "statement": HOSTILE, "stopped": HOSTILE, "method": HOSTILE}
    bound["rounds"] = [{**row, "status": HOSTILE} for row in bound["rounds"]]
    text = page(copied, {**case[1], "lower_bound": bound})
    refused = page(copied, {**case[1], "lower_bound": {"holds": False, "reasons": [HOSTILE]}})
    for shown in (text, refused):
        assert not {tag for tag, _ in Page(shown).elements} & {"script", "img", "b"}
        assert "<script>alert(1)</script>" in Page(shown).text
        assert not re.search("[\u0000-\u0008\u000b-\u001f\u202a-\u202e\u2066-\u2069]", shown)


def test_the_same_inputs_give_the_same_bytes(copied, case):
    assert page(copied, case[1]) == page(copied, case[1])
