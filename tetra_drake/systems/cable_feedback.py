"""Feedback to the oscillators as a LeafSystem."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from tetra_drake.physics.feedback import sense
from tetra_drake.robot.robot import Robot


class Feedback(LeafSystem):
    """Feedback from cables, ground and bodies to the oscillators (see physics.feedback). It has no
    state.

    | port          | shape        | unit | meaning                                          |
    |---------------|--------------|------|--------------------------------------------------|
    | state         | (13 n,)      | SI   | [q; v] of n free bodies, from the plant          |
    | lengths       | (cables,)    | m    | length of each cable, from the cables            |
    | normal_forces | (contacts,)  | N    | at each contact node, from the ground            |
    | feedback      | (2m,)        | 1    | f of Eq. 7 for the neurons of m oscillators      |
    """

    def __init__(self, robot: Robot, *, gains: npt.ArrayLike) -> None:
        """`gains` are for length, load and pitch. Raises InputError if the robot has no
        equilibrium."""
        super().__init__()
        structure = robot.structure
        self._senses = robot.senses
        self._gains = np.array(gains, dtype=float)
        self._neurons = 2 * structure.signals
        self._state = self.DeclareVectorInputPort("state", 13 * len(structure.bodies))
        self._lengths = self.DeclareVectorInputPort("lengths", len(structure.cables))
        self._loads = self.DeclareVectorInputPort("normal_forces", len(structure.contacts))
        inputs = {self._state.ticket(), self._lengths.ticket(), self._loads.ticket()}
        self.DeclareVectorOutputPort("feedback", self._neurons, self._calc_feedback, inputs)

    def _calc_feedback(self, context: Context, output: BasicVector) -> None:
        sense(
            self._senses,
            self._gains,
            self._state.Eval(context),
            self._lengths.Eval(context),
            self._loads.Eval(context),
            output.get_mutable_value(),
        )
