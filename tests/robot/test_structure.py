"""The robot's structure, its inertia and its bodies in a plant."""

import numpy as np
import pytest
from helpers.states import disturbed

from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import node_positions


def test_a_tetrahedron_has_the_mass_and_the_inertia_of_the_thesis_in_all_directions(structure):
    # 20.29 g and 6.74e-5 kg m²; that bodies have those of their parts is tested on a bent one.
    assert structure.mass == pytest.approx([20.29e-3] * 5, abs=0.005e-3)
    moments = structure.mass[:, np.newaxis] * structure.unit_inertia
    expected = np.tile([6.74e-5] * 3 + [0.0] * 3, (5, 1))
    assert moments == pytest.approx(expected, abs=0.005e-5)
    assert structure.isotropic


def test_a_payload_adds_mass_and_weight_but_no_inertia_about_the_centre(scenario, structure):
    payload = np.array([0.036, 0.036, 0.0, 0.07, 0.0])
    loaded = Robot.of(scenario.with_changes({"robot.payload": [f"{kg} kg" for kg in payload]}))
    mass = structure.mass + payload
    assert loaded.structure.mass == pytest.approx(mass, rel=1e-15)
    assert loaded.weight == pytest.approx(9.80665 * mass.sum(), rel=1e-14)
    moments = structure.mass[:, np.newaxis] * structure.unit_inertia
    assert loaded.model.bodies.inertia == pytest.approx(moments, rel=1e-14)
    assert loaded.structure.p_BN == pytest.approx(structure.p_BN, abs=0.0)
    assert loaded.structure.isotropic


def test_a_quaternion_that_drifted_off_unit_length_still_is_a_rotation(structure):
    # The integrator does not keep quaternions at length 1.
    state = disturbed(structure, 0, pose=1.0, speed=1.0)
    p_WN = node_positions(structure, state)
    state[:35].reshape(5, 7)[:, :4] *= 1.01
    assert node_positions(structure, state) == pytest.approx(p_WN, abs=1e-12)
