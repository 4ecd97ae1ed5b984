"""The scripts in diagrams/ as they are run, and the robot's diagram against the package's."""

import functools
import shutil

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
    ("main", "files"),
    [
        (single_oscillator.main, 3),
        pytest.param(entrainment.main, 2, marks=pytest.mark.slow),
        (settling_node.main, 2),
        (sliding_tetrahedron.main, 1),
        (tetrahedron_on_incline.main, 1),
        (functools.partial(robot.main, duration=0.1), 2),
    ],
)
def test_a_script_writes_its_pictures(main, files, tmp_path):
    main(out=tmp_path)
    written = {path.name for path in tmp_path.iterdir() if path.stat().st_size > 1000}
    assert len(written) == files
    assert written - {"robot.html"} <= {path.name for path in robot.DIAGRAMS.glob("*.svg")}


@pytest.mark.parametrize("signals", ["listing", "recorded"])
def test_the_robot_of_the_script_is_that_of_the_package(scenario, signals):
    scenario = scenario.with_changes({"cpg.signals": signals, "cpg.start_up": "0.02 s"})
    gait = load_gait(robot.BEST_GAIT, scenario)
    states = []
    for diagram in (robot.make_diagram(scenario, gait), MakeTensegrityDiagram(scenario, gait)):
        simulator = Simulator(diagram)
        simulator.AdvanceTo(0.1)
        state = simulator.get_context().get_continuous_state_vector().CopyToVector()
        states.append((graphviz_source(diagram), state.tolist()))
    assert states[0] == states[1]
