"""Remarks on settings with which a robot hardly moves or asks too much."""

import pytest

from tetra_drake.robot.remarks import gain_remark, stillness_remark
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.load import load_scenario
from tetra_drake.settings.units import INCH


def robot_of(name: str, **changes: object) -> Robot:
    dotted = {key.replace("_", ".", 1): value for key, value in changes.items()}
    return Robot.of(load_scenario(name).with_changes(dotted))


GAINS = [("thesis", "0.05 N", "0.0048"), ("thesis", "2 lbf", "")]
GAINS += [("winch", "900 N", "-25 mm"), ("motors", "90 N", "22.5 N")]


@pytest.mark.parametrize(("name", "gain", "problem"), GAINS)
def test_a_gain_that_hardly_acts_or_asks_too_much_is_named(name, gain, problem):
    remark = gain_remark(robot_of(name, cpg_gain=gain))
    assert bool(remark) == bool(problem)
    assert problem in remark


def test_a_robot_without_oscillators_gets_no_remark_on_its_gain():
    assert gain_remark(robot_of("prism", robot_actuated={})) == ""


def test_a_robot_that_walks_less_than_a_tenth_of_its_length_is_named():
    robot = robot_of("thesis", cpg_gain="1 lbf")
    # From T1's base to T5's tip: four spacings of 2.94 in, and 4.9 in of a tetrahedron.
    tenth = 0.1 * (4 * 2.94 + 4.899) * INCH
    assert not stillness_remark(robot, -1.01 * tenth)
    # Signals of 0.25 lbf (half of u0 = 0.5) stretch cables of 0.2 lbf/in by 1.25 in.
    assert "1.25 in" in stillness_remark(robot, 0.99 * tenth)
    assert not stillness_remark(robot_of("thesis", objective={"heading_change": "1 /rad"}), 0.0)
