"""Gains along a trajectory: Drake's finite-horizon linear-quadratic regulator on sampled linear dynamics."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.controllers import (
    FiniteHorizonLinearQuadraticRegulator,
    FiniteHorizonLinearQuadraticRegulatorOptions,
)
from pydrake.systems.framework import LeafSystem_
from pydrake.systems.scalar_conversion import TemplateSystem

Array = NDArray[np.float64]


@TemplateSystem.define("SampledLinearSystem_")  # type: ignore[untyped-decorator]
def SampledLinearSystem_(T: type) -> type:  # noqa: N802, N803
    """Discrete linear system whose matrices change from sample to sample, convertible to AutoDiff.

    x[n + 1] = A[n] x[n] + B[n] u[n]; input port `u` (m,), matrices A (n, k, k), B (n, k, m).
    """

    class Impl(LeafSystem_[T]):  # type: ignore[misc]
        def _construct(self, step: Array, kick: Array, period: float, converter: Any = None) -> None:
            LeafSystem_[T].__init__(self, converter)
            self.matrices = (step, kick, period)
            self.DeclareDiscreteState(step.shape[1])
            self.DeclareVectorInputPort("u", kick.shape[2])
            self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            step, kick, period = other.matrices
            Impl._construct(self, step, kick, period, converter)

        def _update(self, context: Any, values: Any) -> None:
            step, kick, period = self.matrices
            time = context.get_time()
            k = round((time if isinstance(time, float) else time.value()) / period)
            state = context.get_discrete_state_vector().CopyToVector()
            following = step[k] @ state + kick[k] @ self.get_input_port(0).Eval(context)
            values.get_mutable_vector().SetFromVector(following)

    return Impl


SampledLinearSystem = SampledLinearSystem_[float]


def finite_horizon_gains(step: Array, kick: Array, period: float, cost: Array, effort: float) -> Array:
    """Gains (n, k) of u[n] = -K[n] x[n] that are optimal up to the last sample.

    Parameters
    ----------
    step : (n, k, k) A and kick : (n, k) B of x[n + 1] = A[n] x[n] + B[n] u[n].
    period : [s] between samples.
    cost : (k, k) Q, also of the state after the last sample; effort : R.
    """
    system = SampledLinearSystem(step, kick[:, :, None], period)
    context = system.CreateDefaultContext()
    system.get_input_port(0).FixValue(context, [0.0])
    options = FiniteHorizonLinearQuadraticRegulatorOptions()
    options.Qf = cost
    count = len(step)
    found = FiniteHorizonLinearQuadraticRegulator(
        system, context, 0.0, count * period, cost, np.array([[effort]]), options
    )
    return np.array([found.K.value(time)[0] for time in found.K.get_times()])
