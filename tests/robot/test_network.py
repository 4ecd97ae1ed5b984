"""The network of a gait: who inhibits whom, what steering and feedback are made of."""

import numpy as np
from helpers.actuations import SIDES

from tetra_drake.laws.matsuoka import connections
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.robot.robot import Robot


def test_oscillators_out_of_reach_do_not_inhibit_each_other(scenario):
    near = scenario.with_changes(SIDES | {"cpg.reach": 1})
    pairs = connections(near.blueprint(), near.cpg.reach)
    # Each junction's pair within (2 weights per kind of neuron), and to each neighbouring pair.
    assert len(pairs) == 2 * (4 * 2 + 3 * 2 * 4)
    junction = Robot.of(near).senses.ahead[pairs // 2]
    assert (np.abs(np.diff(junction, axis=1)) <= 1).all()
    gait = seeded_gait(near)
    network = Robot.of(near).oscillators(gait).constants
    assert len(network.weight) == len(pairs) + 16  # and the partners
    alone = scenario.with_changes({"cpg.reach": 0})
    assert [*seeded_gait(alone).parameters] == ["tau_A", "tau_B"]


def test_a_turn_strengthens_the_left_by_what_it_weakens_the_right(scenario):
    actuation = [["outer bottom_left"], ["outer top"], ["inner bottom_right"]]
    three = scenario.with_changes({"robot.actuation": actuation, "robot.tetrahedra": 3})
    tonic = Robot.of(three).tonic_input(np.array([0.0, 0.4]))
    u0 = scenario.cpg.external_input
    np.testing.assert_array_equal(tonic[0], u0)
    once = np.repeat([1.4, 1.0, 0.6], 2)  # extensor and flexor of left, middle, right
    np.testing.assert_allclose(tonic[1], u0 * np.tile(once, 2), rtol=1e-15)
