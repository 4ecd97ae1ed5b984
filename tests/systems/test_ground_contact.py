"""The ground as a system: its ports, its discrete state and its two placements of events."""

import dataclasses
import math
from collections.abc import Callable

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import DiagramBuilder

from tetra_drake.physics.contact import CONTACT, MODE, MODE_COLUMNS
from tetra_drake.physics.friction import STICK
from tetra_drake.robot.bodies import AddTetrahedra
from tetra_drake.robot.structure import (
    BOTTOM_LEFT,
    BOTTOM_RIGHT,
    TIP,
    MakeStructure,
    Structure,
    node_positions,
)
from tetra_drake.scenario.schema import Scenario
from tetra_drake.systems import GroundContact

MakeSimulator = Callable[..., Simulator]


@pytest.fixture
def structure(scenario: Scenario) -> Structure:
    """One tetrahedron (of two), standing on a face: three contact nodes at height 0."""
    scenario.robot.tetrahedra = 2
    pair = MakeStructure(scenario.robot, scenario.cables)
    face = np.array([BOTTOM_LEFT, BOTTOM_RIGHT, TIP])
    lone = {"bodies": ("T1",), "p_WB": pair.p_WB[:1], "contacts": face}
    return dataclasses.replace(pair, cables=pair.cables[:0], cable_names=(), **lone)


@pytest.fixture
def make_simulator(scenario: Scenario, structure: Structure) -> MakeSimulator:
    """make_simulator(height=, v_x=, witness=, max_step=, accuracy=): of the tetrahedron, its
    face `height` (m) over the ground, moving along x at v_x (m/s)."""

    def make(
        *,
        height: float = 0.0,
        v_x: float = 0.0,
        witness: bool = False,
        max_step: float = 1e-4,
        accuracy: float = 1e-6,
    ) -> Simulator:
        builder = DiagramBuilder()
        plant = builder.AddNamedSystem("plant", MultibodyPlant(0.0))
        AddTetrahedra(plant, structure)
        plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -scenario.robot.gravity])
        plant.Finalize()
        system = GroundContact(structure, scenario.ground, scenario.friction, witness=witness)
        ground = builder.AddNamedSystem("ground", system)
        builder.Connect(plant.get_state_output_port(), ground.GetInputPort("state"))
        force = plant.get_applied_generalized_force_input_port()
        builder.Connect(ground.GetOutputPort("generalized_force"), force)
        simulator = Simulator(builder.Build())
        integrator = ResetIntegratorFromFlags(simulator, "runge_kutta3", max_step)
        integrator.set_target_accuracy(accuracy)
        context = simulator.get_mutable_context()
        context.SetAccuracy(1e-6)  # a witness window of 0.01 s times that
        context.SetContinuousState(standing(structure, height=height, v_x=v_x))
        simulator.Initialize()
        return simulator

    return make


def standing(structure: Structure, *, height: float, v_x: float) -> np.ndarray:
    """The state (13,) of the tetrahedron on its face."""
    # Pitching by the angle between a face and the base's normal brings the tip down to the
    # height of the bottom nodes.
    bottom, tip = structure.p_BN[0], structure.p_BN[3]
    pitch = math.atan2(tip[2] - bottom[2], tip[0] - bottom[0])
    state = np.zeros(13)
    state[[0, 2]] = math.cos(pitch / 2), math.sin(pitch / 2)
    state[6] = height - node_positions(structure, state)[0, 2]
    state[10] = v_x
    return state


def state_of(simulator: Simulator) -> np.ndarray:
    return simulator.get_context().get_continuous_state_vector().CopyToVector()


def modes_of(simulator: Simulator) -> np.ndarray:
    ground = simulator.get_system().GetSubsystemByName("ground")
    context = ground.GetMyContextFromRoot(simulator.get_context())
    return context.get_discrete_state_vector().value().reshape(-1, MODE_COLUMNS).copy()


@pytest.mark.parametrize(("height", "touches"), [(0.0, True), (-1e-5, True), (1e-5, False)])
def test_initialize_takes_contact_and_stick_points_from_the_pose(
    make_simulator: MakeSimulator, structure: Structure, height: float, touches: bool
) -> None:
    # The tip's height is 0 to rounding only; the two bottom nodes decide.
    simulator = make_simulator(height=height)
    modes = modes_of(simulator)
    assert (modes[:2, CONTACT] == touches).all()
    assert (modes[:, MODE : MODE + 2] == STICK).all()
    if touches:
        p_WN = node_positions(structure, state_of(simulator))[[0, 1]]
        np.testing.assert_allclose(modes[:2, 3:5], p_WN[:, :2], atol=1e-15)


def test_a_sliding_tetrahedron_breaks_free_sticks_again_and_stops(
    make_simulator: MakeSimulator,
) -> None:
    # Fig. 6: the slide ends by itself, in stick, after having broken free at least once.
    simulator = make_simulator(height=-2e-5, v_x=1.5, witness=True, max_step=1e-3)
    slipping: list[bool] = []
    simulator.set_monitor(lambda _: slipping.append((modes_of(simulator)[:, MODE] != STICK).any()))
    simulator.AdvanceTo(0.3)
    assert any(slipping) and not slipping[-1]
    np.testing.assert_allclose(state_of(simulator)[7:], 0.0, atol=1e-6)


def test_both_placements_agree_on_a_sliding_tetrahedron(
    scenario: Scenario, make_simulator: MakeSimulator
) -> None:
    # A step end comes late, so the node sticks on beyond its range and slides less far: the
    # less the shorter the steps. Measured: 4.7 % at 0.1 ms, 1.0 % at 0.01 ms, 0.3 % at 1 us,
    # against a witness with a window of 10 ns, which takes fewer evaluations than any.
    def travel(*, witness: bool, max_step: float, accuracy: float) -> tuple[float, int]:
        simulator = make_simulator(
            height=-2e-5, v_x=1.5, witness=witness, max_step=max_step, accuracy=accuracy
        )
        start = state_of(simulator)[4]
        simulator.AdvanceTo(0.3)
        evaluations = simulator.get_integrator().get_num_derivative_evaluations()
        return state_of(simulator)[4] - start, evaluations

    exact, cost = travel(witness=True, max_step=1e-3, accuracy=1e-6)
    coarse, _ = travel(witness=False, max_step=1e-4, accuracy=1e-3)
    fine, fine_cost = travel(witness=False, max_step=1e-5, accuracy=1e-3)
    assert exact > 100.0 * scenario.friction.stiction_range, "it slides"
    assert 0.94 * exact < coarse < fine
    assert 0.985 * exact < fine < exact
    assert cost < fine_cost
