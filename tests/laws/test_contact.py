"""The normal force, and what a contact node remembers."""

import numpy as np
import pytest
from helpers.robot_on_ground import RobotOnGround

from tetra_drake.laws.contact import MODE, STICK_POINT, NormalForce, normal_force
from tetra_drake.laws.friction import STICK

NORMAL = NormalForce(stiffness=4000.0, damping=2e5)


def test_normal_force_is_equation_1():
    # k d + lambda d dd/dt = 4000*1e-3 + 2e5*1e-3*0.01 = 4 + 2; 4 - 6 < 0: it does not pull.
    assert normal_force(1e-3, 0.01, NORMAL) == pytest.approx(6.0, rel=1e-14)
    assert normal_force(1e-3, -0.03, NORMAL) == normal_force(-1e-4, 0.02, NORMAL) == 0.0


def test_a_node_that_sticks_again_does_so_where_it_is_and_changes_are_told(scenario):
    slipping = scenario.with_changes({"friction.reset": "reversal"})
    robot_on_ground = RobotOnGround(slipping, np.eye(3))
    modes, lifted = robot_on_ground.modes, (0.0, 0.0, 1e-3)
    assert not robot_on_ground.update(p=lifted), "in the air"
    for x, v_x, mode, stick_point, changed in [
        (0.0, 0.1, STICK, 0.0, True),  # lands
        (0.0, 0.1, STICK, 0.0, False),
        (1e-3, 0.1, 1.0, 0.0, True),  # has gone ten stiction ranges: broken free
        (5e-3, 0.1, 1.0, 0.0, False),  # slips on
        (6e-3, -0.1, STICK, 6e-3, True),  # the reset: deflection 0 here
    ]:
        assert robot_on_ground.update(v=(v_x, 0.0, 0.0), p=(x, 0.0, -1e-5)) == changed
        assert modes[0, MODE] == mode
        assert modes[0, STICK_POINT] == pytest.approx(stick_point, abs=1e-15)
        assert modes[0, MODE + 1] == STICK, "the sideways axis is on its own"
    assert robot_on_ground.update(p=lifted), "leaves the ground"
