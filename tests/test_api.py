"""The public functions: the examples in their docstrings run, and what they give prints well."""

from __future__ import annotations

import doctest
import functools
import html
import inspect
import os
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from helpers.brief import BRIEF

import tetra_drake as td
from tetra_drake.report.result_folder import save_result_folder
from tetra_drake.robot.gait_file import save_gait
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.scenario import Scenario


@functools.wraps(load_scenario)
def load_short(name: str) -> Scenario:
    return load_scenario(name).with_changes(BRIEF)


@pytest.fixture(scope="module", autouse=True)
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with the files that the examples read, where scenarios are short."""
    folder, before = tmp_path_factory.mktemp("api"), Path.cwd()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(td, "load_scenario", load_short, raising=False)
        patch.setattr("tetra_drake.evolution.reevaluation.reevaluate", lambda *_, **__: None)
        patch.setattr("tetra_drake.report.run_page.write_report", lambda directory: None)
        os.chdir(folder)
        scenario = load_short("quick")
        gait = td.evolve(scenario, "runs/demo").best_gait()
        save_gait(gait, "gait.json", scenario)
        save_result_folder(Path("out"), td.simulate(scenario, gait, record=True))
        td.evolve(scenario, "runs/other", seed=1)
        td.export(scenario, gait, "lab")
        yield folder
        os.chdir(before)


class WhereStated(doctest.OutputChecker):
    """Compares what an example prints only with what the docstring states."""

    def check_output(self, want: str, got: str, optionflags: int) -> bool:
        return not want or super().check_output(want, got, optionflags)


@pytest.mark.parametrize("name", ["", *td.__all__[1:]])
def test_the_example_of_each_public_name_runs(name: str) -> None:
    subject = getattr(td, name) if name else td
    (test,) = doctest.DocTestFinder(recurse=False).find(subject, name, globs={"td": td})
    assert test.examples
    reports: list[str] = []
    runner = doctest.DocTestRunner(WhereStated(), verbose=False)
    failures, _ = runner.run(test, out=reports.append)
    assert not failures, "".join(reports)


def test_what_is_printed_fits_a_screen_and_is_rounded() -> None:
    run = td.load_run("runs/demo")
    result = td.load_result("out")
    for subject in (run.scenario, run, run.best_gait(), result, result.metrics):
        lines = str(subject).splitlines()
        assert len(lines) <= 20 and max(map(len, lines)) <= 100
        assert not re.search(r"\d\.\d{9}", str(subject))
    assert f"{result.metrics.distance_in:.4g} in" in str(result)
    assert "actuator_limited" not in str(result.metrics), "it has no motors"
    assert len(repr([run, result, run.scenario, *run.gaits()])) < 400


def test_a_result_shows_its_replay_in_a_notebook(folder: Path) -> None:
    result = td.load_result("out")
    result.save_replay(folder / "alone.html")
    shown = result.show(height=321)._repr_html_()
    (page,) = re.findall(r'^<iframe srcdoc="([^"]*)" style="[^"]*height: 321px', shown)
    assert html.unescape(page) == (folder / "alone.html").read_text()


def test_a_failure_among_many_says_of_which_gait_and_scenario() -> None:
    scenario = td.load_scenario("quick")
    failing = scenario.with_changes({"simulation.max_evaluations": 10, "name": "failing"})
    gaits = [td.seeded_gait(scenario, seed) for seed in (1, 2)]
    walked, failed = td.simulate_many([scenario, failing], gaits)
    assert walked.scenario == scenario
    assert (failed.name, failed.gait, failed.scenario) == ("random gait 2", gaits[1], failing)
    assert "random gait 2 on scenario failing" in repr(failed)
    assert failed.fitness == -np.inf


def test_a_run_stands_for_its_scenario_and_its_best_gait():
    run = td.load_run("runs/demo")
    result = td.simulate(run.scenario, run.best_gait())
    assert td.simulate("runs/demo").metrics == result.metrics
    assert td.simulate(run).metrics == td.simulate(result, run).metrics == result.metrics


@pytest.mark.parametrize("name", [n for n in td.__all__ if inspect.isfunction(getattr(td, n))])
def test_every_parameter_and_the_errors_are_described(name: str) -> None:
    function = getattr(td, name)
    about = (inspect.getdoc(function) or "").partition("\nArgs:\n")[2]
    given, _, errors = about.partition("\nRaises:\n")
    described = re.findall(r"^    (\w+): \S", given, re.M)
    assert described == [*inspect.signature(function).parameters]
    assert "InputError: " in errors or name == "prepare", "it has no input"
