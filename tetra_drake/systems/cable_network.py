"""Cables of the robot as a LeafSystem."""

from __future__ import annotations

import numpy as np
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from tetra_drake.physics import actuator, cable
from tetra_drake.physics.forces import Forces, compute_cable_forces
from tetra_drake.robot.robot import Robot
from tetra_drake.simd.compiling import machine_code
from tetra_drake.simd.packed import Packed


class CableNetwork(LeafSystem):
    """Cables between the bodies (thesis Eq. 6). The system has no state.

    | port              | shape          | unit   | meaning                                  |
    |-------------------|----------------|--------|------------------------------------------|
    | state             | (13 n,)        | SI     | [q; v] of n free bodies, from the plant  |
    | signals           | (m,)           | N      | actuation, one per oscillator            |
    | drives            | (drives,)      | m or N | states of the actuators                  |
    | generalized_force | (6 n,)         | N m, N | [t_W; f_W] at each body's origin         |
    | tensions          | (cables,)      | N      | tension of each cable                    |
    | lengths           | (cables,)      | m      | length of each cable                     |
    | rates             | (cables,)      | m/s    | rate of each cable's length              |
    | cable_forces      | (7 cables,)    | SI     | table of physics.cable, row by row       |
    | drive_rates       | (drives,)      | 1/s    | rate of each drive, in its unit per s    |

    `lengths` and `rates` depend on the state alone, so a controller of lengths makes no algebraic
    loop. With `robot.cables.slack`, a cable goes slack instead of pushing. The ports `drives` and
    `drive_rates` exist only if the kind of actuators has states.
    """

    def __init__(self, robot: Robot) -> None:
        super().__init__()
        structure = robot.structure
        bodies, count = len(structure.bodies), len(structure.cables)
        # The kernel writes to these arrays at every call.
        self._forces, self._force = Forces.of(robot.model), np.empty(6 * bodies)
        self._parts = Packed((robot.model, self._forces))
        state, self._no_signals = np.empty(13 * bodies), np.zeros(structure.signals)
        self._compute_forces = machine_code(
            compute_cable_forces, self._parts, state, self._no_signals, self._force
        )
        self._state = self.DeclareVectorInputPort("state", state.size)
        self._signals = self.DeclareVectorInputPort("signals", structure.signals)
        motion = {self._state.ticket()}
        inputs = motion | {self._signals.ticket()}
        self._drives, drives = None, len(self._forces.drives)
        if drives:
            self._drives = self.DeclareVectorInputPort("drives", drives)
            inputs.add(self._drives.ticket())
            self.DeclareVectorOutputPort("drive_rates", drives, self._calc_drive_rates, inputs)
        self.DeclareVectorOutputPort("generalized_force", 6 * bodies, self._calc_force, inputs)
        self.DeclareVectorOutputPort("tensions", count, self._calc_tensions, inputs)
        self.DeclareVectorOutputPort("lengths", count, self._calc_lengths, motion)
        self.DeclareVectorOutputPort("rates", count, self._calc_rates, motion)
        size = self._forces.cable_forces.size
        self.DeclareVectorOutputPort("cable_forces", size, self._calc_table, inputs)

    def _compute(self, context: Context, force: np.ndarray) -> None:
        """Writes the generalized force to `force`, and the table `cable_forces`."""
        if self._drives is not None:
            self._forces.drives[:, actuator.DRIVE] = self._drives.Eval(context)
        state, signals = self._state.Eval(context), self._signals.Eval(context)
        self._compute_forces(self._parts, state, signals, force)

    def _move(self, context: Context) -> np.ndarray:
        """The table `cable_forces`; only lengths and rates are valid."""
        state = self._state.Eval(context)
        self._compute_forces(self._parts, state, self._no_signals, self._force)
        return self._forces.cable_forces

    def _calc_force(self, context: Context, output: BasicVector) -> None:
        self._compute(context, output.get_mutable_value())

    def _calc_tensions(self, context: Context, output: BasicVector) -> None:
        self._compute(context, self._force)
        output.SetFromVector(self._forces.cable_forces[:, cable.TENSION])

    def _calc_lengths(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._move(context)[:, cable.LENGTH])

    def _calc_rates(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._move(context)[:, cable.RATE])

    def _calc_table(self, context: Context, output: BasicVector) -> None:
        self._compute(context, self._force)
        output.SetFromVector(self._forces.cable_forces.ravel())

    def _calc_drive_rates(self, context: Context, output: BasicVector) -> None:
        self._compute(context, self._force)
        output.SetFromVector(self._forces.drives[:, actuator.RATE])
