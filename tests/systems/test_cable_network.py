"""The cables as a system; their law is tested in tests/physics."""

import numpy as np
import pytest

from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import node_positions
from tetra_drake.systems import CableNetwork


def evaluate(robot: Robot, port: str, *, signals: list[float]) -> np.ndarray:
    """The output at the start."""
    cables = CableNetwork(robot)
    context = cables.CreateDefaultContext()
    cables.GetInputPort("state").FixValue(context, robot.structure.initial_state)
    cables.GetInputPort("signals").FixValue(context, np.array(signals))
    return cables.GetOutputPort(port).Eval(context)


def test_ports_tell_the_tensions_and_lengths_of_equation_6(robot):
    signals, structure = [1.0, 2.0, 3.0, 4.0], robot.structure
    table = structure.cables
    p_WN = node_positions(structure, structure.initial_state)
    expected = np.linalg.norm(p_WN[table["node_b"]] - p_WN[table["node_a"]], axis=1)
    driven = np.append(signals, 0.0)[table["signal"]]  # PASSIVE, -1, picks the zero
    lengths = evaluate(robot, "lengths", signals=signals)
    np.testing.assert_allclose(lengths, expected, rtol=1e-14)
    tensions = evaluate(robot, "tensions", signals=signals)
    passive = table["stiffness"] * (expected - table["free_length"])
    np.testing.assert_allclose(tensions, passive + driven, rtol=1e-13)


@pytest.mark.parametrize(("slack", "least"), [(True, 0.0), (False, -97.4)])
def test_slack_cables_do_not_push(scenario, slack, least):
    robot = Robot.of(scenario.with_changes({"robot.cables.slack": slack}))
    tensions = evaluate(robot, "tensions", signals=[-100.0] * 4)
    assert tensions.min() == pytest.approx(least, abs=0.1)
