"""Drake systems and diagrams: vehicles, tracking and the simulation of a trajectory."""

from systems.diagram import diagram_graphviz
from systems.simulation import SimulationError, SimulationRun, run_columns, simulate

__all__ = ["SimulationError", "SimulationRun", "diagram_graphviz", "run_columns", "simulate"]
