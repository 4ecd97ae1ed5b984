"""The robot's structure, its inertia and its bodies in a plant."""

import itertools
import math

import numpy as np
import pytest
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame

from tetra_drake.physics.cable import PASSIVE
from tetra_drake.robot.bodies import (
    AddTetrahedra,
    node_inertia,
    strut_inertia,
    strut_pose,
    tetrahedron_inertia,
)
from tetra_drake.robot.structure import (
    NODES,
    STRUTS,
    MakeStructure,
    Structure,
    node_positions,
    node_velocities,
)

IN = 0.0254
NUMBERS = (2, 3, 5, 8)


@pytest.fixture
def structure(scenario) -> Structure:
    return MakeStructure(scenario.robot, scenario.cables)


@pytest.fixture
def make(scenario):
    """Makes the structure with a number of tetrahedra."""

    def make_structure(tetrahedra: int) -> Structure:
        scenario.robot.tetrahedra = tetrahedra
        return MakeStructure(scenario.robot, scenario.cables)

    return make_structure


def start(structure: Structure) -> np.ndarray:
    """p_WN (bodies, 4, 3) at t = 0."""
    return node_positions(structure, structure.initial_state).reshape(-1, 4, 3)


def random_state(structure: Structure, seed: int, quaternion_norm: float = 1.0) -> np.ndarray:
    generator = np.random.default_rng(seed)
    bodies = len(structure.bodies)
    quaternions = generator.normal(size=(bodies, 4))
    quaternions *= quaternion_norm / np.linalg.norm(quaternions, axis=1, keepdims=True)
    q = np.hstack([quaternions, generator.uniform(-1, 1, (bodies, 3))])
    return np.concatenate([q.ravel(), generator.uniform(-2, 2, 6 * bodies)])


def plant_with(structure: Structure) -> MultibodyPlant:
    plant = MultibodyPlant(time_step=0.0)
    AddTetrahedra(plant, structure)
    plant.Finalize()
    return plant


# The tetrahedron


def test_struts_of_six_inches_join_all_nodes_around_the_centre_of_mass(structure):
    assert sorted(STRUTS) == list(itertools.combinations(range(4), 2))
    edges = [np.linalg.norm(structure.p_BN[i] - structure.p_BN[j]) for i, j in STRUTS]
    assert edges == pytest.approx([6 * IN] * 6, rel=1e-14)
    assert structure.p_BN.mean(axis=0) == pytest.approx(np.zeros(3), abs=1e-17)


def test_the_base_triangle_stands_vertical_and_the_tip_points_forward(structure):
    left, right, top, tip = structure.p_BN
    assert left[0] == right[0] == top[0] < tip[0]
    assert left[1] == -right[1] > 0  # y points left
    assert left[2] == right[2] < top[2]
    assert top[1] == tip[1] == 0
    assert NODES == ("bottom_left", "bottom_right", "top", "tip")


def test_mass_is_that_of_six_cylinders_and_four_spheres(structure):
    rho, r, R, L = 2700.0, 0.0625 * IN, 0.1 * IN, 6 * IN
    mass = rho * (6 * math.pi * r**2 * L + 4 * (4 / 3) * math.pi * R**3)
    inertia = tetrahedron_inertia(structure)
    assert inertia.get_mass() == pytest.approx(mass, rel=1e-14)
    assert inertia.get_mass() == pytest.approx(20.29e-3, abs=0.005e-3)


def test_inertia_is_isotropic_about_the_centre_of_mass(structure):
    # By the tetrahedron's symmetry the inertia is I times the identity, and half its trace is
    # the integral of distance^2 over the mass: 3 I / 2. A strut's middle is L / sqrt(8) from
    # the centre, a node L sqrt(3/8). About its own centre a solid cylinder's integral is
    # m (L^2 / 12 + r^2 / 2), a solid sphere's m (3/5) R^2.
    rho, r, R, L = 2700.0, 0.0625 * IN, 0.1 * IN, 6 * IN
    strut = rho * math.pi * r**2 * L * (L**2 / 8 + L**2 / 12 + r**2 / 2)
    node = rho * (4 / 3) * math.pi * R**3 * (3 / 8 * L**2 + 3 / 5 * R**2)
    expected = (6 * strut + 4 * node) * 2 / 3

    inertia = tetrahedron_inertia(structure)
    matrix = inertia.CalcRotationalInertia().CopyToFullMatrix3()
    assert inertia.get_com() == pytest.approx(np.zeros(3), abs=0)
    assert np.diag(matrix) == pytest.approx([expected] * 3, rel=1e-14)
    assert matrix - np.diag(np.diag(matrix)) == pytest.approx(np.zeros((3, 3)), abs=0)
    assert expected == pytest.approx(6.74e-5, abs=0.005e-5)


def test_ten_bodies_welded_together_have_the_inertia_of_the_tetrahedron(structure):
    # As the thesis built it (appendix C.2): every part is welded to the first strut.
    parts = [(f"strut{s}", strut_inertia(structure, s), strut_pose(structure, s)) for s in STRUTS]
    parts += [
        (f"node{i}", node_inertia(structure), RigidTransform(p_BNi))
        for i, p_BNi in enumerate(structure.p_BN)
    ]
    plant = MultibodyPlant(time_step=0.0)
    bodies = [plant.AddRigidBody(name, inertia) for name, inertia, _ in parts]
    X_BF = parts[0][2]
    frame_B = plant.AddFrame(FixedOffsetFrame("B", bodies[0].body_frame(), X_BF.inverse()))
    for body, (_, _, X_BPart) in zip(bodies[1:], parts[1:], strict=True):
        plant.WeldFrames(frame_B, body.body_frame(), X_BPart)
    plant.Finalize()
    assert plant.num_velocities() == 6

    welded = plant.CalcSpatialInertia(
        plant.CreateDefaultContext(), frame_B, [body.index() for body in bodies]
    )
    one = tetrahedron_inertia(structure)
    I_welded = welded.CalcRotationalInertia().CopyToFullMatrix3()
    I_one = one.CalcRotationalInertia().CopyToFullMatrix3()
    assert one.get_mass() == pytest.approx(welded.get_mass(), rel=1e-12)
    assert welded.get_com() == pytest.approx(one.get_com(), abs=1e-12 * 6 * IN)
    assert I_one == pytest.approx(I_welded, rel=1e-12, abs=1e-12 * I_welded[0, 0])


def test_a_strut_lies_between_its_nodes(structure):
    for i, j in STRUTS:
        X_BS = strut_pose(structure, (i, j))
        ends = [X_BS.multiply(np.array([0, 0, z])) for z in (-3 * IN, 3 * IN)]
        assert ends[0] == pytest.approx(structure.p_BN[i], abs=1e-15)
        assert ends[1] == pytest.approx(structure.p_BN[j], abs=1e-15)


# Any number of tetrahedra


@pytest.mark.parametrize("n", NUMBERS)
def test_counts_follow_from_the_number_of_tetrahedra(make, n):
    structure = make(n)
    assert structure.bodies == tuple(f"T{i}" for i in range(1, n + 1))
    assert len(structure.cables) == len(structure.cable_names) == 6 * (n - 1)
    assert len(structure.contacts) == 2 * n + 1
    assert structure.signals == n - 1
    assert len(structure.node_names) == 4 * n
    assert structure.initial_state.shape == (13 * n,)


@pytest.mark.parametrize("n", NUMBERS)
def test_the_robot_starts_at_rest_on_its_bottom_nodes(make, n):
    structure = make(n)
    p_WN = start(structure)
    assert p_WN[:, :2, 2] == pytest.approx(np.zeros((n, 2)), abs=1e-16)
    assert p_WN[:, 2:, 2].min() > 0
    assert np.all(structure.initial_state[7 * n :] == 0)


@pytest.mark.parametrize("n", NUMBERS)
def test_base_triangles_are_parallel_and_spaced_evenly_from_zero_on(make, scenario, n):
    base_x = start(make(n))[:, :3, 0]
    expected = np.arange(n)[:, None] * scenario.robot.spacing * np.ones(3)
    assert base_x == pytest.approx(expected, abs=1e-16)


@pytest.mark.parametrize("n", NUMBERS)
def test_the_robot_starts_left_right_symmetric(make, n):
    p_WN = start(make(n))
    mirrored = p_WN[:, [1, 0, 2, 3]] * [1, -1, 1]
    assert np.array_equal(mirrored, p_WN)


@pytest.mark.parametrize("n", NUMBERS)
def test_each_junction_has_three_outer_and_three_inner_cables_named_by_their_ends(make, n):
    structure = make(n)
    base = ("bottom_left", "bottom_right", "top")
    junctions = [
        (f"T{i}-T{i + 1}", role, node)
        for i in range(1, n)
        for role in ("outer", "inner")
        for node in base
    ]
    assert structure.cable_names == tuple(" ".join(names) for names in junctions)
    for name, cable in zip(structure.cable_names, structure.cables, strict=True):
        a, b = (structure.node_names[cable[end]].split() for end in ("node_a", "node_b"))
        kind = "inner" if a[1] == "tip" else "outer"
        assert name == f"{a[0]}-{b[0]} {kind} {b[1]}"


@pytest.mark.parametrize("n", NUMBERS)
def test_signal_i_drives_the_two_bottom_outer_cables_of_junction_i(make, n):
    structure = make(n)
    driven = {
        name: int(cable["signal"])
        for name, cable in zip(structure.cable_names, structure.cables, strict=True)
        if cable["signal"] != PASSIVE
    }
    assert driven == {
        f"T{i + 1}-T{i + 2} outer {node}": i
        for i in range(n - 1)
        for node in ("bottom_left", "bottom_right")
    }


def test_outer_and_inner_cables_have_their_own_stiffness(structure, scenario):
    for name, cable in zip(structure.cable_names, structure.cables, strict=True):
        kind = scenario.cables.outer_stiffness, scenario.cables.inner_stiffness
        assert cable["stiffness"] == kind["inner" in name]
        assert cable["damping"] == scenario.cables.damping
        assert cable["free_length"] == scenario.cables.free_length


@pytest.mark.parametrize("n", NUMBERS)
def test_initial_cable_lengths_follow_from_the_spacing(make, scenario, n):
    # Outer: the spacing s. Inner: from the tip, on the axis at height h = sqrt(2/3) L over its
    # base, to nodes at s and R = L / sqrt(3) off the axis.
    structure, L, s = make(n), scenario.robot.strut_length, scenario.robot.spacing
    inner = math.hypot(math.sqrt(2 / 3) * L - s, L / math.sqrt(3))
    p_WN = start(structure).reshape(-1, 3)
    for name, cable in zip(structure.cable_names, structure.cables, strict=True):
        length = np.linalg.norm(p_WN[cable["node_b"]] - p_WN[cable["node_a"]])
        assert length == pytest.approx(inner if "inner" in name else s, rel=1e-14)


@pytest.mark.parametrize("n", NUMBERS)
def test_the_ground_touches_all_bottom_nodes_and_the_lead_tip(make, n):
    structure = make(n)
    touched = [structure.node_names[i] for i in structure.contacts]
    bottom = [f"T{i} {node}" for i in range(1, n + 1) for node in ("bottom_left", "bottom_right")]
    assert touched == [*bottom, f"T{n} tip"]


# The bodies in a plant


@pytest.mark.parametrize("n", NUMBERS)
def test_the_plants_state_runs_body_by_body(make, n):
    structure = make(n)
    plant = plant_with(structure)
    assert (plant.num_positions(), plant.num_velocities()) == (7 * n, 6 * n)
    context = plant.CreateDefaultContext()
    state = random_state(structure, seed=n)
    plant.SetPositionsAndVelocities(context, state)
    for i, name in enumerate(structure.bodies):
        body = plant.GetBodyByName(name)
        assert body.floating_positions_start() == 7 * i
        assert body.floating_velocities_start_in_v() == 6 * i
        inertia = body.default_spatial_inertia().CopyToFullMatrix6()
        assert np.array_equal(inertia, tetrahedron_inertia(structure).CopyToFullMatrix6())
        quaternion, p_WB = state[7 * i : 7 * i + 4], state[7 * i + 4 : 7 * i + 7]
        w_WB, v_WB = state[7 * n + 6 * i :][:3], state[7 * n + 6 * i :][3:6]
        X_WB = RigidTransform(Quaternion(quaternion), p_WB)
        assert plant.EvalBodyPoseInWorld(context, body).IsNearlyEqualTo(X_WB, 1e-15)
        V_WB = plant.EvalBodySpatialVelocityInWorld(context, body)
        assert V_WB.rotational() == pytest.approx(w_WB, abs=1e-15)
        assert V_WB.translational() == pytest.approx(v_WB, abs=1e-15)


@pytest.mark.parametrize(("n", "seed"), [(2, 0), (5, 1), (8, 2)])
def test_node_motion_agrees_with_frames_fixed_to_the_plants_bodies(make, n, seed):
    structure = make(n)
    plant = MultibodyPlant(time_step=0.0)
    frames = [
        plant.AddFrame(FixedOffsetFrame(f"{body.name()} {node}", body, RigidTransform(p_BNi)))
        for body in AddTetrahedra(plant, structure)
        for node, p_BNi in zip(NODES, structure.p_BN, strict=True)
    ]
    plant.Finalize()
    assert tuple(frame.name() for frame in frames) == structure.node_names

    context = plant.CreateDefaultContext()
    state = random_state(structure, seed)
    plant.SetPositionsAndVelocities(context, state)
    p_WN = [frame.CalcPoseInWorld(context).translation() for frame in frames]
    v_WN = [frame.CalcSpatialVelocityInWorld(context).translational() for frame in frames]
    assert node_positions(structure, state) == pytest.approx(np.array(p_WN), abs=1e-12)
    assert node_velocities(structure, state) == pytest.approx(np.array(v_WN), abs=1e-12)


def test_a_quaternion_that_drifted_off_unit_length_still_is_a_rotation(structure):
    # The integrator does not keep quaternions at length 1.
    state = random_state(structure, seed=1)
    drifted = random_state(structure, seed=1, quaternion_norm=1.01)
    assert node_positions(structure, drifted) == pytest.approx(
        node_positions(structure, state), abs=1e-12
    )
