"""The public functions: the examples in their docstrings run."""

from __future__ import annotations

import doctest
import functools
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

import tetra_drake as td
from tetra_drake.prototype.export import export
from tetra_drake.report.result_folder import save_result_folder
from tetra_drake.robot.gait import save_gait
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.schema import Scenario

SHORT = {
    "engine": "!Compiled",
    "simulation.duration": "0.5 s",
    "simulation.steady_from": "0.1 s",
    "evolution.evaluations": 6,
    "evolution.trials": 1,
    "optimizer.population": 4,
    "optimizer.tournament": 2,
}


@functools.wraps(load_scenario)
def load_short(name: str) -> Scenario:
    return load_scenario(name).with_changes(SHORT)


@pytest.fixture(scope="module", autouse=True)
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with the files that the examples read, where scenarios are short."""
    folder, before = tmp_path_factory.mktemp("api"), Path.cwd()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(td, "load_scenario", load_short, raising=False)
        patch.setattr("tetra_drake.experiment._reevaluate", lambda *_: None)
        patch.setattr("tetra_drake.report.run_page.write_report", lambda directory: None)
        os.chdir(folder)
        scenario = load_short("quick")
        gait = td.evolve(scenario, "runs/demo").best_gait()
        save_gait(gait, "gait.json", scenario)
        save_result_folder(Path("out"), td.simulate(scenario, gait, record=True))
        export(scenario, gait, rate=100.0, out=Path("lab"))
        yield folder
        os.chdir(before)


class WhereStated(doctest.OutputChecker):
    """Compares what an example prints only with what the docstring states."""

    def check_output(self, want: str, got: str, optionflags: int) -> bool:
        return not want or super().check_output(want, got, optionflags)


@pytest.mark.parametrize("name", ["", *td.__all__[1:]])
def test_the_example_of_each_public_name_runs(name: str) -> None:
    subject = getattr(td, name) if name else td
    (test,) = [
        found
        for found in doctest.DocTestFinder(recurse=False).find(subject, name, globs={"td": td})
        if found.name == name
    ]
    assert test.examples
    reports: list[str] = []
    runner = doctest.DocTestRunner(WhereStated(), verbose=False)
    failures, _ = runner.run(test, out=reports.append)
    assert not failures, "".join(reports)
