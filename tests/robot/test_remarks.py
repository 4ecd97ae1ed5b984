"""Remarks on settings with which a robot hardly moves or asks too much."""

import re

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


def moved(distance, limited=float("nan")):
    return {"distance": distance, "actuator_limited": limited}


def test_a_robot_that_walks_less_than_a_tenth_of_its_length_is_named():
    robot = robot_of("thesis", cpg_gain="1 lbf")
    # From T1's base to T5's tip: four spacings of 2.94 in, and 4.9 in of a tetrahedron.
    tenth = 0.1 * (4 * 2.94 + 4.899) * INCH
    assert not stillness_remark(robot, moved(-1.01 * tenth))
    # Signals of 0.25 lbf (half of u0 = 0.5) stretch cables of 0.2 lbf/in by 1.25 in.
    assert "1.25 in" in stillness_remark(robot, moved(0.99 * tenth))
    turning = robot_of("thesis", objective={"heading_change": "1 /rad"})
    assert not stillness_remark(turning, moved(0.0))


def test_a_robot_that_stands_still_is_told_why():
    weak = robot_of("prism", objective={"rolled": "1 /rad"}, cpg_gain="0.1 N")
    remark = stillness_remark(weak, moved(0.0, limited=0.97))
    needed = float(re.search(r"; ([\d.]+) N would move one by 1 %", remark)[1])
    assert "97 %" in remark and "move no cable" in remark
    assert gain_remark(robot_of("prism", cpg_gain=f"{0.98 * needed} N"))
    assert not gain_remark(robot_of("prism", cpg_gain=f"{1.02 * needed} N"))
    assert "%" not in stillness_remark(robot_of("winch"), moved(0.0, limited=0.01))
