"""The network of a gait: who inhibits whom, what steering and feedback are made of."""

import numpy as np
import pytest

from tetra_drake.laws.matsuoka import connections
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.signals import signal_samples

SIDES = {"robot.actuation": [["outer bottom_left"], ["outer bottom_right"]]}


@pytest.mark.parametrize(("low", "high", "swings"), [(0.0, 1.99, True), (2.01, 3.4, False)])
def test_two_oscillators_silence_each_other_with_weights_above_two(scenario, low, high, swings):
    """An extensor and the other oscillator's flexor settle at y = u0 / (1 + beta); the two others
    stay silent where (partner weight + w) y > u0, so where w > 1 + beta - partner weight."""
    bounds = {"gait_bounds.weight_min": low, "gait_bounds.weight_max": high}
    two = scenario.with_changes({"robot.tetrahedra": 3, "simulation.duration": "40 s"} | bounds)
    robot, still = Robot.of(two), two.cpg.external_input / (1.0 + two.cpg.self_inhibition_weight)
    for seed in range(20):
        late = signal_samples(robot, seeded_gait(two, seed))[-10_000:] / two.cpg.gain
        if swings:
            assert (np.ptp(late, axis=0) > 0.1).all()
        else:
            np.testing.assert_allclose(np.abs(late), still, rtol=1e-3)


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
