"""The robot at rest: against an independent simulation, a walk that is not driven, and statics."""

import json
import math

import numpy as np
import pytest
from helpers.quantities import with_unit

from tetra_drake.laws.friction import Coulomb
from tetra_drake.laws.terrain import Incline
from tetra_drake.robot import equilibrium
from tetra_drake.robot.robot import Robot, equilibrium_of
from tetra_drake.robot.structure import node_positions
from tetra_drake.scenario.robot_tetrahedra import BOTTOM_LEFT, TIP
from tetra_drake.settings.units import INCH, POUND_FORCE


def test_rests_where_the_independent_simulation_does(robot, data):
    # Its normal forces are 7e-6 off our weight (the digits of its mass, and what still moved).
    expected = json.loads((data / "expected.json").read_text())["settled"]
    nodes = node_positions(robot.structure, robot.equilibrium.state)
    p_WN = nodes / INCH
    spacing = np.diff(p_WN[BOTTOM_LEFT::4, 0])
    np.testing.assert_allclose(spacing, expected["spacing_in"], rtol=1e-5)
    assert p_WN[4 * 4 + TIP, 2] == pytest.approx(expected["tip5_height_in"], rel=1e-5)
    depth = np.maximum(0.0, -nodes[robot.structure.contacts, 2])
    normal = robot.scenario.ground.stiffness * depth / POUND_FORCE
    atol = 1e-5 * expected["normal_sum_lbf"]
    np.testing.assert_allclose(normal, expected["normals"], atol=atol)


def test_the_lengths_do_not_depend_on_how_the_solver_gets_there(scenario, robot):
    # It gets there in other last digits on another processor, and so it does from another start.
    elsewhere = scenario.with_changes({"robot.spacing": f"{1.01 * scenario.robot.spacing} m"})
    other = Robot.of(elsewhere).equilibrium
    assert (np.diff(other.state[4:35:7]) != np.diff(robot.equilibrium.state[4:35:7])).any()
    assert np.array_equal(other.lengths, robot.equilibrium.lengths)

    elsewhere = {"terrain": Incline(slope=0.2), "friction": Coulomb(stiffness=100.0)}
    elsewhere["robot.offsets"] = with_unit([[0.01 * i, 0.01, 0.1] for i in range(5)], "m")
    other = Robot.of(scenario.with_changes(elsewhere)).equilibrium
    assert np.array_equal(other.state, robot.equilibrium.state)


@pytest.mark.parametrize("where", [math.nan, 1e308])
def test_forces_that_are_not_finite_end_the_search_at_once(scenario, robot, where, refused):
    start = robot.structure.initial_state
    start[7 + 4] = where  # x of T2
    with refused("thesis", "robot", "nan N are left on 'T1'"):
        equilibrium_of(scenario, robot.structure, start)


def test_a_long_search_is_announced_once(robot, monkeypatch, caplog):
    monkeypatch.setattr(equilibrium, "LONG", -1.0)
    rest = robot.equilibrium
    assert [record.levelname for record in caplog.records] == ["WARNING"]
    assert "thesis" in caplog.text
    assert rest.feet


@pytest.mark.parametrize(("work", "steps"), [(2.5 * 6981, 2), (0.0, 1)])  # 5 bodies
def test_a_search_ends_after_steps_by_the_robot_alone(robot, refused, monkeypatch, work, steps):
    monkeypatch.setattr(equilibrium, "MOST_WORK", work)
    monkeypatch.setattr(equilibrium, "LEAST_STEPS", 1)
    with refused("thesis", "robot", f"no equilibrium in {steps} steps;"):
        _ = robot.equilibrium
