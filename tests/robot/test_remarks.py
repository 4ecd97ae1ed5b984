"""Remarks on settings with which a robot hardly moves or asks too much."""

import re

import pytest

from tetra_drake.robot.remarks import centre_remark, gain_remark, stillness_remark
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


@pytest.mark.parametrize(("aside", "shown"), [("0 mm", ""), ("20 mm", "0.6667 cm")])
def test_a_centre_of_mass_beside_a_bar_is_named(aside, shown):
    # One of three bodies of equal masses has its centre beside the line of its nodes. The bar from
    # (0.1, 0, 0) to (-0.0866, 0.05, 0.16) m is at right angles to (0.259, 0.966, 0).
    middle, across = (0.00670, 0.025, 0.08), (0.2588, 0.9659, 0.0)
    way = float(aside.split()[0]) / 1e3
    centre = [f"{m + way * c} m" for m, c in zip(middle, across, strict=True)]
    body = {"struts": ["bar n0 n4"], "centre": centre}
    robot = robot_of("prism", robot_bodies={"b": body})
    assert robot.structure.node_shares.sum() == pytest.approx(1.0, rel=1e-9)
    assert shown in (remark := centre_remark(robot)) and bool(remark) == bool(shown)
