"""Actuators of all driven cables as a LeafSystem."""

from __future__ import annotations

import numpy as np
from pydrake.systems.framework import BasicVector, Context, ContinuousState, LeafSystem


class Actuators(LeafSystem):
    """States of the actuators (drives, see physics.actuator).

    | port   | shape     | unit       | meaning                                                   |
    |--------|-----------|------------|-----------------------------------------------------------|
    | rates  | (drives,) | m/s or N/s | rate of each drive, from the cables                       |
    | drives | (drives,) | m or N     | state of each actuator                                    |

    The continuous state is the drives. The output depends only on the state, so there is no
    algebraic loop with the cables, which compute the rates.
    """

    def __init__(self, start: np.ndarray) -> None:
        """`start` (drives,) are the drives at t = 0."""
        super().__init__()
        self._rates = self.DeclareVectorInputPort("rates", len(start))
        self.DeclareContinuousState(BasicVector(start))
        self.DeclareVectorOutputPort("drives", len(start), self._calc_drives, {self.xc_ticket()})

    def DoCalcTimeDerivatives(self, context: Context, derivatives: ContinuousState) -> None:
        derivatives.SetFromVector(self._rates.Eval(context))

    def _calc_drives(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(context.get_continuous_state_vector().CopyToVector())
