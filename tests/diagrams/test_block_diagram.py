"""The block diagram as Graphviz source; its picture is that of a script."""

import re

import pytest
from block_diagram import graphviz_source

from tetra_drake.report.run_page import BLOCK_DIAGRAM
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.systems.diagram import MakeTensegrityDiagram


@pytest.fixture
def robot(scenario):
    return MakeTensegrityDiagram(Robot.of(scenario), seeded_gait(scenario))


def label(source, block):
    [text] = re.findall(rf'^"{block}" \[label="(.*?)"', source, re.MULTILINE)
    return text


def test_blocks_ports_in_use_and_their_connections_are_shown(robot):
    source = graphviz_source(robot)
    drawn = set(re.findall(">([^<>]+)<", BLOCK_DIAGRAM.read_text(encoding="utf-8")))
    for system in robot.GetSystems():
        assert {type(system).__name__, system.get_name()} <= drawn, "the picture of the report"
        assert f"{type(system).__name__}\\n{system.get_name()}" in label(source, system.get_name())
    in_use = re.findall(r"<[uy]\d+> (\w+)", label(source, "plant"))
    assert in_use == ["applied_generalized_force", "state"]  # of some thirty
    exported = [robot.get_output_port(i).get_name() for i in range(robot.num_output_ports())]
    assert re.findall(r"<u\d+> (\w+)", label(source, "diagram outputs")) == exported
    edges = [line for line in source.splitlines() if "->" in line]
    assert len(edges) == len(robot.connection_map()) + robot.num_output_ports()
    assert '"cables":y0:e -> "forces":u0:w' in edges
