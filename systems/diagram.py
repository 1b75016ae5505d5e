"""The wiring: trajectory source, tracking controller, vehicle and log in one Drake diagram."""

from __future__ import annotations

from dataclasses import dataclass

from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput, VectorLogSink

from systems.single_track import SingleTrackVehicle, State
from systems.tracking import TrackingController, TrajectorySource, sampled
from vnav_drake.plan import Trajectory
from vnav_drake.robot import Robot

LOG_PERIOD = 1e-2  # [s]
REST_SPEED = 1e-6  # [m/s]: a trajectory that ends slower than this ends at rest


@dataclass(frozen=True, kw_only=True)
class TrackingDiagram:
    """A diagram and the parts one asks questions of."""

    diagram: Diagram
    source: TrajectorySource
    controller: TrackingController
    vehicle: SingleTrackVehicle
    log: VectorLogSink  # of `Motion`, every `LOG_PERIOD`
    duration: float  # [s], of the schedule
    start: State  # of a vehicle that is exactly on the first row

    def state(self, context: Context) -> State:
        """State of the vehicle in a context of the diagram."""
        own = self.vehicle.GetMyContextFromRoot(context)
        return State(*own.get_continuous_state_vector().CopyToVector().tolist())

    def set_state(self, context: Context, state: State) -> None:
        """Put the vehicle into a state, in a context of the diagram."""
        self.vehicle.GetMyMutableContextFromRoot(context).SetContinuousState(list(state))


def tracking_diagram(robot: Robot, trajectory: Trajectory) -> TrackingDiagram:
    """Wire the closed loop that follows `trajectory`."""
    wanted = sampled(robot, trajectory)
    builder = DiagramBuilder()
    source = builder.AddNamedSystem("trajectory", TrajectorySource(trajectory, wanted))
    rest_end = float(trajectory.v[-1]) <= REST_SPEED
    controller = builder.AddNamedSystem("tracking", TrackingController(robot, wanted, rest_end=rest_end))
    vehicle = builder.AddNamedSystem("single_track", SingleTrackVehicle(robot))
    builder.Connect(vehicle.GetOutputPort("state"), source.GetInputPort("state"))
    builder.Connect(vehicle.GetOutputPort("state"), controller.GetInputPort("state"))
    builder.Connect(source.GetOutputPort("target"), controller.GetInputPort("target"))
    builder.Connect(controller.GetOutputPort("command"), vehicle.GetInputPort("command"))
    log = LogVectorOutput(vehicle.GetOutputPort("motion"), builder, LOG_PERIOD)
    log.set_name("log")
    diagram = builder.Build()
    diagram.set_name("tracking")
    return TrackingDiagram(
        diagram=diagram,
        source=source,
        controller=controller,
        vehicle=vehicle,
        log=log,
        duration=wanted.duration,
        start=wanted.state(trajectory),
    )


def diagram_graphviz(robot: Robot, trajectory: Trajectory) -> str:
    """The diagram as Graphviz source, for reports."""
    return str(tracking_diagram(robot, trajectory).diagram.GetGraphvizString(max_depth=1))
