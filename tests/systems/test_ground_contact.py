"""The ground as a system: how it starts. Engines agree with both of its placements of events.

A lone tetrahedron settles and slides on it in tests/diagrams/test_one_tetrahedron.py.
"""

import numpy as np
import pytest
from one_tetrahedron import make_diagram, make_standing_tetrahedron
from pydrake.systems.analysis import Simulator

from tetra_drake.physics.contact import CONTACT, MODE, MODE_COLUMNS
from tetra_drake.physics.friction import STICK
from tetra_drake.robot.structure import node_positions


@pytest.mark.parametrize(("height", "touches"), [(-1e-5, True), (1e-5, False)])
def test_initialize_takes_contact_and_stick_points_from_the_pose(scenario, height, touches):
    structure = make_standing_tetrahedron(scenario).structure
    simulator, state = Simulator(make_diagram(scenario)), structure.initial_state
    state[6] += height
    simulator.get_mutable_context().SetContinuousState(state)
    simulator.Initialize()
    ground = simulator.get_system().GetSubsystemByName("ground")
    context = ground.GetMyContextFromRoot(simulator.get_context())
    modes = context.get_discrete_state_vector().value().reshape(3, MODE_COLUMNS)
    assert (modes[:, CONTACT] == touches).all()
    assert (modes[:, MODE : MODE + 2] == STICK).all()
    if touches:
        p_WN = node_positions(structure, state)
        np.testing.assert_allclose(modes[:, 3:5], p_WN[:3, :2], atol=1e-15)
