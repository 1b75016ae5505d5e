"""Scenario files to scenarios, and one scenario to its answer, whatever happens on the way."""

from __future__ import annotations

import logging
import sys
import traceback
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from verify import evidence
from verify.atomic import OutputError, locked
from verify.by_products import FigureFormat
from verify.defects import DEFECTS
from verify.evidence import EvidenceError
from verify.exit_codes import BAD_INPUT, UNFINISHED
from vnav_drake.scenario import Scenario, ScenarioError, load_scenario
from vnav_drake.zones.errors import PluginError

if TYPE_CHECKING:
    from verify.pipeline import Outcome
    from verify.stages import Say


@dataclass(frozen=True, kw_only=True)
class Attempt:
    """What became of one scenario: its outcome, or why there is none."""

    name: str
    exit_code: int
    outcome: Outcome | None = None
    error: str = ""  # why there is no outcome
    trace: str = ""  # where that came from, if it is not the scenario's fault

    @property
    def unfinished(self) -> tuple[str, ...]:
        """Stages that could not finish, with the reason; not those that only serve a gate."""
        return (
            () if self.outcome is None else tuple(f"{m.stage}: {m.reason}" for m in self.outcome.unfinished)
        )


def load(file: Path, others: Iterable[Scenario]) -> Scenario:
    """The scenario of a file that runs together with `others`.

    Raises
    ------
    ScenarioError : it cannot be used, or another one has its name.
    PluginError : the braking zone of a plugin fails.
    """
    from vnav_drake.zones.plugins import Watched

    with Watched():
        scenario = load_scenario(file)
    twin = next((other for other in others if other.name == scenario.name), None)
    if twin is not None:
        raise scenario.error("name", f"is also the name of {twin.source}; expected one file a name")
    return scenario


def attempt(
    scenario: Scenario,
    out: Path,
    overrides: Mapping[str, float],
    say: Say,
    workers: int | None = None,
    figures: FigureFormat | None = None,
) -> Attempt:
    """Run one scenario as `run_scenario` does, and bring the index up to date. Only interruptions pass.

    `workers` are processes that share the simulations; None: one for each processor. `figures`:
    a format in which the report's pictures are written too.
    """
    name = scenario.name
    try:
        from systems.parallel import processors
        from verify.pipeline import run_scenario  # loads Drake: not for bad input
        from vnav_drake.zones.plugins import Watched

        # Drake tells of each solve that did not succeed; the stages try again, and say what counts.
        logging.getLogger("drake").setLevel(logging.WARNING)
        with Watched():
            outcome = run_scenario(
                scenario,
                out,
                overrides=overrides,
                say=say,
                workers=workers or processors(),
                figures=figures,
            )
    except (ScenarioError, OutputError) as error:
        return Attempt(name=name, exit_code=BAD_INPUT, error=str(error))
    except EvidenceError as error:  # what was written, too large for one
        return Attempt(name=name, exit_code=UNFINISHED, error=f"{name}: cannot be judged: {error}")
    except PluginError as error:
        return _unfinished(name, f"could not finish: {error}")
    except DEFECTS as error:
        words = str(error).partition("\n")[0]
        return _unfinished(
            name, f"could not finish, a fault of ours: {type(error).__name__}{words and ': '}{words}"
        )
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        text = f"{name}: {where}{error.strerror or error}; an earlier result is as it was"
        return Attempt(name=name, exit_code=UNFINISHED, error=text)
    write_index_of(out)
    return Attempt(name=name, exit_code=outcome.exit_code, outcome=outcome)


def _unfinished(name: str, reason: str) -> Attempt:
    """In the handler of what was raised."""
    text = f"{name}: {reason}"
    return Attempt(name=name, exit_code=UNFINISHED, error=text, trace=traceback.format_exc())


def write_index_of(out: Path) -> None:
    """All results in `out` side by side, those of earlier runs too.

    The folder may hold anything: an index that cannot be written is told on standard error, and the run has
    the result that it has.
    """
    try:
        from verify.report import write_index

        with locked(out):
            write_index(out / "index.html", _results(out))
    except (OSError, *DEFECTS) as error:
        words = (error.strerror if isinstance(error, OSError) else "") or f"{type(error).__name__}: {error}"
        print(f"verify: {out / 'index.html'}: index not written: {words}", file=sys.stderr)


def _results(out: Path) -> list[tuple[str, Mapping[str, Any]]]:
    found: list[tuple[str, Mapping[str, Any]]] = []
    for folder in sorted(out.iterdir()):
        if folder.is_dir() and not folder.name.startswith("."):
            try:
                found.append((folder.name, evidence.read_result(folder)))
            except EvidenceError:
                continue  # not a result of ours
    return found
