"""The command line: exit codes, standard output, messages, JUnit."""

from __future__ import annotations

import json
import os
import select
import stat
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from judged import BASE, scenario_bytes
from result_folder import CHANGES, NO_STOPS, contents, copy_to, outcome
from shapely.errors import GEOSException

from verify import batch, cli, evidence, pipeline, planning
from verify.__main__ import main
from verify.evidence import EvidenceError
from verify.judge import GATE_NAMES
from verify.junit import Suite, write_junit
from verify.progress import Progress
from vnav_drake.problem import PlanningError
from vnav_drake.scenario import Scenario

NAMES = "around_a_point"
pytestmark = pytest.mark.usefixtures("unreported")


def write(folder: Path, file: str = "good.yaml", **changes: object) -> Path:
    path = folder / file
    path.write_bytes(scenario_bytes(**{**CHANGES, "simulation": NO_STOPS, **changes}))
    return path


@pytest.fixture
def finished(monkeypatch):
    """Every run that begins ends at once, with the result made before."""

    def run(_scenario: Scenario, out: Path, **_: object) -> pipeline.Outcome:
        return replace(outcome(), report=copy_to(out) / evidence.REPORT)

    monkeypatch.setattr(pipeline, "run_scenario", run)


def test_a_good_scenario_prints_one_line_and_exits_0(tmp_path, capsys):
    out = tmp_path / "out"
    assert main([str(write(tmp_path)), "--out", str(out)]) == 0
    captured = capsys.readouterr()
    lines = captured.out.splitlines()
    assert len(lines) == 1
    assert lines[0].startswith(f"{NAMES}: refined")
    assert lines[0].endswith(str(out / NAMES / "report.html"))
    assert captured.err == ""
    index = (out / "index.html").read_text()
    assert NAMES in index
    assert sorted(path.name for path in out.iterdir()) == [NAMES, "index.html"]


def test_a_failing_gate_exits_1_and_is_printed_and_rechecked_with_its_limit(tmp_path, capsys):
    out, junit = tmp_path / "out", tmp_path / "junit.xml"
    arguments = ["--gate", "refinement_gap=0.0001", "--gate", "braking_margin=0", "--junit", str(junit)]
    assert main([str(write(tmp_path)), "--out", str(out), *arguments]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 2
    assert lines[1].strip().startswith("gate refinement_gap: fails")
    assert "from the command line" in lines[1]
    result = json.loads((out / NAMES / "result.json").read_text())
    assert result["gate_overrides"] == {"refinement_gap": 0.0001, "braking_margin": 0.0}
    gate = next(gate for gate in result["gates"] if gate["name"] == "refinement_gap")
    assert (gate["limit"], gate["passed"], gate["overridden"]) == (0.0001, False, True)
    assert main(["check", str(out / NAMES)]) == 1
    assert "gate refinement_gap: fails" in capsys.readouterr().out
    cases = {case.get("name"): case for case in ElementTree.parse(junit).iter("testcase")}
    assert set(cases) == {*GATE_NAMES, "verdict"}
    assert cases["refinement_gap"].find("failure") is not None
    assert cases["emergency_stops"].find("skipped") is not None
    assert cases["braking_margin"].find("failure") is None


def test_a_gate_the_scenario_names_without_a_stage_exits_3(tmp_path, capsys):
    gates = {"emergency_stops": 0, "refinement_gap": 0.5}
    assert main([str(write(tmp_path, gates=gates)), "--out", str(tmp_path / "out")]) == 3
    assert "gate emergency_stops: not evaluated" in capsys.readouterr().out


@pytest.mark.usefixtures("finished")
def test_one_bad_file_does_not_stop_the_others_and_the_worst_code_wins(tmp_path, capsys):
    bad = tmp_path / "bad.yaml"
    bad.write_text("schema: 1\nname: bad\nrobot: {radius: -1}\n")
    out = tmp_path / "out"
    code = main([str(bad), str(write(tmp_path)), str(tmp_path / "absent.yaml"), "--out", str(out)])
    captured = capsys.readouterr()
    assert code == 2
    assert len(captured.out.splitlines()) == 1
    assert "bad.yaml:3: robot.radius = -1" in captured.err
    assert "absent.yaml" in captured.err
    assert "Traceback" not in captured.err
    assert sorted(path.name for path in out.iterdir()) == [NAMES, "index.html"]


@pytest.mark.usefixtures("finished")
def test_two_scenarios_of_one_name_are_bad_input(tmp_path, capsys):
    first, second = write(tmp_path), write(tmp_path, "again.yaml")
    assert main([str(first), str(second), "--out", str(tmp_path / "out"), "--quiet"]) == 2
    captured = capsys.readouterr()
    assert "again.yaml" in captured.err
    assert "is also the name of" in captured.err
    assert captured.out == ""
    assert (tmp_path / "out" / NAMES / "result.json").exists()


def test_bad_input_touches_no_output(tmp_path, capsys):
    earlier = copy_to(tmp_path)
    before = contents(earlier)
    robot = {**BASE["robot"], "max_braking": 100.0}  # more than mu g
    bad = write(tmp_path, robot=robot)
    assert main([str(bad), "--out", str(tmp_path)]) == 2
    assert "max_braking = 100" in capsys.readouterr().err
    assert contents(earlier) == before


def test_no_path_is_bad_input(tmp_path, capsys):
    wall = {"obstacles": [{"vertices": [[6, 0], [6.5, 0], [6.5, 7.5], [6, 7.5]]}]}
    file = write(tmp_path, world={**CHANGES["world"], **wall})
    assert main([str(file), "--out", str(tmp_path / "out")]) == 2
    assert "good.yaml" in capsys.readouterr().err
    assert list((tmp_path / "out").iterdir()) == []


def test_a_foreign_folder_is_never_replaced(tmp_path, capsys):
    theirs = tmp_path / "out" / NAMES
    theirs.mkdir(parents=True)
    (theirs / "thesis.tex").write_text("years of work")
    assert main([str(write(tmp_path)), "--out", str(tmp_path / "out")]) == 2
    assert "not replaced" in capsys.readouterr().err
    assert (theirs / "thesis.tex").read_text() == "years of work"


def test_an_unusable_out_is_bad_input(tmp_path, capsys):
    (tmp_path / "file").write_text("x")
    assert main([str(write(tmp_path)), "--out", str(tmp_path / "file")]) == 2
    assert main([str(write(tmp_path)), "--junit", str(tmp_path / "absent/j.xml")]) == 2
    assert "Traceback" not in capsys.readouterr().err


def test_a_stage_that_cannot_finish_exits_3_and_is_named(tmp_path, capsys, monkeypatch):
    def fail(*_: object, **__: object) -> None:
        raise PlanningError("out of iterations")

    monkeypatch.setattr(planning, "plan_full", fail)
    junit = tmp_path / "j.xml"
    assert main([str(write(tmp_path)), "--out", str(tmp_path / "out"), "--junit", str(junit)]) == 3
    assert "missing refined: out of iterations" in capsys.readouterr().out
    names = [
        case.get("name")
        for case in ElementTree.parse(junit).iter("testcase")
        if case.find("error") is not None
    ]
    assert names == ["refined", "simulation"]


def test_an_error_of_the_system_exits_3(tmp_path, capsys, monkeypatch):
    def fail(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device", "report.html")

    monkeypatch.setattr(pipeline, "write_report", fail)
    assert main([str(write(tmp_path)), "--out", str(tmp_path / "out")]) == 3
    assert "report.html: No space left on device" in capsys.readouterr().err
    assert list((tmp_path / "out").iterdir()) == []


@pytest.mark.parametrize(
    "fault",
    [
        RuntimeError("wrapped\nby Drake"), ZeroDivisionError("by zero"), MemoryError(), TypeError("x"),
        AttributeError("x"), AssertionError(), ImportError("libX11.so.6"), GEOSException("TopologyException"),
        np.linalg.LinAlgError("singular"), EvidenceError("trajectory.csv: larger than 1 bytes"),
    ],
    ids=lambda fault: type(fault).__name__,
)  # fmt: skip
@pytest.mark.parametrize("loudness", [[], ["--verbose"]])
def test_a_fault_in_one_scenario_is_one_line_and_the_others_run(
    tmp_path, capsys, monkeypatch, fault, loudness
):
    def run(scenario: Scenario, *_: object, **__: object) -> pipeline.Outcome:
        if scenario.name == "first":
            raise fault
        return outcome()

    monkeypatch.setattr(pipeline, "run_scenario", run)
    files = [str(write(tmp_path, "first.yaml", name="first")), str(write(tmp_path))]
    junit = tmp_path / "j.xml"
    assert main([*files, "--out", str(tmp_path / "out"), "--junit", str(junit), *loudness]) == 3
    captured = capsys.readouterr()
    assert captured.out.startswith(f"{NAMES}: refined")
    said = captured.err.splitlines()
    assert said[-1].startswith("verify: first: ")
    assert said[-1].endswith("an earlier result is as it was")
    wanted = bool(loudness) and not isinstance(fault, EvidenceError)
    assert ("Traceback" in captured.err) == wanted
    assert len(said) == 1 or wanted
    assert ElementTree.parse(junit).getroot().get("errors") == "1"


def test_evidence_too_large_to_judge_exits_3(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(evidence, "MAX_BYTES", 10_000)  # the trajectories are larger
    assert main([str(write(tmp_path)), "--out", str(tmp_path / "out")]) == 3
    said = capsys.readouterr().err
    assert said.startswith(f"verify: {NAMES}: cannot be judged: ")
    assert "larger than 10000 bytes" in said
    assert list((tmp_path / "out").iterdir()) == []


def test_methods_of_chapter_two_are_planned_judged_and_told(tmp_path, capsys):
    plan = {"effort": "quick", "methods": ["dwa", "vc_method", "speed_graph"]}
    out = tmp_path / "out"
    assert main([str(write(tmp_path, plan=plan)), "--out", str(out)]) == 0
    line = capsys.readouterr().out
    result = json.loads((out / NAMES / "result.json").read_text())
    plans = result["plans"]
    assert {"vc_method", "dwa", "collocation", "refined"} <= set(plans)
    assert "voronoi_route" not in plans  # nobody asked for it, and others seed
    assert plans["dwa"]["reached"] is True
    for name in ("vc_method", "dwa"):
        assert f"{name} {plans[name]['travel_time']:.3f} s" in line
        assert plans[name]["travel_time"] >= plans["collocation"]["travel_time"]
    assert {row["method"] for row in plans["collocation"]["seeds"]} == {"speed_graph", "vc_method"}
    assert "comparison" not in plans["collocation"]  # of seeds: only where effort is full
    assert main(["check", str(out / NAMES)]) == 0


def loaded_by(*arguments: str) -> tuple[int, set[str]]:
    """Exit code of a command, and the top-level modules loaded when it ends."""
    code = (
        "import sys\nfrom verify.__main__ import main\n"
        "try: code = main(sys.argv[1:])\nexcept SystemExit as end: code = end.code\n"
        "print('\\n', *{name.partition('.')[0] for name in sys.modules})\nsys.exit(code)"
    )
    command = [sys.executable, "-c", code, *arguments]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    return run.returncode, set(run.stdout.splitlines()[-1].split())


def test_drake_is_loaded_only_to_plan(tmp_path):
    bad = tmp_path / "bad.yaml"
    bad.write_text("schema: 1\n")
    for code, *arguments in [
        (0, "schema"), (0, "--help"), (2, str(bad), "--out", str(tmp_path / "out")), (2, "import"),
        (0, "check", str(copy_to(tmp_path))),
    ]:  # fmt: skip
        ended, modules = loaded_by(*arguments)
        assert ended == code, arguments
        assert not modules & {"pydrake", "matplotlib", "pyvoronoi"}, arguments
    for arguments in (["schema"], ["--help"]):
        assert not loaded_by(*arguments)[1] & {"numpy", "scipy", "shapely"}, arguments


def test_the_command_line_knows_the_gates_that_the_judge_knows():
    assert cli._gate_names() == GATE_NAMES


@pytest.mark.parametrize(
    "arguments",
    [
        [], ["--gate", "x=1", "a.yaml"], ["--gate", "refinement_gap", "a.yaml"],
        ["--gate", "refinement_gap=nan", "a.yaml"], ["--gate", "refinement_gap=-1", "a.yaml"],
        ["--quiet", "--verbose", "a.yaml"], ["--unknown", "a.yaml"], ["check"], ["check", "a", "b"],
        ["schema", "x"],
    ],
)  # fmt: skip
def test_wrong_usage_exits_2(arguments, capsys):
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    assert caught.value.code == 2
    assert "usage:" in capsys.readouterr().err


@pytest.mark.parametrize("word", ["sweep", "import"])
def test_reserved_commands_say_so(word, capsys):
    assert main([word, "x"]) == 2
    assert "reserved" in capsys.readouterr().err


@pytest.mark.usefixtures("finished")
def test_a_scenario_file_may_be_named_like_a_command(tmp_path, monkeypatch, capsys):
    write(tmp_path, "check")
    monkeypatch.chdir(tmp_path)
    assert main(["./check", "--out", "out", "--quiet"]) == 0
    assert capsys.readouterr().out == ""


def test_schema_prints_a_json_schema(capsys):
    assert main(["schema"]) == 0
    assert "max_braking" in json.loads(capsys.readouterr().out)["$defs"]["RobotSpec"]["properties"]


def test_version_and_help_exit_0(capsys):
    for flag in ("--version", "--help"):
        with pytest.raises(SystemExit) as caught:
            main([flag])
        assert caught.value.code == 0
    assert "verify check" in capsys.readouterr().out


def test_open_shows_the_report_of_each_scenario(tmp_path, monkeypatch):
    shown: list[str] = []
    monkeypatch.setattr(batch.webbrowser, "open", shown.append)
    monkeypatch.setattr(pipeline, "run_scenario", lambda *_, **__: outcome())
    (tmp_path / "out").mkdir()
    assert main([str(write(tmp_path)), "--out", str(tmp_path / "out"), "--open", "--quiet"]) == 0
    assert shown == [outcome().report.absolute().as_uri()]


def test_verbose_prints_every_gate_and_check(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(pipeline, "run_scenario", lambda *_, **__: outcome())
    assert main([str(write(tmp_path)), "--out", str(tmp_path / "out"), "--verbose"]) == 0
    text = capsys.readouterr().out
    assert all(f"gate {name}:" in text for name in GATE_NAMES)
    assert "check friction_circle (refined): passed" in text


def test_a_reader_that_goes_away_leaves_no_trace():
    reader, writer = os.pipe()
    os.close(reader)
    command = [sys.executable, "-m", "verify", "schema"]
    run = subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, text=True, check=False)
    os.close(writer)
    assert (run.returncode, run.stderr) == (3, "")


@pytest.mark.parametrize(("ci", "shown"), [(False, True), (True, False)])
def test_progress_is_shown_on_a_terminal_but_not_under_ci(monkeypatch, ci, shown):
    master, slave = os.openpty()
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("CI", "1")
    if not ci:
        monkeypatch.delenv("CI")
    with os.fdopen(slave, "w") as terminal:
        monkeypatch.setattr(sys, "stderr", terminal)
        with Progress() as progress:
            progress.say("planning")
        terminal.flush()
        readable, _, _ = select.select([master], [], [], 0.0)
        written = os.read(master, 4096) if readable else b""
    os.close(master)
    assert bool(written) is shown


def test_progress_is_silent_without_a_terminal(capsys):
    with Progress() as progress, progress.paused():
        progress.say("planning")
    assert capsys.readouterr().err == ""


def test_junit_escapes_markup_and_what_xml_cannot_hold(tmp_path):
    file = tmp_path / "j.xml"
    write_junit(file, [Suite(name='<a> & "b"\x00\x1b', error="]]> \ud800 <script>\ufffe")])
    tree = ElementTree.parse(file)
    suite = next(tree.iter("testsuite"))
    assert suite.get("name") == '<a> & "b"\ufffd\ufffd'
    assert next(tree.iter("error")).text == "]]> \ufffd <script>\ufffd"
    assert tree.getroot().get("errors") == "1"


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_without_permission_is_unusable(tmp_path, capsys):
    out = tmp_path / "out"
    out.mkdir()
    out.chmod(stat.S_IRUSR | stat.S_IXUSR)
    assert main([str(write(tmp_path)), "--out", str(out)]) == 2
    assert "cannot be used" in capsys.readouterr().err
