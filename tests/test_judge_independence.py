"""At run time too the judge uses none of the planners' code."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from result_folder import copy_to
from stops_case import stop_arrays, write_case

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


ZONES = {
    "ellipse": {"type": "ellipse", "lateral_ratio": 0.5, "ahead": 1.1, "behind": 0.2},
    "protective_field": {"type": "protective_field", "form": "rectangle", "side": 0.1},
    "polygon": {"type": "polygon", "vertices": [[-0.1, -0.5], [1.1, -0.5], [1.1, 0.5], [-0.1, 0.5]]},
    "field_set": {
        "type": "field_set",
        "fields": [{"max_speed": 2.0, "polygon": [[-3, -3], [3, -3], [3, 3], [-3, 3]]}],
    },
}
JUDGING = """
import sys
from pathlib import Path
import verify.judge
for folder in sys.argv[1:]:
    found = verify.judge.judge(Path(folder))
    assert found.zone is not None and found.zone["promise"]["poses"], folder
    assert {"braking_distance", "emergency_stops"} <= {check.name for check in found.checks}
print(*(name for name in sys.modules if name.partition(".")[0] in ("vnav_drake", "systems", "pydrake")))
"""


def test_judging_built_in_zones_loads_none_of_the_planners_zones(tmp_path):
    folders = []
    for name, zone in ZONES.items():
        braking = {"zone": zone, "margin": 0.05, "friction_reserve": name != "field_set"}  # which has none
        folders.append(str(write_case(tmp_path / name, stop_arrays(), braking=braking)))
    command = [sys.executable, "-c", JUDGING, *folders]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert set(done.stdout.split()) <= READING
