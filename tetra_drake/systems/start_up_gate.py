"""The gate that keeps the actuation off at first."""

from __future__ import annotations

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

_LONGER_THAN_ANY_SIMULATION = 1e9  # s; Drake has no one-time event, so its period is long


class StartUpGate(LeafSystem):
    """Passes signals on from the start-up time on, and zeros before it (thesis listing B.1).

    | port    | shape | unit | meaning                       |
    |---------|-------|------|-------------------------------|
    | ungated | (m,)  | N    | signals of the oscillators    |
    | signals | (m,)  | N    | zeros, later the same signals |

    A discrete state holds whether the gate is open, and an event sets it at the start-up time.
    So an integration step ends exactly at the jump, and no step smears it.
    """

    def __init__(self, size: int, *, start_up: float) -> None:
        super().__init__()
        self._ungated = self.DeclareVectorInputPort("ungated", size)
        self.DeclareDiscreteState([0.0 if start_up > 0.0 else 1.0])
        self.DeclareVectorOutputPort(
            "signals", size, self._calc_signals, {self._ungated.ticket(), self.xd_ticket()}
        )
        if start_up > 0.0:
            self.DeclarePeriodicDiscreteUpdateEvent(
                period_sec=_LONGER_THAN_ANY_SIMULATION, offset_sec=start_up, update=self._open
            )

    def _open(self, context: Context, values: DiscreteValues) -> None:
        values.set_value([1.0])

    def _calc_signals(self, context: Context, output: BasicVector) -> None:
        is_open = context.get_discrete_state_vector().value()[0] != 0.0
        output.SetFromVector(self._ungated.Eval(context) if is_open else np.zeros(output.size()))
