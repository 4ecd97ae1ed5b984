"""The cable law and what a network of cables can and cannot do to free bodies."""

import numpy as np
import pytest
from helpers.states import disturbed
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import LinearSpringDamper

from tetra_drake.kernels.packed import Packed
from tetra_drake.laws.cable import CableLaw, cable_tension, slack_tension
from tetra_drake.laws.forces import Forces, compute_cable_forces
from tetra_drake.robot.structure import AddBodies


def test_tension_is_equation_6():
    # 35 N/m (0.3 m - 0.1 m) + 8 N s/m * -0.25 m/s + 1.5 N = 7 - 2 + 1.5
    assert cable_tension(0.3, -0.25, 1.5, CableLaw(35.0, 8.0, 0.1)) == pytest.approx(6.5, rel=1e-15)


@pytest.mark.parametrize(
    ("stretch", "rate", "tension"),
    [
        (0.2, 0.5, 11.0),  # 7 N of the spring and 4 N of the damper: Eq. 6
        (0.2, 1.0, 14.0),  # the damper's 8 N count as the spring's 7 N
        (0.2, -1.0, 0.0),
        (-0.001, 50.0, 0.0),  # loose, however fast it lengthens
        (0.0, 50.0, 0.0),
    ],
)
def test_a_cable_that_goes_slack_pulls_only_while_it_is_stretched(stretch, rate, tension):
    law = CableLaw(35.0, 8.0, 0.1)
    found, per_rate = slack_tension(35.0 * stretch, rate, law)
    assert found == pytest.approx(tension, rel=1e-12)
    assert per_rate == (8.0 if tension == 11.0 else 0.0)


def test_passive_cables_are_drakes_linear_spring_dampers(robot, structure):
    # Near the start, every body turned, shifted and moving.
    state = disturbed(structure, 1, pose=0.01, speed=1.0)

    def acceleration(*, springs: bool, force: np.ndarray) -> np.ndarray:
        plant = MultibodyPlant(time_step=0.0)
        bodies = AddBodies(plant, structure)
        for cable in structure.cables if springs else []:
            ends = []
            for node in (cable["node_a"], cable["node_b"]):
                ends += [bodies[structure.carriers[node]], structure.p_BN[node]]
            law = [cable[name] for name in ("free_length", "stiffness", "damping")]
            plant.AddForceElement(LinearSpringDamper(*ends, *law))
        plant.Finalize()
        context = plant.CreateDefaultContext()
        context.SetContinuousState(state)
        plant.get_applied_generalized_force_input_port().FixValue(context, force)
        return plant.EvalTimeDerivatives(context).get_generalized_velocity().CopyToVector()

    ours = np.empty(30)
    compute_cable_forces(Packed((robot.model, Forces.of(robot.model))), state, np.zeros(4), ours)
    expected = acceleration(springs=True, force=np.zeros(30))
    found = acceleration(springs=False, force=ours)
    np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-9)
