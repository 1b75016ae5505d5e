"""One real result folder, made once a test session by the whole pipeline."""

from __future__ import annotations

import hashlib
import shutil
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import pytest
from judged import scenario

from verify import pipeline
from verify.driving import show_replay
from verify.pipeline import Outcome, run_scenario
from verify.report import write_report

# For runs that are not about the vehicle: it drives the plan once, and is never asked to stop.
NO_STOPS = {"model": "single_track", "stops": 0, "studies": False}

# Around a point in a 12 x 8 m room: bends one way, with rows that differ in curvature and acceleration.
CHANGES = {
    "name": "around_a_point",
    "world": {
        "boundary": [[0, 0], [12, 0], [12, 8], [0, 8]],
        "obstacles": [{"name": "pillar <b>&", "vertices": [[6.0, 3.0]]}],
    },
    "robot": {"radius": 0.4},
    "start": {"position": [2.0, 3.0], "speed": "rest"},
    "goal": {"position": [10.0, 3.0], "speed": "rest"},
    "plan": {"effort": "quick", "methods": ["speed_graph", "voronoi_route"]},
    "simulation": {**NO_STOPS, "stops": 4},
    "gates": {"refinement_gap": 0.5},  # the way is short: full speed is never reached, E is far from tight
}


@cache
def outcome() -> Outcome:
    """Of a real run; its folder must not be changed: copy it."""
    out = Path(mkdtemp(prefix="vnav-result-"))
    with pytest.MonkeyPatch.context() as patch:  # also where the test that asks first leaves the report out
        patch.setattr(pipeline, "write_report", write_report)
        patch.setattr(pipeline, "show_replay", show_replay)
        return run_scenario(scenario(**CHANGES), out)


def copy_to(place: Path) -> Path:
    folder = place / "around_a_point"
    shutil.copytree(outcome().report.parent, folder)
    return folder


def contents(folder: Path) -> dict[str, str]:
    """SHA-256 of every file below `folder`, hidden ones too."""
    files = [file for file in sorted(folder.rglob("*")) if file.is_file()]
    return {str(f.relative_to(folder)): hashlib.sha256(f.read_bytes()).hexdigest() for f in files}
