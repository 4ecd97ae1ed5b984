"""All cables of the robot as a system."""

from __future__ import annotations

import numpy as np
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from tetra_drake.physics.actuator import DRIVE, RATE
from tetra_drake.physics.cable import LENGTH, TENSION, cable_forces
from tetra_drake.physics.forces import Forces
from tetra_drake.robot.robot import Robot


class CableNetwork(LeafSystem):
    """The cables between the bodies (thesis Eq. 6); no state.

    | port              | shape          | unit   | meaning                                  |
    |-------------------|----------------|--------|------------------------------------------|
    | state             | (13 n,)        | SI     | [q; v] of n free bodies, from the plant  |
    | signals           | (m,)           | N      | actuation, one per oscillator            |
    | drives            | (drives,)      | m or N | of winches or motors, from `actuators`   |
    | generalized_force | (6 n,)         | N m, N | [t_W; f_W] at each body's origin         |
    | tensions          | (cables,)      | N      | tension of each cable                    |
    | lengths           | (cables,)      | m      | length of each cable                     |
    | rates             | (drives,)      | 1/s    | rate of each drive, in its unit per s    |

    With `robot.cables.slack`, a cable that would have to push goes slack. Ports of drives are there
    with `actuation` of winches or tension motors only.
    """

    def __init__(self, robot: Robot) -> None:
        super().__init__()
        structure, self._model = robot.structure, robot.model
        bodies, count = len(structure.bodies), len(structure.cables)
        # Room for the kernel, which writes all of it at every call.
        self._forces = Forces.of(self._model)
        self._force = np.empty(6 * bodies)
        self._state = self.DeclareVectorInputPort("state", 13 * bodies)
        self._signals = self.DeclareVectorInputPort("signals", structure.signals)
        inputs = {self._state.ticket(), self._signals.ticket()}
        self._drives, drives = None, len(self._forces.drives)
        if drives:
            self._drives = self.DeclareVectorInputPort("drives", drives)
            inputs.add(self._drives.ticket())
            self.DeclareVectorOutputPort("rates", drives, self._calc_rates, inputs)
        self.DeclareVectorOutputPort("generalized_force", 6 * bodies, self._calc_force, inputs)
        self.DeclareVectorOutputPort("tensions", count, self._calc_tensions, inputs)
        self.DeclareVectorOutputPort("lengths", count, self._calc_lengths, inputs)

    def _pull(self, context: Context) -> None:
        """Writes the generalized force and the cables' `pulls`."""
        if self._drives is not None:
            self._forces.drives[:, DRIVE] = self._drives.Eval(context)
        cable_forces(
            self._state.Eval(context),
            self._signals.Eval(context),
            self._model.p_BN,
            self._model.first_node,
            self._model.cables,
            *self._model.actuator,
            self._model.slack,
            self._forces.drives,
            self._forces.nodes,
            self._forces.pulls,
            self._force,
        )

    def _calc_force(self, context: Context, output: BasicVector) -> None:
        self._pull(context)
        output.SetFromVector(self._force)

    def _calc_tensions(self, context: Context, output: BasicVector) -> None:
        self._pull(context)
        output.SetFromVector(self._forces.pulls[:, TENSION])

    def _calc_lengths(self, context: Context, output: BasicVector) -> None:
        self._pull(context)
        output.SetFromVector(self._forces.pulls[:, LENGTH])

    def _calc_rates(self, context: Context, output: BasicVector) -> None:
        self._pull(context)
        output.SetFromVector(self._forces.drives[:, RATE])
