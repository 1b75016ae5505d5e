"""Every scenario of the gallery, run once for all tests of its result, whichever worker they are on."""

from pathlib import Path

import pytest
import yaml

from verify.atomic import locked
from verify.cli import run
from verify.recheck import check_folder

ROOT = Path(__file__).resolve().parents[1]
FILES = sorted((ROOT / "scenarios").glob("*.yaml"))
NAMES = [file.stem for file in FILES]
STUDIED = "warehouse"  # the others are driven without studies of what the vehicle can bear
STOPS = {STUDIED: 40}  # instants of the emergency-stop audit, each with two stops
FEWEST = 8  # of the others


def reports(factory: pytest.TempPathFactory) -> Path:
    """The folder of all results of this test run, the same one for all workers."""
    base = factory.getbasetemp()
    place = (base.parent if base.name.startswith("popen-") else base) / "gallery"
    (place / "reports").mkdir(parents=True, exist_ok=True)
    return place / "reports"


def verified(name: str, factory: pytest.TempPathFactory) -> Path:
    """The folder of a run that passes and that `verify check` confirms; whoever asks first runs it."""
    out = reports(factory)
    asked, told = out.parent / f"{name}.yaml", out.parent / f"{name}.lock"
    told.mkdir(exist_ok=True)
    with locked(told):
        if not asked.exists():
            asked.write_text(question(name))
            assert run([str(asked), "--out", str(out), "--quiet"]) == 0
            assert check_folder(out / name, quiet=True) == 0
            (told / "passed").touch()
    assert (told / "passed").exists(), f"{name} has failed already, in another test"
    return out / name


def question(name: str) -> str:
    """The scenario as it is tested: with fewer emergency stops."""
    asked = yaml.safe_load((ROOT / "scenarios" / f"{name}.yaml").read_text())
    changed = {"stops": STOPS.get(name, FEWEST), "studies": name == STUDIED}
    asked["simulation"] = asked.get("simulation", {}) | changed
    return yaml.safe_dump(asked)
