"""Fixtures of the tests of pages."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from helpers.synthetic_run import tiny_scenario, write_run

from tetra_drake.engines.simulate import simulate
from tetra_drake.results.folder import save_result_folder
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.gait import Gait, seeded_gait
from tetra_drake.scenario.schema import Scenario

TRIALS = [
    [[(2.0, 0), (-1.0, 1), (None, 2)], [(3.0, 1), (1.0, None)]],
    [[(1.5, 0), (0.5, 1), (1.0, 2)], [(2.5, 1), (4.0, 2)]],
]


@pytest.fixture(scope="package")
def tiny() -> Scenario:
    """A robot of three tetrahedra, for a moment."""
    return tiny_scenario(name="tiny")


@pytest.fixture(scope="package")
def gait(tiny: Scenario) -> Gait:
    return seeded_gait(tiny)


@pytest.fixture(scope="package")
def result(tiny: Scenario, gait: Gait) -> SimulationResult:
    return simulate(scenario=tiny, gait=gait, record=True)


@pytest.fixture(scope="package")
def written(
    tmp_path_factory: pytest.TempPathFactory, tiny: Scenario, gait: Gait, result: SimulationResult
) -> Path:
    folder = tmp_path_factory.mktemp("written") / "out"
    save_result_folder(folder, scenario=tiny, gait=gait, result=result)
    return folder


@pytest.fixture
def folder(tmp_path: Path, written: Path) -> Path:
    """A folder as `simulate` leaves it."""
    return shutil.copytree(written, tmp_path / "out")


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A run of two trials; the second has the fittest gait, its last evaluation."""
    return write_run(tmp_path / "run", TRIALS, scenario=tiny_scenario(name="tiny"))
