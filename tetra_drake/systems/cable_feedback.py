"""The feedback to the oscillators as a system."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from tetra_drake.physics.feedback import sense
from tetra_drake.robot.robot import Robot


class Feedback(LeafSystem):
    """Feedback that the oscillators sense (see physics.feedback); no state.

    | port          | shape        | unit | meaning                                          |
    |---------------|--------------|------|--------------------------------------------------|
    | state         | (13 n,)      | SI   | [q; v] of n free bodies, from the plant          |
    | lengths       | (6 (n - 1),) | m    | length of each cable, from the cables            |
    | normal_forces | (contacts,)  | N    | at each contact node, from the ground            |
    | feedback      | (2m,)        | 1    | f of Eq. 7 for the neurons of m oscillators      |
    """

    def __init__(self, robot: Robot, *, gains: npt.ArrayLike) -> None:
        """`gains` of length, load and pitch. Raises InputError if the robot finds no rest."""
        super().__init__()
        structure, self._senses = robot.structure, robot.senses
        self._gains = np.array(gains, dtype=float)
        self._neurons = 2 * structure.signals
        sizes = 13 * len(structure.bodies), len(structure.cables), len(structure.contacts)
        names = ("state", "lengths", "normal_forces")
        self._inputs = [
            self.DeclareVectorInputPort(name, size) for name, size in zip(names, sizes, strict=True)
        ]
        tickets = {port.ticket() for port in self._inputs}
        self.DeclareVectorOutputPort("feedback", self._neurons, self._calc_feedback, tickets)

    def _calc_feedback(self, context: Context, output: BasicVector) -> None:
        feedback = np.empty(self._neurons)
        state, lengths, normal_forces = (port.Eval(context) for port in self._inputs)
        sense(self._senses, self._gains, state, lengths, normal_forces, feedback)
        output.SetFromVector(feedback)
