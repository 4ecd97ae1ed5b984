"""The scripts in diagrams/ as they are run."""

import shutil

import entrainment
import pytest
import robot
import settling_node
import single_oscillator
import sliding_tetrahedron
import tetrahedron_on_incline


@pytest.mark.skipif(shutil.which("dot") is None, reason="Graphviz is not installed")
@pytest.mark.parametrize(
    ("script", "options", "files"),
    [
        (single_oscillator, {}, 3),
        pytest.param(entrainment, {}, 2, marks=pytest.mark.slow),
        (settling_node, {}, 2),
        (sliding_tetrahedron, {}, 1),
        (tetrahedron_on_incline, {}, 1),
        (robot, {"duration": 0.1}, 2),
    ],
)
def test_a_script_writes_its_pictures(script, options, files, tmp_path):
    script.main(out=tmp_path, **options)
    written = {path.name for path in tmp_path.iterdir() if path.stat().st_size > 1000}
    assert len(written) == files
    assert written - {"robot.html"} <= {path.name for path in robot.DIAGRAMS.glob("*.svg")}
