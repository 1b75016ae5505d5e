"""Several scenarios at once, each in a process of its own; answers come in the order of the files."""

from __future__ import annotations

import contextlib
from collections.abc import Generator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from verify.attempt import Attempt, attempt
from verify.by_products import FigureFormat
from verify.exit_codes import BAD_INPUT, UNFINISHED
from verify.interruption import Interruption
from vnav_drake.scenario import Scenario, ScenarioError, parse_scenario
from vnav_drake.zones.errors import PluginError

if TYPE_CHECKING:
    from verify.stages import Say


def attempts(
    scenarios: Sequence[Scenario],
    out: Path,
    overrides: Mapping[str, float],
    say: Say,
    *,
    jobs: int = 1,
    plugins: Sequence[str] = (),
    figures: FigureFormat | None = None,
) -> Generator[Attempt, None, None]:
    """What became of each scenario, in their order, each as soon as those before it are done.

    Parameters
    ----------
    out, overrides, say, figures : as of `attempt`.
    jobs : how many run at once. They share the processors; results do not depend on it.
    plugins : modules whose braking zones the scenarios may name, for processes to import.
    """
    if jobs <= 1 or len(scenarios) <= 1:
        for scenario in scenarios:
            yield attempt(scenario, out, overrides, say, figures=figures)
        return
    from systems.parallel import WorkerError, apart, processors

    share = max(1, processors() // min(jobs, len(scenarios)))
    tasks = [
        (s.name, s.data, str(s.source or s.name), out, dict(overrides), share, tuple(plugins), figures)
        for s in scenarios
    ]
    done: dict[int, Attempt] = {}
    told = 0
    interruption = Interruption()
    try:
        with interruption, contextlib.closing(apart(_attempt, tasks, jobs)) as rounds:
            for found in rounds:
                interruption.check()
                for number, answer in found.items():
                    name = scenarios[number].name
                    done[number] = _lost(name, answer) if isinstance(answer, WorkerError) else answer
                say(f"{len(done)} of {len(scenarios)} scenarios done, {jobs} at a time")
                while told in done:
                    yield done[told]
                    told += 1
    finally:
        interruption.restore()


def _attempt(
    name: str,
    data: bytes,
    where: str,
    out: Path,
    overrides: Mapping[str, float],
    workers: int,
    plugins: Sequence[str],
    figures: FigureFormat | None,
) -> Attempt:
    """In a process of its own, which reads the scenario again: plugins' zones need not be picklable."""
    from vnav_drake.zones.plugins import load_plugin

    try:
        for module in plugins:
            load_plugin(module)
        scenario = parse_scenario(data, where)
    except (ScenarioError, PluginError) as error:
        return Attempt(name=name, exit_code=BAD_INPUT, error=str(error))
    return attempt(scenario, out, overrides, lambda _text: None, workers, figures)


def _lost(name: str, error: Exception) -> Attempt:
    text = f"{name}: could not finish: {error} (out of memory? --jobs 1 runs one after the other)"
    return Attempt(name=name, exit_code=UNFINISHED, error=text)
