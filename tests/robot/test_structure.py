"""The robot's structure, its inertia and its bodies in a plant."""

import math

import numpy as np
import pytest
from helpers.states import disturbed
from pydrake.multibody.plant import MultibodyPlant

from tetra_drake.laws.kinematics import V_WN
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import AddBodies, AddNodes, Structure, moved_nodes, node_positions
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.robot_tetrahedra import NODES, STRUTS

IN = 0.0254


@pytest.fixture(params=[2, 5])
def row(request, scenario) -> Structure:
    """A structure of some number of tetrahedra."""
    scenario = scenario.with_changes({"robot.tetrahedra": request.param})
    structure = Robot.of(scenario).structure
    assert len(structure.bodies) == request.param
    return structure


def start(structure: Structure) -> np.ndarray:
    """p_WN (bodies, 4, 3) at t = 0."""
    return node_positions(structure, structure.initial_state).reshape(-1, 4, 3)


def test_struts_of_six_inches_join_all_nodes_base_vertical_and_tip_forward(structure):
    edges = [np.linalg.norm(structure.p_BN[i] - structure.p_BN[j]) for i, j in STRUTS]
    assert edges == pytest.approx([6 * IN] * 6, rel=1e-14)
    assert structure.p_BN[:4].mean(axis=0) == pytest.approx(np.zeros(3), abs=1e-17)
    left, right, top, tip = structure.p_BN[:4]
    assert left[0] == right[0] == top[0] < tip[0]
    assert left[1] == -right[1] > 0  # y points left
    assert left[2] == right[2] < top[2]
    assert top[1] == tip[1] == 0
    assert NODES == ("bottom_left", "bottom_right", "top", "tip")


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


def test_the_robot_starts_at_rest_on_its_bottom_nodes_evenly_spaced_and_symmetric(row, scenario):
    p_WN = start(row)
    assert p_WN[:, :2, 2] == pytest.approx(0, abs=1e-16)
    assert p_WN[:, 2:, 2].min() > 0
    assert not row.initial_state[7 * len(row.bodies) :].any()
    expected = np.arange(len(row.bodies))[:, None] * scenario.robot.spacing * np.ones(3)
    assert p_WN[:, :3, 0] == pytest.approx(expected, abs=1e-16)
    assert np.array_equal(p_WN[:, [1, 0, 2, 3]] * [1, -1, 1], p_WN)


def test_outer_and_inner_cables_have_their_own_stiffness_and_length(row, scenario):
    # Outer: the spacing s. Inner: from the tip, on the axis at height h = sqrt(2/3) L over its
    # base, to nodes at s and R = L / sqrt(3) off the axis.
    L, s, law = scenario.robot.strut_length, scenario.robot.spacing, scenario.robot.cables
    inner_length = math.hypot(math.sqrt(2 / 3) * L - s, L / math.sqrt(3))
    p_WN = start(row).reshape(-1, 3)
    for name, cable in zip(row.cable_names, row.cables, strict=True):
        inner = "inner" in name
        assert cable["stiffness"] == (law.inner_stiffness if inner else law.outer_stiffness)
        assert (cable["damping"], cable["free_length"]) == (law.damping, law.free_length)
        assert name.endswith(row.node_names[cable["node_b"]].split()[1])
        length = np.linalg.norm(p_WN[cable["node_b"]] - p_WN[cable["node_a"]])
        assert length == pytest.approx(inner_length if inner else s, rel=1e-14)


@pytest.mark.parametrize("name", ["thesis", "prism", "mast"])
def test_node_motion_agrees_with_frames_fixed_to_the_plants_bodies(name):
    # This needs the plant's state to run body by body, in the structure's order.
    structure = Robot.of(load_scenario(name)).structure
    plant = MultibodyPlant(time_step=0.0)
    bodies = AddBodies(plant, structure)
    frames = AddNodes(plant, structure, bodies)
    plant.Finalize()
    context, state = plant.CreateDefaultContext(), disturbed(structure, 0, pose=1.0, speed=1.0)
    plant.SetPositionsAndVelocities(context, state)
    p_WN = [frame.CalcPoseInWorld(context).translation() for frame in frames]
    v_WN = [frame.CalcSpatialVelocityInWorld(context).translational() for frame in frames]
    assert node_positions(structure, state) == pytest.approx(np.array(p_WN), abs=1e-12)
    found = moved_nodes(structure, state)[:, V_WN : V_WN + 3]
    assert found == pytest.approx(np.array(v_WN), abs=1e-12)


def test_a_quaternion_that_drifted_off_unit_length_still_is_a_rotation(structure):
    # The integrator does not keep quaternions at length 1.
    state = disturbed(structure, 0, pose=1.0, speed=1.0)
    p_WN = node_positions(structure, state)
    state[:35].reshape(5, 7)[:, :4] *= 1.01
    assert node_positions(structure, state) == pytest.approx(p_WN, abs=1e-12)
