"""The wiring of the robot's diagram, and cables as a system."""

from pathlib import Path

import numpy as np
import pytest

from tetra_drake.robot.gait import Gait, load_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.systems import CableNetwork, MatsuokaCpg
from tetra_drake.systems.diagram import MakeTensegrityDiagram


@pytest.fixture
def gait(scenario: Scenario, data: Path) -> Gait:
    return load_gait(data / "gait_b.json", scenario)


def test_has_the_blocks_of_the_thesis_and_nothing_to_show_or_log(robot, gait):
    names = {system.get_name() for system in MakeTensegrityDiagram(robot, gait).GetSystems()}
    assert names == {"cpg", "start_up", "cables", "ground", "forces", "plant"}


def test_exports_what_a_user_plots(robot, gait):
    diagram = MakeTensegrityDiagram(robot, gait)
    context = diagram.CreateDefaultContext()
    ports = [diagram.get_output_port(i) for i in range(diagram.num_output_ports())]
    sizes = {"state": 65, "signals": 4, "tensions": 24, "lengths": 24}
    sizes |= {"normal_forces": 11, "friction_forces": 22, "modes": 33}
    assert {port.get_name(): len(port.Eval(context)) for port in ports} == sizes


def test_the_friction_brings_no_continuous_state(scenario, robot, gait):
    context = MakeTensegrityDiagram(robot, gait).CreateDefaultContext()
    assert context.num_continuous_states() == 13 * 5
    live = Robot.of(scenario.with_changes({"cpg.signals": "live"}))
    live = MakeTensegrityDiagram(live, gait)
    assert isinstance(live.GetSubsystemByName("cpg"), MatsuokaCpg)
    assert live.CreateDefaultContext().num_continuous_states() == 13 * 5 + 4 * 4


@pytest.mark.parametrize(("slack", "least"), [(True, 0.0), (False, -97.4)])
def test_slack_cables_do_not_push(scenario, slack, least):
    robot = Robot.of(scenario.with_changes({"robot.cables.slack": slack}))
    cables = CableNetwork(robot)
    context = cables.CreateDefaultContext()
    cables.GetInputPort("state").FixValue(context, robot.structure.initial_state)
    cables.GetInputPort("signals").FixValue(context, np.full(4, -100.0))
    assert cables.GetOutputPort("tensions").Eval(context).min() == pytest.approx(least, abs=0.1)
