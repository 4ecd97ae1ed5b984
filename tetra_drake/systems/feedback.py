"""Feedback to the oscillators as a LeafSystem."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from tetra_drake.laws.cable import CABLE_FORCE_COLUMNS
from tetra_drake.laws.contact import GROUND_FORCE_COLUMNS
from tetra_drake.laws.feedback import sense
from tetra_drake.robot.robot import Robot


class Feedback(LeafSystem):
    """Feedback from cables, ground and bodies to the oscillators (see laws.feedback). It has no
    state.

    | port          | shape         | unit | meaning                                               |
    |---------------|---------------|------|-------------------------------------------------------|
    | state         | (13 n,)       | SI   | [q; v] of n free bodies, from the plant               |
    | cable_forces  | (7 cables,)   | SI   | table of laws.cable, row by row, from the cables      |
    | ground_forces | (3 contacts,) | N    | table of laws.contact, row by row, from the ground    |
    | feedback      | (2m,)         | 1    | f of Eq. 7 for the neurons of m oscillators           |
    """

    def __init__(self, robot: Robot, *, gains: npt.ArrayLike) -> None:
        """`gains` are in the order of Gains. Raises InputError if the robot has no equilibrium."""
        super().__init__()
        structure = robot.structure
        self._senses = robot.senses
        self._gains = np.array(gains, dtype=float)
        self._neurons = 2 * structure.signals
        self._state = self.DeclareVectorInputPort("state", 13 * len(structure.bodies))
        cables, contacts = len(structure.cables), len(structure.contacts)
        self._cables = self.DeclareVectorInputPort("cable_forces", CABLE_FORCE_COLUMNS * cables)
        self._ground = self.DeclareVectorInputPort("ground_forces", GROUND_FORCE_COLUMNS * contacts)
        inputs = {self._state.ticket(), self._cables.ticket(), self._ground.ticket()}
        self.DeclareVectorOutputPort("feedback", self._neurons, self._calc_feedback, inputs)

    def _calc_feedback(self, context: Context, output: BasicVector) -> None:
        sense(
            self._senses,
            self._gains,
            self._state.Eval(context),
            self._cables.Eval(context).reshape(-1, CABLE_FORCE_COLUMNS),
            self._ground.Eval(context).reshape(-1, GROUND_FORCE_COLUMNS),
            output.get_mutable_value(),
        )
