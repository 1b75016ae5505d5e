"""The report page: structure, escaping, nothing loaded from elsewhere, missing stages, the index."""

from __future__ import annotations

import base64
import hashlib
import json
import math
import re
import shutil
import xml.etree.ElementTree as ET
from dataclasses import replace
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pytest
from report_case import HISTORY, warehouse, write_folder

from verify.report import ReportExtras, write_index, write_report
from verify.report.evidence import read_evidence
from verify.report.html import LIBRARY, script
from vnav_drake.scenario import Scenario
from vnav_drake.world import World

LARGEST_PAGE = 2_400_000  # [bytes]
VOID = {"meta", "wbr", "link", "img", "br", "hr", "input"}


class Page(HTMLParser):
    """Elements, texts and nesting of a page; refuses tags that do not match."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.texts: list[tuple[tuple[str, ...], str]] = []
        self.open: list[str] = []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {name: value or "" for name, value in attrs}))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {name: value or "" for name, value in attrs}))

    def handle_endtag(self, tag: str) -> None:
        assert self.open, f"</{tag}> closes nothing"
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if data.strip():
            self.texts.append((tuple(self.open), data.strip()))

    def all(self, tag: str) -> list[dict[str, str]]:
        return [attributes for name, attributes in self.elements if name == tag]

    @property
    def text(self) -> str:
        seen = (text for where, text in self.texts if where[-1] not in ("style", "title", "desc"))
        return re.sub(r"\s+", " ", " ".join(seen))


def without_scripts(text: str) -> str:
    return re.sub(r"<script.*?</script>", "", text, flags=re.DOTALL)


def extras() -> ReportExtras:
    arc = np.array([[2.0, 2.0], [2.0, 29.0], [14.5, 29.0]])
    return ReportExtras(
        voronoi_polylines=[arc], history=HISTORY, timings={"voronoi": 0.2, "collocation": 1.42}
    )


def write(folder: Path, scenario: Scenario, result: dict[str, Any], more: ReportExtras | None = None) -> str:
    file = folder / "report.html"
    write_report(file, scenario=scenario, result=result, folder=folder, extras=more or extras())
    return file.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Scenario, dict[str, Any], str]:
    folder = tmp_path_factory.mktemp("report") / "warehouse"
    scenario = warehouse()
    result = write_folder(folder, scenario)
    return folder, scenario, result, write(folder, scenario, result)


@pytest.fixture
def copied(case: tuple[Path, Scenario, dict[str, Any], str], tmp_path: Path) -> Path:
    return Path(shutil.copytree(case[0], tmp_path / "copy"))


def test_the_page_is_well_formed_and_small(case):
    text = case[3]
    Page(text)
    assert len(text.encode()) < LARGEST_PAGE


def test_ids_are_unique_and_every_reference_has_its_target(case):
    page = Page(case[3])
    ids = [attributes["id"] for _, attributes in page.elements if "id" in attributes]
    assert len(ids) == len(set(ids))
    wanted = [a["href"][1:] for _, a in page.elements if a.get("href", "").startswith("#")]
    wanted += [name for _, a in page.elements for name in a.get("aria-labelledby", "").split()]
    wanted += [name for _, a in page.elements for v in a.values() for name in re.findall(r"url\(#(.+)\)", v)]
    assert wanted
    assert set(wanted) <= set(ids)


def test_nothing_is_loaded_from_elsewhere(case):
    text = case[3].replace(script(LIBRARY), "")  # which names its own home and that of XML
    page = Page(text)
    assert not any("src" in attributes for attributes in page.all("script"))
    names = {tag for tag, _ in page.elements}
    assert not names & {
        "link",
        "iframe",
        "object",
        "embed",
        "img",
        "image",
        "form",
        "base",
        "foreignobject",
    }
    assert "http://" not in text
    assert "https://" not in text
    assert "@import" not in text
    for _, attributes in page.elements:
        assert not any(name.startswith("on") for name in attributes)
        for name in ("href", "src", "xlink:href"):
            assert attributes.get(name, "#").startswith("#")
    assert set(re.findall(r"url\((.)", text)) <= {"#"}


def policy_of(page: Page) -> dict[str, list[str]]:
    policy = next(a["content"] for a in page.all("meta") if a.get("http-equiv") == "Content-Security-Policy")
    return {rule.split()[0]: rule.split()[1:] for rule in policy.split(";")}


def hash_of(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def test_the_content_policy_allows_our_own_scripts_by_their_hashes_and_nothing_to_be_loaded(case):
    rules = policy_of(Page(case[3]))
    run = re.findall(r"<script>(.*?)</script>", case[3], flags=re.DOTALL)
    assert len(run) >= 4
    assert sorted(rules["script-src"]) == sorted(map(hash_of, run))
    assert rules["default-src"] == ["'none'"]
    assert rules["style-src"] == ["'unsafe-inline'"]  # Bokeh writes styles of its own while it runs
    assert rules["img-src"] == ["data:"]


def test_without_linked_views_the_content_policy_allows_the_one_style_sheet(case, copied):
    for file in FILES:
        (copied / file).unlink()
    text = write(copied, case[1], case[2])
    page = Page(text)
    style = re.search(r"<style>(.*?)</style>", text, flags=re.DOTALL)
    assert policy_of(page)["style-src"] == [hash_of(style[1])]
    assert len(page.all("style")) == 1
    assert not any("style" in attributes for _, attributes in page.elements)


def test_headings_step_down_one_level_at_a_time(case):
    levels = [int(tag[1]) for tag, _ in Page(case[3]).elements if re.fullmatch(r"h[1-6]", tag)]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(after - before <= 1 for before, after in pairwise(levels))


def test_every_picture_has_a_role_a_title_and_a_description(case):
    pictures = re.findall(r"<svg.*?</svg>", without_scripts(case[3]), flags=re.DOTALL)
    drawn = [ET.fromstring(text) for text in pictures]
    named = [svg for svg in drawn if svg.get("aria-hidden") != "true"]
    assert len(named) >= 15
    for svg in named:
        assert svg.get("role") == "img"
        title, described = svg[0], svg[1]
        assert svg.get("aria-labelledby").split() == [title.get("id"), described.get("id")]
        assert len(title.text) > 3
        assert len(described.text) > 10
        assert [element.tag for element in svg.iter() if element.tag == "text"] == []  # letters are outlines


def test_tables_have_captions_and_headers_with_scope(case):
    page = Page(case[3])
    tables = len(page.all("table"))
    assert tables >= 7
    assert len(page.all("caption")) == tables
    assert {a.get("scope") for a in page.all("th")} == {"col", "row"}


def test_sections_come_in_the_order_in_which_a_reader_asks(case):
    ids = [a["id"] for tag, a in Page(case[3]).elements if tag == "h2"]
    assert ids == ["answer", "key-figures", "explore-title", "bound", "times", "stills-title", "mesh",
                   "simulation", "gates", "checks", "not-evaluated", "inputs"]  # fmt: skip
    text = case[3]
    first = [text.index(f'id="{name}"') for name in ("answer", "figure-bracket", "key-figures")]
    assert first == sorted(first)
    stills = text[text.index('<details id="stills"') :]
    stills = stills[: stills.index("</section>")]
    assert re.findall(r'<h3 class="sub" id="([a-z]+)"', stills) == ["map", "speed", "acceleration", "margins"]


def test_what_fails_stands_before_the_three_sentences(case):
    text = case[3]
    assert text.index('class="failing"') < text.index('class="lead"')
    lead = re.search(r'<p class="lead">(.*?)</p>', text, flags=re.DOTALL)[1]
    assert lead.count("<span>") == 3


def test_the_answer_repeats_the_figures_of_the_result(case):
    _, _, result, text = case
    said = Page(text).text.replace("\u00a0", " ")
    for name in ("refined", "collocation", "voronoi_route"):
        assert f"{result['plans'][name]['travel_time']:.3f} s" in said
    assert "Refined, but 1 gate fails" in said
    assert "Refinement gap : 8.00 %, must be ≤ 5 %." in said


def test_the_first_gate_in_the_table_is_the_one_that_fails(case):
    text = case[3]
    table = text[text.index("Gates: what the result promises") :]
    assert table.index("Refinement gap") < table.index("Certified gap") < table.index("Braking margin")


def test_a_named_gate_without_a_value_is_the_first_of_the_failing_ones(case, copied):
    gates = [dict(gate, named=gate["name"] == "certified_gap") for gate in case[2]["gates"]]
    said = Page(write(copied, case[1], case[2] | {"gates": gates})).text
    assert "Refined, but 2 gates fail" in said
    first = said.index("Certified gap : no value, must be ≤ 3 %. no lower bound was computed")
    assert first < said.index("Refinement gap : 8.00 %, must be ≤ 5 %.")
    assert "2 of 4 gates hold." in said
    assert "Not evaluated: " not in said


def test_a_gate_without_a_stage_is_not_evaluated_and_says_why(case):
    said = Page(case[3]).text
    assert "Not evaluated: certified gap." in said
    assert "no lower bound was computed" in said


def test_what_a_model_does_not_promise_is_no_failure(case):
    said = Page(case[3]).text
    assert "○ not promised" in said
    assert "The variational optimum itself breaks the steering limit" in said


def test_the_same_inputs_give_the_same_bytes_whatever_the_user_has_set(case):
    folder, scenario, result, text = case
    with matplotlib.rc_context({"font.size": 40.0, "axes.facecolor": "red", "text.usetex": False}):
        again = write(folder, scenario, json.loads(json.dumps(result)))
        assert matplotlib.rcParams["font.size"] == 40.0
    assert again == text


FILES = ("trajectory.csv", "simulation.csv", "scenario.yaml", "trajectories/voronoi_route.csv",
         "trajectories/collocation.csv", "trajectories/refined.csv")  # fmt: skip


def test_missing_files_are_named_where_their_pictures_would_be(case, copied):
    gone = (*FILES[:3], "trajectories/collocation.csv")
    for file in gone:
        (copied / file).unlink()
    said = Page(write(copied, case[1], case[2])).text
    for file in gone:
        assert re.search(rf"{file} (was not written|cannot be read)", said), file


def test_without_any_evidence_there_still_is_a_page(case, copied):
    for file in FILES:
        (copied / file).unlink()
    said = Page(write(copied, case[1], {}, ReportExtras())).text
    assert "No verdict" in said
    assert "There is no motion to execute" in said
    assert said.count("Not shown.") >= 7


HEADER = "t,x,y,heading,v,a,curvature,clearance\n"


@pytest.mark.parametrize(
    "content",
    [
        "",
        "t,x,y\n0,0,0\n",
        "not a table",
        HEADER + "0,0,0,0,0,0,0,nan\n1,1,1,1,1,1,1,1\n",
        HEADER + "2,0,0,0,0,0,0,1\n1,1,1,1,1,1,1,1\n",
        HEADER + "1,0,0,0,0,0,0,1\n",
        HEADER + "0,a\n",
    ],
)
def test_a_broken_trajectory_is_a_reason_and_not_an_error(tmp_path, content):
    (tmp_path / "trajectory.csv").write_text(content)
    found = read_evidence(tmp_path)
    assert found.executed is None
    assert found.reasons["trajectory.csv"].startswith("trajectory.csv ")


def test_the_reason_stands_in_place_of_the_picture(case, tmp_path):
    (tmp_path / "trajectories").mkdir()
    for name in ("trajectory", "trajectories/refined", "trajectories/collocation"):
        (tmp_path / f"{name}.csv").write_bytes(b"\xff\xfe\x00")
    said = Page(write(tmp_path, case[1], case[2])).text
    assert "No motion to draw: trajectory.csv" in said


@pytest.mark.parametrize(
    "result",
    [
        {"plans": None, "gates": [None, 3, {"name": None}, {"name": "new_gate", "passed": "yes"}],
         "checks": {"a": 1}, "gaps": [1], "verdict": ["refined"], "missing": [{}], "executed": 3},
        {"plans": {"refined": {"travel_time": "soon"}, "mystery": {"travel_time": 3.0, "length": math.nan}},
         "versions": {"a": None}, "gates": [{"name": "new_gate", "value": 1, "limit": 2, "passed": "yes"}]},
    ],
)  # fmt: skip
def test_a_result_of_another_shape_still_gives_a_page(case, result):
    folder, scenario, *_ = case
    file = folder / "other.html"
    write_report(file, scenario=scenario, result=result, folder=folder, extras=extras())
    text = file.read_text()
    file.unlink()
    assert "nan" not in Page(text).text.lower().split()


HOSTILE = (
    "</style></script><script>alert(1)</script><img src=x onerror=alert(2)>{{7*7}}{% raw %}&lt;b&gt; "
    "$\\frac{1}{0}$ \u202eevil\u202c \u0000\u001b[31m " + "W" * 400 + " مرحبا 漢字"
)


def hostile_scenario() -> Scenario:
    """Names that the loader would partly refuse: the page does not lean on it."""
    scenario = warehouse()
    world = scenario.problem.world
    obstacles = [replace(obstacle, name=HOSTILE[i:]) for i, obstacle in enumerate(world.obstacles)]
    renamed = World.build(np.array(world.boundary.exterior.coords)[:-1], obstacles)
    problem = replace(scenario.problem, world=renamed)
    return replace(scenario, name=HOSTILE, description=HOSTILE, problem=problem)


def test_text_from_files_is_never_markup(tmp_path):
    result = write_folder(tmp_path / "case", warehouse())
    scenario = hostile_scenario()
    (tmp_path / "case" / "scenario.yaml").write_text(HOSTILE, encoding="utf-8")
    for gate in result["gates"]:
        gate["reason"] = HOSTILE
    for check in result["checks"]:
        check |= {"name": HOSTILE, "trajectory": HOSTILE, "unit": HOSTILE, "message": HOSTILE}
    result["plans"][HOSTILE] = {"travel_time": 30.0, "length": 40.0, "model": HOSTILE, "solver": HOSTILE}
    result["missing"] = [{"stage": HOSTILE, "reason": HOSTILE}]
    result["versions"] = {HOSTILE: HOSTILE}
    result["files"] = {HOSTILE: HOSTILE}
    result["scenario_sha256"] = HOSTILE
    result["reasons"] = [HOSTILE]
    text = write(
        tmp_path / "case",
        scenario,
        result,
        ReportExtras(history={HOSTILE: HISTORY["refined"]}, timings={HOSTILE: 1.0}),
    )
    page = Page(text)
    assert not {tag for tag, _ in page.elements} & {"img", "b"}
    run = re.findall(r"<script>(.*?)</script>", text, flags=re.DOTALL)
    assert sorted(map(hash_of, run)) == sorted(policy_of(page)["script-src"])  # none but ours
    assert not any(name.startswith("on") for _, attributes in page.elements for name in attributes)
    assert "<script>alert(1)</script>" in page.text  # still readable, as text
    assert page.text.count("{{7*7}}{% raw %}&lt;b&gt; $\\frac{1}{0}$") >= 10  # and never worked out
    assert not re.search("[\u0000-\u0008\u000b-\u001f\u202a-\u202e\u2066-\u2069]", text)
    for svg in re.findall(r"<svg.*?</svg>", without_scripts(text), flags=re.DOTALL):
        ET.fromstring(svg)


def test_the_scenario_file_stands_in_the_page_letter_by_letter(case):
    folder, *_, text = case
    code = re.search(r"<pre><code>(.*?)</code></pre>", text, flags=re.DOTALL)
    shown = Page(f"<p>{code[1]}</p>").texts[0][1]
    assert shown == (folder / "scenario.yaml").read_text().strip()


def test_a_failed_write_leaves_the_old_page(case, copied, monkeypatch):
    for file in FILES:  # nothing to draw: what is written does not matter here
        (copied / file).unlink()
    (copied / "report.html").write_text("old")

    def no_space(*_: object) -> Path:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", no_space)
    with pytest.raises(OSError, match="No space left"):
        write(copied, case[1], case[2])
    assert (copied / "report.html").read_text() == "old"
    assert sorted(p.name for p in copied.iterdir() if p.name.startswith(".")) == []


def test_the_index_lists_every_scenario_with_its_link(case, tmp_path):
    result = case[2]
    failed = {"verdict": "failed", "plans": {}, "gates": []}
    names = ["warehouse", "a/../b?<i>#", "broken"]
    write_index(
        tmp_path / "index.html", [(names[0], result), (names[1], {"verdict": "refined"}), (names[2], failed)]
    )
    text = (tmp_path / "index.html").read_text()
    page = Page(text)
    assert [a["href"] for a in page.all("a")] == [
        "./broken/report.html",  # failing ones first, then by name
        "./warehouse/report.html",
        "./a%2F..%2Fb%3F%3Ci%3E%23/report.html",
    ]
    assert page.all("i") == []
    assert "1 with a good verdict" in page.text
    assert "2 failed or with a failing gate" in page.text
    assert "http" not in text.replace("http-equiv", "")


def test_an_empty_index_says_so(tmp_path):
    write_index(tmp_path / "index.html", [])
    assert "No scenario has been run yet." in Page((tmp_path / "index.html").read_text()).text
