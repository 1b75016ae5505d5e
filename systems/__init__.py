"""Drake systems and diagrams: vehicles, tracking and the simulation of a trajectory."""

from systems.diagram import diagram_graphviz, tracking_diagram
from systems.run import SimulationRun, run_columns
from systems.simulation import SimulationError, simulate

__all__ = [
    "SimulationError",
    "SimulationRun",
    "diagram_graphviz",
    "run_columns",
    "simulate",
    "tracking_diagram",
]
