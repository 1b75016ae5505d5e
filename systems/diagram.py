"""The wiring: trajectory, tracking controller, supervisor, vehicle and log in one Drake diagram."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, OutputPort
from pydrake.systems.primitives import (
    Adder,
    ConstantVectorSource,
    LogVectorOutput,
    MatrixGain,
    PortSwitch,
    VectorLogSink,
)

from systems.feedforward import demand
from systems.four_wheel import PLANT_STEP, FourWheel, add_four_wheel
from systems.gains import rolling_gains, slipping_gains
from systems.rolling import rolling_demand
from systems.schedule import Demand
from systems.single_track import Body, SingleTrackVehicle, State
from systems.supervisor import NEVER, SingleTrackOrders, Supervisor
from systems.tracking import TrackingController, TrajectorySource
from systems.tyre import full_slide
from systems.wheels import Sensing, WheelCommands
from vnav_drake.plan import Trajectory
from vnav_drake.robot import Robot

LOG_PERIOD = 1e-2  # [s]
INTEGRATION_STEP = 2.5e-3  # [s], of the single track, see `systems.tyre.rolling_speed`
REST_SPEED = 1e-6  # [m/s]: a trajectory that ends slower than this ends at rest
CONTROL_PERIODS = {"single_track": 5e-3, "four_wheel": 1e-2}  # [s]
# Slip of the front wheels that steering may cause. More than full slide gives no more force, but the servo
# needs a little to get there in time; a wheel with Coulomb friction slides at any slip.
FRONT_SLIP = 1.5  # of the slip at which a brush tyre slides
ROLLING_SLIP = 0.08  # tangent of the slip angle of a rolling wheel


@dataclass(frozen=True, kw_only=True)
class Vehicle(ABC):
    """What moves in a diagram."""

    state_port: OutputPort  # `State`
    tilt_port: OutputPort | None  # [rad]; None for a vehicle in the plane
    record_port: OutputPort  # what is logged

    @abstractmethod
    def state(self, context: Context) -> State:
        """State of the vehicle; `context` of the diagram."""

    @abstractmethod
    def set_state(self, context: Context, state: State, forward: float) -> None:
        """Put the vehicle into a state; it accelerates by `forward` [m/s^2]. `context` is the diagram's."""


@dataclass(frozen=True, kw_only=True)
class _SingleTrack(Vehicle):
    system: SingleTrackVehicle

    def state(self, context: Context) -> State:
        own = self.system.GetMyContextFromRoot(context)
        return State(*own.get_continuous_state_vector().CopyToVector().tolist())

    def set_state(self, context: Context, state: State, forward: float) -> None:
        self.system.GetMyMutableContextFromRoot(context).SetContinuousState(list(state))


@dataclass(frozen=True, kw_only=True)
class _FourWheel(Vehicle):
    system: FourWheel

    def state(self, context: Context) -> State:
        sensing = self.state_port.get_system()
        return State(*self.state_port.Eval(sensing.GetMyContextFromRoot(context)).tolist())

    def set_state(self, context: Context, state: State, forward: float) -> None:
        self.system.set_state(self.system.plant.GetMyMutableContextFromRoot(context), state, forward)


@dataclass(frozen=True, kw_only=True)
class TrackingDiagram:
    """A diagram and the parts one asks questions of."""

    model: str  # "four_wheel", "single_track"
    diagram: Diagram
    source: TrajectorySource
    supervisor: Supervisor
    request: ConstantVectorSource  # of an emergency stop: time [s], straightened
    vehicle: Vehicle
    log: VectorLogSink  # of the vehicle's record
    period: float  # [s], of control
    vehicle_step: float  # [s], of the integrator or the plant
    duration: float  # [s], of the schedule
    start: State  # of a vehicle that is exactly on the first row
    start_acceleration: float  # [m/s^2], along the path, there

    def begin(self, context: Context, state: State) -> None:
        """Put vehicle and supervisor at the beginning of the run, in a context of the diagram."""
        self.vehicle.set_state(context, state, self.start_acceleration)
        self.supervisor.set_steering(self.supervisor.GetMyMutableContextFromRoot(context), state.steering)

    def ask_to_stop(self, context: Context, time: float, *, straightened: bool) -> None:
        """Ask for an emergency stop at a time [s]."""
        own = self.request.GetMyMutableContextFromRoot(context)
        self.request.get_mutable_source_value(own).set_value(np.array([time, float(straightened)]))


def tracking_diagram(
    robot: Robot,
    trajectory: Trajectory,
    *,
    model: str = "single_track",
    actual: Robot | None = None,
    reaction_time: float = 0.0,
    step: float = PLANT_STEP,
    slowing: bool = True,
    log_period: float = LOG_PERIOD,
) -> TrackingDiagram:
    """Wire the closed loop that follows `trajectory`.

    `robot` is the one that the controller believes in, `actual` the one that drives; `step` [s] that of the
    four-wheeled plant; `slowing`: the schedule slows down where a bend takes nearly all the friction.
    """
    builder = DiagramBuilder()
    rest_end = float(trajectory.v[-1]) <= REST_SPEED
    wanted: Demand
    if model == "four_wheel":
        wanted = rolling = rolling_demand(robot, trajectory, CONTROL_PERIODS[model], slowing=slowing)
        gains, slip = rolling_gains(robot, rolling), ROLLING_SLIP
    else:
        wanted = slipping = demand(Body.of(robot), trajectory, CONTROL_PERIODS[model], slowing=slowing)
        gains = slipping_gains(Body.of(robot), slipping)
        slip = FRONT_SLIP * full_slide(robot.friction)
    source = builder.AddNamedSystem("trajectory", TrajectorySource(trajectory, wanted))
    controller = builder.AddNamedSystem(
        "tracking", TrackingController(robot, wanted, gains, front_slip=slip, rest_end=rest_end)
    )
    supervisor = builder.AddNamedSystem(
        "supervisor", Supervisor(robot, wanted.period, reaction_time=reaction_time, rest_end=rest_end)
    )
    request = builder.AddNamedSystem("stop_request", ConstantVectorSource([NEVER, 0.0]))
    add = _add_four_wheel if model == "four_wheel" else _add_single_track
    vehicle = add(builder, robot, actual or robot, supervisor.GetOutputPort("order"), step)
    for system in (source, controller, supervisor):
        builder.Connect(vehicle.state_port, system.GetInputPort("state"))
    for system in (controller, supervisor):
        builder.Connect(source.GetOutputPort("target"), system.GetInputPort("target"))
    builder.Connect(controller.GetOutputPort("command"), supervisor.GetInputPort("command"))
    builder.Connect(request.get_output_port(), supervisor.GetInputPort("stop"))
    if vehicle.tilt_port is not None:
        builder.Connect(vehicle.tilt_port, supervisor.GetInputPort("tilt"))
    log = LogVectorOutput(vehicle.record_port, builder, log_period)
    log.set_name("log")
    diagram = builder.Build()
    diagram.set_name(model)
    return TrackingDiagram(
        model=model,
        diagram=diagram,
        source=source,
        supervisor=supervisor,
        request=request,
        vehicle=vehicle,
        log=log,
        period=wanted.period,
        vehicle_step=step if model == "four_wheel" else INTEGRATION_STEP,
        duration=wanted.duration,
        start=wanted.state(trajectory),
        start_acceleration=float(trajectory.a[0]) if trajectory.v[0] > REST_SPEED else 0.0,
    )


def _add_single_track(
    builder: DiagramBuilder, _robot: Robot, actual: Robot, order: OutputPort, _step: float
) -> Vehicle:
    orders = builder.AddNamedSystem("orders", SingleTrackOrders(actual))
    vehicle = builder.AddNamedSystem("single_track", SingleTrackVehicle(actual))
    builder.Connect(order, orders.GetInputPort("order"))
    builder.Connect(vehicle.GetOutputPort("state"), orders.GetInputPort("state"))
    builder.Connect(orders.GetOutputPort("command"), vehicle.GetInputPort("command"))
    return _SingleTrack(
        system=vehicle,
        state_port=vehicle.GetOutputPort("state"),
        tilt_port=None,
        record_port=vehicle.GetOutputPort("motion"),
    )


def _add_four_wheel(
    builder: DiagramBuilder, robot: Robot, actual: Robot, order: OutputPort, step: float
) -> Vehicle:
    """The plant, and between it and the order: the wheels' commands, the brakes' target speed, the senses.

    A brake that is on has the target zero. A released one has the speed at which its wheel will spin at the
    end of the step if it goes on as in the last, so that it gives no torque: with the speed at the beginning
    it would resist being sped up like a mass.
    """
    vehicle = add_four_wheel(builder, actual, step, believed=robot)
    plant = vehicle.plant
    count = plant.num_actuators()
    commands = builder.AddNamedSystem(
        "wheel_commands", WheelCommands(vehicle, robot, CONTROL_PERIODS["four_wheel"])
    )
    sensing = builder.AddNamedSystem("sensing", Sensing(vehicle))
    spinning = np.zeros((2 * count, vehicle.states))
    rising = np.zeros((2 * count, plant.num_velocities()))
    for brake, spin in zip(vehicle.brakes, vehicle.spins, strict=True):
        spinning[count + brake, plant.num_positions() + spin] = 1.0
        rising[count + brake, spin] = step
    spin = builder.AddNamedSystem("spin", MatrixGain(spinning))
    rise = builder.AddNamedSystem("spin_rise", MatrixGain(rising))
    released = builder.AddNamedSystem("brakes_released", Adder(2, 2 * count))
    on = builder.AddNamedSystem("brakes_on", ConstantVectorSource(np.zeros(2 * count)))
    switch = builder.AddNamedSystem("brake_switch", PortSwitch(2 * count))
    targets = builder.AddNamedSystem("targets", Adder(2, 2 * count))
    builder.Connect(order, commands.GetInputPort("order"))
    builder.Connect(order, sensing.GetInputPort("order"))
    builder.Connect(commands.GetOutputPort("torque"), plant.get_actuation_input_port())
    builder.Connect(plant.get_state_output_port(), spin.get_input_port())
    builder.Connect(plant.get_generalized_acceleration_output_port(), rise.get_input_port())
    builder.Connect(spin.get_output_port(), released.get_input_port(0))
    builder.Connect(rise.get_output_port(), released.get_input_port(1))
    builder.Connect(commands.GetOutputPort("brakes"), switch.get_port_selector_input_port())
    builder.Connect(released.get_output_port(), switch.DeclareInputPort("released"))
    builder.Connect(on.get_output_port(), switch.DeclareInputPort("on"))
    builder.Connect(commands.GetOutputPort("targets"), targets.get_input_port(0))
    builder.Connect(switch.get_output_port(), targets.get_input_port(1))
    instance = plant.GetJointActuatorByName("steer_left").model_instance()
    builder.Connect(targets.get_output_port(), plant.get_desired_state_input_port(instance))
    builder.Connect(plant.get_state_output_port(), sensing.GetInputPort("plant"))
    builder.Connect(plant.get_contact_results_output_port(), sensing.GetInputPort("contact"))
    builder.Connect(plant.get_net_actuation_output_port(), sensing.GetInputPort("actuation"))
    return _FourWheel(
        system=vehicle,
        state_port=sensing.GetOutputPort("state"),
        tilt_port=sensing.GetOutputPort("tilt"),
        record_port=sensing.GetOutputPort("record"),
    )


def diagram_graphviz(robot: Robot, trajectory: Trajectory, model: str = "single_track") -> str:
    """The diagram as Graphviz source, for reports."""
    return str(tracking_diagram(robot, trajectory, model=model).diagram.GetGraphvizString(max_depth=1))
