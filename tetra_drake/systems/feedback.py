"""Feedback from the robot to its oscillators, as a LeafSystem."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from pydrake.systems.framework import BasicVector, Context

from tetra_drake.kernels.compiling import machine_code
from tetra_drake.kernels.packed import Packed
from tetra_drake.laws.contact import MODE_COLUMNS
from tetra_drake.laws.feedback import compute_feedback
from tetra_drake.laws.forces import Forces
from tetra_drake.robot.robot import Robot
from tetra_drake.systems.scalar_conversion import ConvertibleSystem


class Feedback(ConvertibleSystem):
    """Feedback from a robot's motion and contacts to its oscillators (see laws.feedback).

    The system has no state.

    | port       | in, out | shape          | unit   | meaning                                  |
    |------------|---------|----------------|--------|------------------------------------------|
    | state      | in      | (13*n,)        | SI     | [q; v] of n free bodies, from the plant  |
    | signals    | in      | (m,)           | N      | actuator signals, one per oscillator     |
    | drives     | in      | (drives,)      | m or N | states of the actuators: free length or  |
    |            |         |                |        | tension of each driven cable             |
    | mode_table | in      | (12*contacts,) | SI     | state of the contacts, from the port of  |
    |            |         |                |        | GroundContact                            |
    | feedback   | out     | (2m,)          | 1      | f of thesis Eq. 7, for the neurons of m  |
    |            |         |                |        | oscillators                              |

    The port `drives` exists only if the kind of actuators has states.
    """

    def __init__(self, robot: Robot, *, gains: npt.ArrayLike) -> None:
        """Makes the feedback of a robot. `gains` (pathways,) has a gain for each pathway, which
        leads from one kind of reading to the neurons; laws.feedback.PATHWAYS has their order.

        Raises InputError if lengths are fed back and the robot has no equilibrium to compare with.
        """
        super().__init__()
        forces, signals = Forces.of(robot.model), robot.structure.signals
        self._no_drives = np.zeros(0)
        parts = Packed((robot.model, forces, robot.senses, np.array(gains, dtype=float)))
        sizes = {"state": 13 * len(robot.structure.bodies), "signals": signals}
        sizes["mode_table"] = len(robot.structure.contacts) * MODE_COLUMNS
        if drives := len(forces.drives):
            sizes["drives"] = drives
        self._ports = {name: self.DeclareVectorInputPort(name, sizes[name]) for name in sizes}
        tickets = {port.ticket() for port in self._ports.values()}
        self.DeclareVectorOutputPort("feedback", 2 * signals, self._calc_feedback, tickets)
        state, modes = np.empty(sizes["state"]), np.empty((0, MODE_COLUMNS))
        given = state, modes, np.empty(signals), self._no_drives, np.empty(2 * signals)
        self._compute = machine_code(compute_feedback, parts, *given)

    def _calc_feedback(self, context: Context, output: BasicVector) -> None:
        given = {name: port.Eval(context) for name, port in self._ports.items()}
        modes = given["mode_table"].reshape(-1, MODE_COLUMNS)
        drives, feedback = given.get("drives", self._no_drives), output.get_mutable_value()
        self._compute(given["state"], modes, given["signals"], drives, feedback)
