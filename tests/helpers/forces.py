"""The forces of the compiled engine at a state."""

from tetra_drake.physics.forces import Forces, compute_forces, move_robot
from tetra_drake.physics.model import Model
from tetra_drake.simd.compiling import compiled
from tetra_drake.simd.lanes import Table


@compiled
def forces_at(
    robot: Model, state: Table, modes: Table, signals: Table, forces: Forces, generalized: Table
) -> None:
    """Writes the `forces` and the generalized force (6 bodies,) in the modes of contacts."""
    move_robot(robot, state, forces)
    compute_forces(robot, state, modes, signals, True, forces, generalized)
