"""docs/ci.md is followed as it stands; CI files hold to their schemas; the action's steps run as on GitHub.

What needs a network is replaced: `git clone` brings an empty library whose set-up is this environment.
"""

from __future__ import annotations

import glob
import json
import os
import re
import shlex
import subprocess
import sys
from importlib import resources
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import jsonschema
import pytest
import yaml

from verify import cli
from verify.baseline_file import read_baseline, update_baseline
from verify.cases import NAMES
from verify.pytest_plugin import pytest_addoption

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs" / "ci.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"(?:`([\w./-]+)`:\n\n)?```(\w+)\n(.*?)```", PAGE, re.DOTALL)
FILES = {name: text for name, _, text in BLOCKS if name}
WORKFLOW, GITLAB = ".github/workflows/verify.yml", ".gitlab-ci.yml"
ACTION: dict[str, Any] = yaml.safe_load((ROOT / "action.yml").read_text(encoding="utf-8"))
STEPS = ACTION["runs"]["steps"]
MARK = "\x1e"  # between the output of one block and the next

# Drawing the report takes most of a small run, and has tests of its own.
UNDRAWN = """\
from verify import pipeline
pipeline.write_report = lambda file, **_: file.write_text("not drawn")
"""
SET_UP = f"""#!/usr/bin/env bash
set -euo pipefail
cd "$(dirname "${{BASH_SOURCE[0]}}")/.."
mkdir -p "$1/bin"
for program in python verify; do cp "$LIBRARY/python" "$1/bin/$program"; done
echo "PATH=$PWD/$1/bin:{Path(sys.executable).parent}:$PATH" >"$1/bin/activate"
"""
PYTHON = f"""#!/bin/sh
[ "$1 $2" = "-m verify" ] && shift 2
[ "$1" = check ] && exec {sys.executable} -m verify "$@"
exec {sys.executable} -c "import sys, undrawn, verify.__main__ as v; sys.exit(v.main())" "$@"
"""
GIT = """#!/bin/sh
[ "$*" = "clone https://github.com/OWNER/vnav-drake.git" ] && cp -R "$LIBRARY" vnav-drake
"""


@pytest.fixture(scope="module")
def place(tmp_path_factory) -> Path:
    """A folder with the stand-ins, and where the page's blocks have been run one after the other."""
    place = tmp_path_factory.mktemp("ci")
    executable(place / "bin/git", GIT)
    executable(place / "bin/python", f'#!/bin/sh\nexec "{sys.executable}" "$@"\n')  # a runner has one
    executable(place / "library/tools/set-up", SET_UP)
    executable(place / "library/python", PYTHON)
    executable(place / "undrawn/undrawn.py", UNDRAWN)
    (place / "library/requirements.lock").symlink_to(ROOT / "requirements.lock")
    (place / "work").mkdir()
    (place / "work/pytest.ini").write_text("[pytest]\n")  # not that of a folder above
    return place


def executable(file: Path, text: str) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text)
    file.chmod(0o755)


def environment(place: Path, **more: str) -> dict[str, str]:
    kept = {key: text for key, text in os.environ.items() if not key.startswith(("PYTEST_", "GITHUB_"))}
    paths = [str(place / "undrawn"), *filter(None, [os.environ.get("PYTHONPATH")])]
    return {
        **kept,
        "PATH": f"{place / 'bin'}:{os.environ['PATH']}",
        "LIBRARY": str(place / "library"),
        "PYTHONPATH": os.pathsep.join(paths),
        **more,
    }


@pytest.fixture(scope="module")
def followed(place) -> list[tuple[str, str, str]]:
    """Command, what it prints, what the page says it prints: of every block for the shell, in order."""
    script, asked = [], []
    for number, (name, kind, text) in enumerate(BLOCKS):
        if name:
            (place / f"block-{number}").write_text(text)
            script.append(f"mkdir -p {Path(name).parent}; cp {place / f'block-{number}'} {name}\n")
        elif kind == "sh":
            script.append(f"{text}printf '{MARK}'\n")
            following = BLOCKS[number + 1]
            asked.append((text, following[2] if following[1] == "text" else ""))
            if "pytest" in text:
                script[-1] = f"export PYTEST_PLUGINS=undrawn\n{script[-1]}"
    done = subprocess.run(
        ["bash", "-c", "".join(script)],
        cwd=place / "work",
        env=environment(place),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stderr == ""
    printed = done.stdout.split(MARK)
    assert len(printed) == len(asked) + 1
    return [(command, out, said) for (command, said), out in zip(asked, printed[:-1], strict=True)]


def as_pattern(said: str) -> str:
    """`...` stands for anything in a line, a line of it alone for any lines."""
    lines = (
        "(?:.*\n)*" if line == "..." else re.escape(line).replace(r"\.\.\.", ".*") + "\n"
        for line in said.splitlines()
    )
    return "".join(lines)


def test_every_command_of_the_page_prints_what_the_page_says(followed, place):
    assert [shlex.split(command)[0] for command, _, _ in followed] == [
        *("git", "verify", "verify", "verify", "pytest", "pytest"),
    ]
    for command, printed, said in followed:
        assert re.fullmatch(as_pattern(said), printed), f"{command}\n{printed}"
    # 10 m along the middle of the aisle, half-width 2 m less radius 0.5 m: sqrt(2 * 1.5) m/s
    assert f"{10 / 3**0.5:.3f} s" in followed[1][1]
    work = place / "work"
    assert (work / "reports/aisle/report.html").is_file()
    assert (work / "reports/index.html").is_file()
    names = {case.get("name") for case in ElementTree.parse(work / "junit.xml").iter("testcase")}
    assert set(NAMES) <= names
    items = {case.get("name") for case in ElementTree.parse(work / "pytest.xml").iter("testcase")}
    assert items == {*NAMES, "baseline"}


def workflow() -> dict[str, Any]:
    document = yaml.safe_load(FILES[WORKFLOW])
    return {"on": document.pop(True), **document}  # a truth value in YAML 1.1, a name for GitHub


@pytest.mark.parametrize(
    ("schema", "document"),
    [
        ("github-actions", ACTION),
        ("github-workflows", workflow()),
        ("gitlab-ci", yaml.safe_load(FILES[GITLAB])),
    ],
)
def test_ci_files_hold_to_their_schemas(schema, document):
    folder = resources.files("check_jsonschema") / "builtin_schemas" / "vendor"
    text = (folder / f"{schema}.json").read_text(encoding="utf-8")
    jsonschema.validate(document, json.loads(text))


def used() -> dict[str, Any]:
    """What the workflow gives to the action."""
    steps = workflow()["jobs"]["verify"]["steps"]
    return next(step for step in steps if step.get("uses", "").startswith("OWNER/vnav-drake@"))["with"]


def act(place: Path, given: dict[str, str]) -> tuple[int, dict[str, str], str]:
    """Run the action's own steps as a runner does: exit code, outputs, and what is printed."""
    assert set(given) <= set(ACTION["inputs"])
    inputs = {name: given.get(name, told.get("default", "")) for name, told in ACTION["inputs"].items()}
    known = {f"inputs.{name}": value for name, value in inputs.items()}
    known |= {"github.action_path": str(place / "library"), "runner.temp": str(place / "runner")}

    def expanded(text: str) -> str:
        return re.sub(r"\$\{\{ ([\w.-]+) \}\}", lambda found: known[found[1]], str(text))

    printed = []
    for number, step in enumerate(STEPS):
        condition = step.get("if")
        assert condition in (None, "${{ inputs.python == '' }}")
        if "uses" in step or (condition and inputs["python"]):
            continue
        script, output = place / f"step-{number}.sh", place / f"output-{number}"
        script.write_text(step["run"])
        output.write_text("")
        variables = {name: expanded(text) for name, text in step.get("env", {}).items()}
        variables |= {"GITHUB_OUTPUT": str(output), "GITHUB_STEP_SUMMARY": str(place / "summary.md")}
        done = subprocess.run(
            ["bash", "--noprofile", "--norc", "-eo", "pipefail", str(script)],
            cwd=place / "work",
            env=environment(place, CI="true", **variables),
            capture_output=True,
            text=True,
            check=False,
        )
        printed.append(done.stdout + done.stderr)
        outputs = dict(line.split("=", 1) for line in output.read_text().splitlines())
        known |= {f"steps.{step.get('id')}.outputs.{key}": text for key, text in outputs.items()}
        if done.returncode:
            break
    told = {name: expanded(output["value"]) for name, output in ACTION["outputs"].items()}
    return done.returncode, told, "".join(printed)


def test_the_action_does_what_the_workflow_asks_of_it(followed, place):
    work = place / "work"
    for left in ("junit.xml", "trend"):
        assert not (work / left).is_dir()
        (work / left).unlink(missing_ok=True)
    code, told, printed = act(place, used())
    assert (code, told) == (0, {"exit-code": "0", "reports": "reports"}), printed
    assert printed.splitlines()[-1].startswith("aisle: certified  speed_graph 5.774 s")
    assert (place / "runner/vnav-drake-venv/bin/python").exists()  # set up where the steps look for it
    assert (work / "junit.xml").is_file()
    assert "aisle" in (place / "summary.md").read_text()
    steps = workflow()["jobs"]["charts"]["steps"]
    charts = [step["with"] for step in steps if "benchmark" in step["uses"]]
    assert {chart["tool"] for chart in charts} == {"customSmallerIsBetter", "customBiggerIsBetter"}
    for chart in charts:
        entries = json.loads((work / chart["output-file-path"]).read_text())
        assert all({"name", "unit", "value"} <= set(entry) for entry in entries)
        assert entries


def test_steps_that_read_files_of_the_run_ask_whether_these_are_there():
    steps = workflow()["jobs"]["verify"]["steps"]
    after = steps[1 + next(n for n, step in enumerate(steps) if step.get("id") == "verify") :]
    for step in after:
        read = step["with"]["path"]
        output = re.fullmatch(r"\$\{\{ (.*) \}\}", read)
        assert (output[1] if output else f"hashFiles('{read}") in step["if"]
    assert workflow()["jobs"]["verify"]["permissions"] == {
        "contents": "read",
        "checks": "write",
        "actions": "read",
    }


def test_an_unusable_baseline_still_gives_a_list_of_tests(place):
    folder = place / "work/unusable"
    (folder / "scenarios").mkdir(parents=True)
    (folder / "scenarios/aisle.yaml").write_text(FILES["scenarios/aisle.yaml"])
    (folder / "baseline.json").write_text("{}")
    given = {"scenarios": "unusable/scenarios/*.yaml", "baseline": "unusable/baseline.json"}
    given |= {"junit": "unusable/junit.xml", "python": sys.executable}
    code, told, printed = act(place, given)
    assert (code, told) == (2, {"exit-code": "2", "reports": "reports"}), printed
    (case,) = ElementTree.parse(folder / "junit.xml").iter("testcase")
    assert case.find("error") is not None


def test_the_action_fails_with_the_exit_code_and_tells_it(place):
    given = {
        "python": sys.executable,
        "scenarios": "nowhere/*.yaml\n$(touch hacked)",
        "gates": "analytic_gap=1",
    }
    code, told, printed = act(place, given)
    assert (code, told) == (2, {"exit-code": "2", "reports": "reports"})
    assert "nowhere/*.yaml" in printed
    assert not (place / "work/hacked").exists()


def test_no_input_of_the_action_becomes_part_of_a_script():
    assert not [step for step in STEPS if "${{" in step.get("run", "")]
    given = {text for step in STEPS for text in step.get("env", {}).values()}
    used_inputs = {name for name in ACTION["inputs"] if any(f"inputs.{name} " in text for text in given)}
    assert used_inputs == set(ACTION["inputs"]) - {"python-version"}  # that goes to setup-python
    assert all(re.search(r"@v\d+$", step["uses"]) for step in STEPS if "uses" in step)


def test_the_gitlab_job_gives_options_that_exist(place, monkeypatch):
    (command,) = [line for line in yaml.safe_load(FILES[GITLAB])["verify"]["script"] if "bin/verify" in line]
    program, *arguments = shlex.split(command)
    assert program == "vnav-drake/.venv/bin/verify"
    options = cli._options(arguments)
    assert (str(options.junit), str(options.baseline)) == ("junit.xml", "baseline.json")
    assert glob.glob(str(options.scenarios[0]), root_dir=ROOT)
    assert yaml.safe_load(FILES[GITLAB])["verify"]["artifacts"]["reports"]["junit"] == str(options.junit)


def test_the_tolerances_of_the_page_are_read_and_kept(tmp_path):
    (text,) = [text for _, kind, text in BLOCKS if kind == "json"]
    (tmp_path / "baseline.json").write_text(text)
    tolerances = read_baseline(tmp_path / "baseline.json").tolerances
    assert tolerances["travel_time"].around(100.0) == pytest.approx(0.01)  # 1e-4 of 100 s
    assert update_baseline(tmp_path / "baseline.json", {}).tolerances == tolerances


def test_the_page_names_every_option_and_input_and_leads_somewhere():
    parser = pytest.Parser(_ispytest=True)
    pytest_addoption(parser)
    options = [name for group in parser._groups for option in group.options for name in option.names()]
    assert all(f"`{name}" in PAGE for name in (*options, *ACTION["inputs"], *ACTION["outputs"]))
    for target in re.findall(r"\]\((?!https?:)([^)#]*)#?([^)]*)\)", PAGE):
        file = ROOT / "docs" / target[0] if target[0] else ROOT / "docs" / "ci.md"
        headings = re.findall(r"^#+ (.*)$", file.read_text(encoding="utf-8"), re.MULTILINE)
        assert not target[1] or target[1] in {heading.lower().replace(" ", "-") for heading in headings}
