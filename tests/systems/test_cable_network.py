"""The cables as a system; their law is tested in tests/physics."""

import numpy as np
import pytest

from tetra_drake.robot.robot import Robot
from tetra_drake.systems import CableNetwork


def evaluate(robot: Robot, port: str, *, signals: list[float]) -> np.ndarray:
    """The output at the start."""
    cables = CableNetwork(robot)
    context = cables.CreateDefaultContext()
    cables.GetInputPort("state").FixValue(context, robot.structure.initial_state)
    cables.GetInputPort("signals").FixValue(context, np.array(signals))
    return cables.GetOutputPort(port).Eval(context)


@pytest.mark.parametrize(("slack", "least"), [(True, 0.0), (False, -97.4)])
def test_slack_cables_do_not_push(scenario, slack, least):
    robot = Robot.of(scenario.with_changes({"robot.cables.slack": slack}))
    tensions = evaluate(robot, "tensions", signals=[-100.0] * 4)
    assert tensions.min() == pytest.approx(least, abs=0.1)
