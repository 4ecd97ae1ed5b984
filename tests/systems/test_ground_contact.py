"""The ground as a system: how it starts, and its two placements of events.

A lone tetrahedron settles and slides on it in tests/diagrams/test_one_tetrahedron.py.
"""

import numpy as np
import pytest
from one_tetrahedron import make_diagram, make_standing_tetrahedron
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator

from tetra_drake.physics.contact import CONTACT, MODE, MODE_COLUMNS
from tetra_drake.physics.friction import STICK
from tetra_drake.robot.structure import node_positions
from tetra_drake.scenario.scenario import Scenario


def make_simulator(
    scenario: Scenario,
    *,
    height: float,
    v_x: float = 0.0,
    witness: bool = False,
    max_step: float = 1e-4,
    accuracy: float = 1e-6,
) -> Simulator:
    """Of a tetrahedron with its base `height` (m) over the ground, moving along x at v_x (m/s)."""
    structure = make_standing_tetrahedron(scenario).structure
    simulator = Simulator(make_diagram(scenario, witness=witness))
    ResetIntegratorFromFlags(simulator, "runge_kutta3", max_step).set_target_accuracy(accuracy)
    context = simulator.get_mutable_context()
    context.SetAccuracy(1e-6)  # a witness window of 0.01 s times that
    state = structure.initial_state
    state[6] += height
    state[10] = v_x
    context.SetContinuousState(state)
    simulator.Initialize()
    return simulator


def state_of(simulator: Simulator) -> np.ndarray:
    return simulator.get_context().get_continuous_state_vector().CopyToVector()


@pytest.mark.parametrize(("height", "touches"), [(-1e-5, True), (1e-5, False)])
def test_initialize_takes_contact_and_stick_points_from_the_pose(scenario, height, touches):
    simulator = make_simulator(scenario, height=height)
    ground = simulator.get_system().GetSubsystemByName("ground")
    context = ground.GetMyContextFromRoot(simulator.get_context())
    modes = context.get_discrete_state_vector().value().reshape(3, MODE_COLUMNS)
    assert (modes[:, CONTACT] == touches).all()
    assert (modes[:, MODE : MODE + 2] == STICK).all()
    if touches:
        structure = make_standing_tetrahedron(scenario).structure
        p_WN = node_positions(structure, state_of(simulator))
        np.testing.assert_allclose(modes[:, 3:5], p_WN[:3, :2], atol=1e-15)


def test_both_placements_agree_on_a_sliding_tetrahedron(scenario):
    # A step end comes late, so the node sticks on beyond its range and slides less far: the
    # less the shorter the steps. Measured: 4.7 % at 0.1 ms, 1.0 % at 0.01 ms, 0.3 % at 1 us,
    # against a witness with a window of 10 ns, which takes a sixth of the evaluations at 0.01 ms.
    def travel(*, witness: bool, max_step: float, accuracy: float) -> tuple[float, int]:
        settings = {"witness": witness, "max_step": max_step, "accuracy": accuracy}
        simulator = make_simulator(scenario, height=-2e-5, v_x=1.5, **settings)
        start = state_of(simulator)[4]
        simulator.AdvanceTo(0.1)  # by then it rests
        evaluations = simulator.get_integrator().get_num_derivative_evaluations()
        return state_of(simulator)[4] - start, evaluations

    exact, cost = travel(witness=True, max_step=1e-3, accuracy=1e-6)
    coarse, _ = travel(witness=False, max_step=1e-4, accuracy=1e-3)
    fine, fine_cost = travel(witness=False, max_step=1e-5, accuracy=1e-3)
    assert exact > 100.0 * scenario.friction.stiction_range, "it slides"
    assert 0.94 * exact < coarse < fine
    assert 0.985 * exact < fine < exact
    assert cost < fine_cost
