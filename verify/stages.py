"""Stages one after the other: what each gave, how long it took, and what could not finish."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeVar

from systems import SimulationError, SimulationRun
from systems.margins import Studies
from systems.parallel import WorkerError
from systems.stops import StopRecords
from verify.analytic import Analytic
from verify.field_stage import FieldsStage
from verify.interruption import Interruption
from verify.replay import ReplayError
from verify.vc import VcStage
from vnav_drake.homotopy import Gates
from vnav_drake.lower_bound import LowerBound
from vnav_drake.plan import Plan
from vnav_drake.problem import NoClassError, NoPathError, PlanningError
from vnav_drake.scenario import Scenario
from vnav_drake.voronoi import VoronoiDiagram

T = TypeVar("T")
Say = Callable[[str], None]  # is told what is being done


@dataclass(frozen=True, kw_only=True)
class Missing:
    """A stage that could not finish."""

    stage: str
    reason: str
    # The gate that the stage serves and nothing else: without it the run fails only by that gate.
    only_for: str = ""


@dataclass(kw_only=True)
class Progress:
    """What the stages have given so far."""

    plans: dict[str, Plan] = field(default_factory=dict)
    diagram: VoronoiDiagram | None = None
    gates: Gates | None = None
    analytic: Analytic | None = None
    vc: VcStage | None = None
    comparison: list[dict[str, Any]] = field(default_factory=list)  # of seeds
    fields: FieldsStage | None = None  # where the zone is a field set
    bound: LowerBound | None = None
    executed: str | None = None  # the plan that the vehicle drove in `run`, or is to drive
    run: SimulationRun | None = None
    prescreen: SimulationRun | None = None  # of the single track, where both models are asked for
    stops: StopRecords | None = None
    studies: Studies | None = None
    missing: list[Missing] = field(default_factory=list)
    seconds: dict[str, float] = field(default_factory=dict)

    def keep(self, plan: Plan | None) -> Plan | None:
        """Note a plan under its method; what is None is passed through."""
        if plan is not None:
            self.plans[plan.method] = plan
        return plan


@dataclass(frozen=True, kw_only=True)
class Stages:
    """Runs the stages of one scenario."""

    scenario: Scenario
    say: Say
    interruption: Interruption
    workers: int = 1  # processes that may share the simulations
    done: Progress = field(default_factory=Progress)

    def run(self, name: str, work: Callable[[], T], *, only_for: str = "") -> T | None:
        """What `work` gives; None when it cannot finish, which is noted.

        `only_for` names the gate that it serves, where the rest can do without it.

        Raises
        ------
        ScenarioError : there is no path for this robot, or none through the gates that were asked for.
        """
        self.say(f"{self.scenario.name}: {name.replace('_', ' ')}")
        begun = time.perf_counter()
        try:
            return work()
        except NoPathError as error:
            raise self.scenario.error("goal.position", str(error)) from error
        except NoClassError as error:
            raise self.scenario.error("plan.through", str(error)) from error
        except (PlanningError, SimulationError, WorkerError, ReplayError) as error:
            self.interruption.check()
            self.done.missing.append(Missing(stage=name, reason=str(error), only_for=only_for))
            return None
        finally:
            self.done.seconds[name] = self.done.seconds.get(name, 0.0) + time.perf_counter() - begun
            self.interruption.check()  # a stage may have swallowed it

    def skip(self, name: str, needs: str) -> None:
        """Note a stage that cannot begin."""
        self.done.missing.append(Missing(stage=name, reason=f"not run: it needs {needs}"))

    def told(self, name: str) -> Say:
        """Where a stage may tell how far it is."""
        return lambda text: self.say(f"{self.scenario.name}: {name}, {text}")
