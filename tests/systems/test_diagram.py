"""The wiring of the robot's diagram."""

from pathlib import Path

import pytest

from tetra_drake.robot.gait import Gait, load_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.systems import MatsuokaCpg
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
