"""At run time too the judge uses none of the planners' code."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from result_folder import copy_to

ROOT = Path(__file__).resolve().parents[1]
# What may be loaded of the planners' package: the way from a file's text to raw numbers.
READING = {
    "vnav_drake",
    *(f"vnav_drake.scenario_{part}" for part in ("file", "faults", "section", "spec", "zone")),
}

SCRIPT = """
import sys
from pathlib import Path
import verify.judge, verify.recheck
found = verify.recheck.recheck(Path(sys.argv[1]))
assert found.passed, found.reasons
assert verify.judge.judge(Path(sys.argv[1])).passed
print(*(name for name in sys.modules if name.partition(".")[0] in ("vnav_drake", "systems", "pydrake")))
"""


def test_judging_a_folder_loads_neither_drake_nor_planners(tmp_path):
    command = [sys.executable, "-c", SCRIPT, str(copy_to(tmp_path))]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert set(done.stdout.split()) <= READING
