"""Whatever makes a run fail: exit code, JUnit file and pytest items say the same.

One real run is planned and driven; each case changes its evidence or the limits and has it judged again, on
the way that the command and the pytest plugin take.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from judged import scenario, scenario_bytes
from result_folder import CHANGES

import verify.pytest_session  # noqa: F401  (before pytester looks which modules there are)
from verify import evidence, pipeline
from verify.__main__ import main
from verify.judge import judge
from verify.judge.gates import GATE_NAMES
from verify.pipeline import Outcome
from verify.stages import Missing

pytest_plugins = "pytester"

NAME = CHANGES["name"]
REFINED = f"{evidence.TRAJECTORIES}/refined.csv"
Change = Callable[[Path], None]


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    """The folder of a run, without report and replay."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pipeline, "write_report", lambda file, **_: file.write_text("not drawn"))
        patch.setattr(pipeline, "show_replay", lambda *_: None)
        return pipeline.run_scenario(scenario(**CHANGES), tmp_path_factory.mktemp("made")).report.parent


@pytest.fixture
def answers(made, pytester, monkeypatch):
    """Exit code and {case: status} of the command, then of pytest, for changed evidence or text."""
    monkeypatch.delenv("PYTEST_ADDOPTS", raising=False)
    pytester.makeini("[pytest]\n")  # not that of a folder above

    def ask(
        *limits: str,
        change: Change = lambda _: None,
        text: bytes | None = None,
        missing=(),
        faster=None,
        options=(),
    ):
        def again(asked, out, *, overrides, **_):
            folder = out / asked.name
            shutil.rmtree(folder, ignore_errors=True)
            shutil.copytree(made, folder)
            (folder / evidence.SCENARIO).write_bytes(asked.data)
            change(folder)
            judgement = judge(folder, overrides)
            result = json.loads((made / evidence.RESULT).read_text()) | judgement.as_result()
            evidence.write_result(folder, result)  # what the index tells
            report = folder / evidence.REPORT
            return Outcome(judgement=judgement, result=result, report=report, missing=missing)

        monkeypatch.setattr(pipeline, "run_scenario", again)
        file = pytester.path / "s.yaml"
        file.write_bytes(scenario_bytes(**CHANGES) if text is None else text)
        gates = [*options, *(part for limit in limits for part in ("--gate", limit))]
        if faster is not None:
            store("baseline.json", str(file), faster)
            gates += ["--baseline", "baseline.json"]
        code = main([str(file), "--out", "reports", "--junit", "command.xml", *gates])
        gates = [part.replace("--", "--verify-") for part in gates]
        ended = pytester.runpytest_inprocess("--verify", "--junitxml=pytest.xml", *gates, file.name)
        return code, statuses("command.xml"), int(ended.ret), statuses("pytest.xml")

    def store(name: str, file: str, faster: float) -> None:
        """This run as a baseline, but that everything took `faster` times as long then."""
        assert main([file, "--out", "reports", "--baseline", name, "--update-baseline"]) == 0
        document = json.loads((pytester.path / name).read_text())
        figures = document["scenarios"][NAME]["metrics"]
        figures |= {key: value * faster for key, value in figures.items() if key.startswith("travel_time.")}
        (pytester.path / name).write_text(json.dumps(document))

    def statuses(name: str) -> dict[str, str]:
        cases = ElementTree.parse(pytester.path / name).iter("testcase")
        return {case.get("name"): _status(case) for case in cases}

    return ask


def _status(case: ElementTree.Element) -> str:
    tags = [child.tag for child in case if child.tag in ("failure", "error", "skipped")]
    return tags[0] if tags else "passed"


def bad(statuses: dict[str, str]) -> set[str]:
    return {name for name, status in statuses.items() if status in ("failure", "error")}


def forge_motion(folder: Path) -> None:
    """The same path in 90 % of the time, every column consistent: faster than the clearance allows."""
    header = (folder / REFINED).read_text().partition("\n")[0]
    rows = np.loadtxt(folder / REFINED, delimiter=",", skiprows=1)
    rows[:, [0, 4, 5]] *= (0.9, 1 / 0.9, 1 / 0.81)  # t, v, a
    np.savetxt(folder / REFINED, rows, fmt="%.17g", delimiter=",", header=header, comments="")
    shutil.copy(folder / REFINED, folder / evidence.EXECUTED)


def forge_stops(folder: Path) -> None:
    """One stop falls: a tilt of 1 rad at its end."""
    with np.load(folder / evidence.STOPS) as archive:
        arrays = dict(archive)
    arrays["tilt"][arrays["first"][1] - 1] = 1.0
    np.savez_compressed(folder / evidence.STOPS, **arrays)


def without(name: str) -> Change:
    return lambda folder: (folder / name).unlink()


def test_the_run_as_it_is_passes_everywhere(answers):
    code, junit, ended, items = answers()
    assert (code, ended) == (0, 0)
    assert junit == items == dict.fromkeys((*GATE_NAMES, "verdict"), "passed")


# A numerical optimum differs from a closed form, a way from rest to rest takes longer than the proven cost of
# its ends, a bound is below what it bounds: all gaps are positive. In a room 8 m wide no clearance is 8 m.
# Other limits of zero may hold, so that evidence is forged for them.
@pytest.mark.parametrize(
    ("name", "limits", "change"),
    [
        ("analytic_gap", ["analytic_gap=0"], None),
        ("refinement_gap", ["refinement_gap=0"], None),
        ("certified_gap", ["certified_gap=0"], None),
        ("constraint_violation", [], forge_motion),
        ("braking_margin", ["braking_margin=8"], None),
        ("braking_margin", [], forge_motion),
        ("emergency_stops", [], forge_stops),
        ("verdict", [], forge_motion),
    ],
)
def test_a_failing_gate_fails_everywhere(answers, name, limits, change):
    code, junit, ended, items = answers(*limits, **({} if change is None else {"change": change}))
    assert (code, ended) == (1, 1)
    assert name in bad(junit)
    assert junit == items
    if change is None:  # a limit alone fails nothing but its gate
        assert bad(items) == {name}


def test_many_gates_at_once_fail_everywhere(answers):
    def forge(folder: Path) -> None:
        forge_stops(folder)
        forge_motion(folder)

    code, junit, ended, items = answers("analytic_gap=0", "certified_gap=0", change=forge)
    assert (code, ended) == (1, 1)
    assert junit == items
    assert bad(items) == {*GATE_NAMES, "verdict"} - {"refinement_gap"}  # too fast a motion is no worse there


def test_what_nobody_named_and_was_not_evaluated_is_skipped_everywhere(answers):
    code, junit, ended, items = answers(change=without(evidence.CERTIFICATE))
    assert (code, ended) == (0, 0)
    assert junit == items
    assert {name for name, status in items.items() if status == "skipped"} == {"certified_gap"}


@pytest.mark.parametrize("how", ["option", "scenario"])
def test_a_named_gate_without_a_value_fails_everywhere(answers, how, pytester):
    gates = {**CHANGES["gates"], "certified_gap": 0.03}
    text = scenario_bytes(**{**CHANGES, "gates": gates}) if how == "scenario" else None
    limits = ["certified_gap=0.03"] if how == "option" else []
    code, junit, ended, items = answers(*limits, change=without(evidence.CERTIFICATE), text=text)
    assert (code, ended) == (3, 1)
    assert junit == items
    assert bad(items) == {"certified_gap"}
    index = (pytester.path / "reports" / "index.html").read_text(encoding="utf-8")
    assert 'data-standing="bad"' in index
    assert "1 failed, 5 passed" in index


def test_a_stage_that_could_not_finish_fails_everywhere(answers):
    code, junit, ended, items = answers(missing=(Missing(stage="collocation", reason="no solver"),))
    assert (code, ended) == (3, 1)
    assert bad(junit) == {"collocation"}
    assert bad(items) == {"verdict"}  # pytest must know its items before anything runs


def test_a_stage_that_only_serves_a_gate_that_nobody_named_fails_nothing(answers):
    stage = Missing(stage="lower_bound", reason="no solver", only_for="certified_gap")
    code, junit, ended, items = answers(change=without(evidence.CERTIFICATE), missing=(stage,))
    assert (code, ended) == (0, 0)
    assert junit == items


@pytest.mark.parametrize(("faster", "expected"), [(0.5, 1), (1.0, 0), (2.0, 0)])
def test_a_run_slower_than_the_stored_one_fails_everywhere(answers, faster, expected):
    code, junit, ended, items = answers(faster=faster)
    assert (code, ended) == (expected, expected)
    assert bad(junit) == ({"baseline_travel_times"} if expected else set())
    assert bad(items) == ({"baseline"} if expected else set())
    # one item stands for all cases of the baseline
    assert {name: s for name, s in junit.items() if not name.startswith("baseline")} == {
        name: s for name, s in items.items() if name != "baseline"
    }


def test_a_scenario_that_the_baseline_does_not_hold_fails_everywhere(answers, pytester):
    (pytester.path / "empty.json").write_text('{"schema": 1, "scenarios": {}}')
    code, junit, ended, items = answers(options=["--baseline", "empty.json"])
    assert (code, ended) == (1, 1)
    assert (bad(junit), bad(items)) == ({"baseline_run"}, {"baseline"})


def test_bad_input_is_an_error_everywhere(answers):
    code, junit, ended, items = answers(text=scenario_bytes(**{**CHANGES, "goal": {"position": [-1.0, 3.0]}}))
    assert (code, ended) == (2, 2)
    assert list(junit.values()) == list(items.values()) == ["error"]
