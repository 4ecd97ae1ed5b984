"""Fixtures of the tests of pages."""

import shutil

import pytest
from helpers import quick_figures
from helpers.synthetic_run import tiny_scenario, write_run

from tetra_drake.engines.simulate import simulate
from tetra_drake.report.result_folder import save_result_folder
from tetra_drake.robot.parameter_space import seeded_gait

TRIALS = [
    [[(2.0, 0), (-1.0, 1), (None, 2)], [(3.0, 1), (1.0, None)]],
    [[(1.5, 0), (0.5, 1), (1.0, 2)], [(2.5, 1), (4.0, 2)]],
]
"""The second has the fittest gait, its last evaluation."""

COSTS = {4.0: 0.9, 3.0: 0.5, 2.5: 0.7, 2.0: 0.25, 1.5: 0.1}
"""Costs of transport by fitness."""


@pytest.fixture(scope="package", autouse=True)
def quick_drawing():
    """All but one of the figures are written blank, and those of a gait are drawn once, as it takes
    seconds."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tetra_drake.report.run_page.draw_pictures", quick_figures.draw_pictures)
        yield


@pytest.fixture(scope="package")
def tiny():
    """A robot of three tetrahedra, for a moment."""
    return tiny_scenario(name="tiny")


@pytest.fixture(scope="package")
def gait(tiny):
    return seeded_gait(tiny)


@pytest.fixture(scope="package")
def result(tiny, gait):
    return simulate(scenario=tiny, gait=gait, record=True)


@pytest.fixture(scope="package")
def written(tmp_path_factory, tiny, gait, result):
    folder = tmp_path_factory.mktemp("written") / "out"
    save_result_folder(folder, result)
    return folder


@pytest.fixture
def folder(tmp_path, written):
    """A folder as `simulate` leaves it."""
    return shutil.copytree(written, tmp_path / "out")


@pytest.fixture
def run(tmp_path):
    return write_run(tmp_path / "run", TRIALS)
