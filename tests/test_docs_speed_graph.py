"""What the page about the speed graph shows is run as it stands; its figures of the study are those kept."""

import json
import re
from pathlib import Path

import pytest
import yaml

from benchmarks.figures import with_study
from benchmarks.ranking import rows_of, run, summary
from vnav_drake import load_scenario
from vnav_drake.speed_graph import speed_graph

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs" / "speed_graph.md").read_text(encoding="utf-8")


def test_the_tutorial_runs(monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    names: dict[str, object] = {}
    for block in re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL):
        exec(compile(block, "docs/speed_graph.md", "exec"), names)
    first, second, third, narrow, exact = capsys.readouterr().out.splitlines()
    # Least times from an independent study with numpy: 25.4416876 s along the bottom and the left corridor,
    # 28.433 s over the top, 69.2 s through the three gaps.
    assert re.fullmatch(r"1 25\.4417 s [\d.]+ m certified", first)
    assert re.fullmatch(r"2 28\.43\d\d s [\d.]+ m certified", second)
    assert third.startswith("3 ")
    assert third.endswith(" certified")
    assert narrow.startswith("69.2 s through ")
    assert all(gate in narrow for gate in ("O4/O6", "O3/O4", "O1/O3"))
    seconds, bound = re.fullmatch(r"([\d.]+) s, at most (\S+) s too long", exact).groups()
    assert float(seconds) == pytest.approx(25.4416876, rel=1e-7)
    assert float(bound) <= 1e-7 * float(seconds)


def test_the_plan_shown_for_scenario_files_is_read_and_obeyed(tmp_path):
    (block,) = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    content = yaml.safe_load((ROOT / "scenarios" / "warehouse.yaml").read_text(encoding="utf-8"))
    content["plan"] = yaml.safe_load(block)["plan"]
    file = tmp_path / "shown.yaml"
    file.write_text(yaml.safe_dump(content), encoding="utf-8")
    scenario = load_scenario(file)
    plan = scenario.plan
    found = speed_graph(
        scenario.problem, classes=1, graph=plan.graph, through=plan.through, with_published=False
    )
    tokens = found.classes[0].name.replace("-", "").split(", ")
    places = [tokens.index(gate) for gate in content["plan"]["through"]]
    assert places == sorted(places)


def test_the_study_on_the_page_is_the_one_kept():
    study = json.loads((ROOT / "docs" / "data" / "ranking.json").read_text(encoding="utf-8"))
    assert study["worlds"] == 1000
    assert with_study(PAGE, study) == PAGE


def _row(seed, family, best, sampled, others, certified):
    return {
        "seed": seed,
        "family": family,
        "vertices": 10,
        "best": best,
        "certified": certified,
        "failed": [[] if c else ["node"] for c in certified],
        "bound": [1e-13] * len(best),
        "refined": 3,
        "uncertified": certified.count(False),
        "order": {"sampled": sampled, "published": others, "voronoi": others},
        "excess": [0.01],
        "seconds": 1.0,
    }


def test_shares_and_regret_of_a_study_count_worlds_with_a_path():
    # Two worlds with a path: one ranked rightly, one whose first class takes 25 % longer than its second, the
    # fastest. The other graphs do not have that one at all (None: not refined).
    rows = [
        _row(0, "mixed", [1.0, 2.0, 3.0], [1.0, 2.0, 3.0], [1.0, 3.0, 2.0], [True, True, True]),
        _row(1, "near", [4.0, 5.0, 6.0], [5.0, 4.0, 6.0], [5.0, 6.0, None], [True, True, False]),
        {"seed": 2, "family": "near", "refused": "NoPathError", "message": "", "seconds": 0.1},
        {"seed": 3, "crash": "TimeoutError: "},
    ]
    s = summary(rows)
    assert (s["worlds"], s["with_path"], s["crashed_or_hung"], s["refused"]) == (4, 2, 1, {"NoPathError": 1})
    assert s["certified_of_three_best"] == pytest.approx(5 / 6)
    assert s["certified_best"] == 1.0
    assert s["worlds_with_three_certified"] == 1
    assert s["failed_of_three_best"] == {"node": 1}
    sampled, published = s["graphs"]["sampled"], s["graphs"]["published"]
    assert (sampled["best_within"]["1"], sampled["best_within"]["2"]) == (0.5, 1.0)
    assert sampled["three_best_within"]["3"] == 1.0
    assert sampled["regret"]["max"] == pytest.approx(0.25)
    assert (published["best_within"]["10"], published["never_within"]) == (0.5, 1)
    assert published["three_best_within"]["3"] == 0.5


def test_a_study_cut_short_goes_on_after_its_last_whole_row(tmp_path):
    file = tmp_path / "rows.jsonl"
    file.write_text('{"seed": 1}\n{"seed": 0}\n{"seed": 2, "best": [{}', encoding="utf-8")
    assert [row["seed"] for row in rows_of(file)] == [0, 1]
    run([0, 1], file, jobs=1)  # nothing left to do
    assert file.read_text(encoding="utf-8") == '{"seed": 1}\n{"seed": 0}\n'
    assert rows_of(tmp_path / "none.jsonl") == []
