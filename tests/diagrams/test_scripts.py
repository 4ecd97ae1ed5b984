"""The scripts in diagrams/ as they are run, and the robot's diagram against the package's."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
import robot
import settling_node
import single_oscillator
import sliding_tetrahedron
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Diagram

from tetra_drake.figures.block_diagram import graphviz_source
from tetra_drake.robot.gait import load_gait
from tetra_drake.scenario.schema import Scenario
from tetra_drake.systems.diagram import MakeTensegrityDiagram


@pytest.mark.skipif(shutil.which("dot") is None, reason="Graphviz is not installed")
@pytest.mark.parametrize(
    ("script", "options", "files"),
    [
        (
            single_oscillator,
            [],
            {
                "single_oscillator.svg",
                "single_oscillator_weights.svg",
                "single_oscillator_time_constants.svg",
            },
        ),
        (settling_node, [], {"one_tetrahedron.svg", "settling_node_motion.svg"}),
        (sliding_tetrahedron, [], {"one_tetrahedron.svg", "sliding_tetrahedron_motion.svg"}),
        (robot, ["--duration", "0.1"], {"robot.svg", "robot.html"}),
    ],
)
def test_a_script_writes_its_pictures(
    script, options: list[str], files: set[str], tmp_path: Path, monkeypatch, capsys
) -> None:
    monkeypatch.setattr(sys, "argv", ["script", "--out", str(tmp_path), *options])
    script.main()
    assert {path.name for path in tmp_path.iterdir()} == files
    assert all(path.stat().st_size > 1000 for path in tmp_path.iterdir())
    assert capsys.readouterr().out


@pytest.mark.parametrize("signals", ["listing", "live"])
def test_the_robot_of_the_script_is_that_of_the_package(scenario: Scenario, signals: str) -> None:
    scenario = scenario.with_changes({"cpg.signals": signals, "cpg.start_up": 0.02})
    gait = load_gait(robot.BEST_GAIT, scenario)
    theirs, ours = robot.make_diagram(scenario, gait), MakeTensegrityDiagram(scenario, gait)
    assert graphviz_source(theirs) == graphviz_source(ours)
    np.testing.assert_array_equal(*(state_after(0.1, diagram) for diagram in (theirs, ours)))


def state_after(duration: float, diagram: Diagram) -> np.ndarray:
    simulator = Simulator(diagram)
    simulator.AdvanceTo(duration)
    return simulator.get_context().get_continuous_state_vector().CopyToVector()
