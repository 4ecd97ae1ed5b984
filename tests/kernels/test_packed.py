"""Arguments that are packed once for all calls of a kernel. All kernels show that they arrive."""

import numpy as np

from tetra_drake.kernels.compiling import machine_code
from tetra_drake.kernels.packed import Packed
from tetra_drake.laws.forces import Forces, compute_state_forces
from tetra_drake.robot.robot import Robot


def test_robots_of_any_size_share_machine_code(scenario):
    codes = set()
    for count in (2, 5, 8):
        robot = Robot.of(scenario.with_changes({"robot.tetrahedra": count}))
        parts = Packed((robot.model, Forces.of(robot.model)))
        given = parts, robot.structure.initial_state, np.empty(6 * count)
        codes.add(machine_code(compute_state_forces, *given))
    assert len(codes) == 1
