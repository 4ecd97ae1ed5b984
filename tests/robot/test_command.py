"""Commands: samples that are held, and the robot that follows them."""

import numpy as np
import pytest
from helpers.actuations import WINCH

from tetra_drake.robot.command import Command, driven_robot
from tetra_drake.robot.command_file import command_columns
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.load import load_scenario

HELD = [(0.0005, 20, 21)]  # on the grid
HELD += [(0.004, 3, 4)]  # within the step from 8 to 12 ms


@pytest.mark.parametrize(("step", "before", "after"), HELD)
def test_a_sample_is_held_for_ten_milliseconds_and_the_last_for_ever(scenario, step, before, after):
    changed = scenario.with_changes({"cpg.listing_step": f"{step} s"})
    command = Command("steps", 0.01, np.outer([0.0, 10.0, 20.0], np.ones(8)))
    held = driven_robot(changed, command).samples[:, 0]
    assert (held[0], held[before], held[after], held[-1]) == (0.0, 0.0, 10.0, 20.0)
    assert len(held) * step > changed.simulation.duration + step


def test_commands_have_the_order_of_the_oscillators_and_drives_that_of_the_cables():
    """The prism's oscillators drive a cable each, not in the order of the cables. At rest a winch
    is wound to the free length of its cable."""
    prism = load_scenario("prism")
    robot = Robot.of(prism.with_changes(WINCH))
    given = [name for names in prism.robot.actuated.values() for name in names]
    assert command_columns(robot) == [f"{name} free_length_mm" for name in given]
    assert list(Robot.of(prism).without_network().structure.oscillators) == given
    assert (np.diff(robot.driven) < 0).any()
    free = robot.structure.cables["free_length"]
    assert len(set(free)) > 1
    np.testing.assert_array_equal(robot.starting_cables().free_length, free[robot.driven])
    np.testing.assert_array_equal(robot.starting_drives(), free[np.sort(robot.driven)])
