"""Steering of the oscillators, as a LeafSystem."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from pydrake.systems.framework import BasicVector, Context

from tetra_drake.robot.gait import checked_turn
from tetra_drake.systems.scalar_conversion import ConvertibleSystem


class Steering(ConvertibleSystem):
    """Tonic input of the oscillators as a function of the turn. The system has no state.

    | port  | in, out | shape | unit | meaning                                                |
    |-------|---------|-------|------|--------------------------------------------------------|
    | turn  | in      | (1,)  | 1    | -1 to 1: at 1 only the oscillators on the robot's left |
    |       |         |       |      | have input, at -1 only those on its right; without a   |
    |       |         |       |      | connection `turn` of the constructor                   |
    | tonic | out     | (2m,) | 1    | u0 of thesis Eq. 7 for the neurons of m oscillators    |

    A turn outside -1 to 1 raises InputError.
    """

    def __init__(
        self,
        tonic_input: Callable[[np.ndarray], np.ndarray],
        *,
        turn: float | Callable[[float], float],
    ) -> None:
        """`tonic_input` gives u0 (2m,) for a turn, an array (). `turn` is used if the port has no
        connection: a number, or a function from the time (s) to the turn."""
        super().__init__()
        self._tonic_input, self._default = tonic_input, turn
        self._turn = self.DeclareVectorInputPort("turn", 1)
        sources = {self._turn.ticket()}
        if callable(turn):
            sources.add(self.time_ticket())
        size = len(tonic_input(np.array(0.0)))
        self.DeclareVectorOutputPort("tonic", size, self._calc_tonic, sources)

    def _calc_tonic(self, context: Context, output: BasicVector) -> None:
        turn = self._default
        if self._turn.HasValue(context):
            turn = self._turn.Eval(context)[0]
        elif callable(turn):
            turn = turn(context.get_time())
        turn = checked_turn(turn, time=context.get_time())
        output.SetFromVector(self._tonic_input(np.array(turn)))
