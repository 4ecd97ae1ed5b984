"""The scripts in diagrams/ as they are run, and the robot's diagram against the package's."""

import shutil
import sys

import entrainment
import pytest
import robot
import settling_node
import single_oscillator
import sliding_tetrahedron
import tetrahedron_on_incline
from pydrake.systems.analysis import Simulator

from tetra_drake.figures.block_diagram import graphviz_source
from tetra_drake.robot.gait import load_gait
from tetra_drake.systems.diagram import MakeTensegrityDiagram


@pytest.mark.skipif(shutil.which("dot") is None, reason="Graphviz is not installed")
@pytest.mark.parametrize(
    ("script", "files"),
    [
        (single_oscillator, 3),
        pytest.param(entrainment, 2, marks=pytest.mark.slow),
        (settling_node, 2),
        (sliding_tetrahedron, 2),
        (tetrahedron_on_incline, 2),
        (robot, 2),
    ],
)
def test_a_script_writes_its_pictures(script, files, tmp_path, monkeypatch):
    options = ["--duration", "0.1"] if script is robot else []
    monkeypatch.setattr(sys, "argv", ["script", "--out", str(tmp_path), *options])
    script.main()
    written = {path.name for path in tmp_path.iterdir() if path.stat().st_size > 1000}
    assert len(written) == files
    assert written - {"robot.html"} <= {path.name for path in robot.DIAGRAMS.glob("*.svg")}


def test_the_robot_of_the_script_is_that_of_the_package(scenario):
    scenario = scenario.with_changes({"cpg.start_up": "0.02 s"})
    gait = load_gait(robot.BEST_GAIT, scenario)
    states = []
    for diagram in (robot.make_diagram(scenario, gait), MakeTensegrityDiagram(scenario, gait)):
        simulator = Simulator(diagram)
        simulator.AdvanceTo(0.1)
        state = simulator.get_context().get_continuous_state_vector().CopyToVector()
        states.append((graphviz_source(diagram), state.tolist()))
    assert states[0] == states[1]
