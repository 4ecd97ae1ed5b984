"""evolve(): what the command does, from Python; and the command evolve."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from unittest.mock import MagicMock

import numpy as np
import pytest
from helpers.analytic import Bowl, RandomSearch, in_threads, read_record, small_scenario
from helpers.converged import shortly

import tetra_drake
from tetra_drake import cli
from tetra_drake.evolution.evaluators import WorkerProcesses, on_executor
from tetra_drake.evolution.manifest import write_manifest
from tetra_drake.evolution.progress import Progress
from tetra_drake.evolution.reevaluation import reevaluate
from tetra_drake.optimizers.steady_state import SteadyStateOptimizer
from tetra_drake.settings.units import shown_in


@pytest.fixture
def tiny():
    """Four gaits and two iterations of 0.1 s on the compiled engine."""
    small = small_scenario(population=4, iterations=2, trials=1)
    return shortly(small, 0.1, engine="!Compiled")


@pytest.fixture
def reports(monkeypatch):
    """The directories of which a report was asked; none is written."""
    written = []
    monkeypatch.setattr("tetra_drake.report.run_page.write_report", written.append)
    return written


@dataclass(frozen=True)
class Heaviest:
    """Another objective."""

    factor: float
    table: object

    def __call__(self, result):
        return self.factor * (1.0 + result.metrics.distance)


@pytest.fixture
def interrupting():
    """An executor that ends a run by Ctrl-C after five tasks."""

    class Interrupting(ThreadPoolExecutor):
        left = 5

        def submit(self, *arguments):
            Interrupting.left -= 1
            if Interrupting.left < 0:
                raise KeyboardInterrupt
            return super().submit(*arguments)

    return Interrupting


QUICK = {"reevaluate": False, "report": False}


@pytest.mark.parametrize(
    "make", [ThreadPoolExecutor, pytest.param(WorkerProcesses, marks=pytest.mark.slow)]
)
def test_a_run_is_evolved_and_checked(make, tiny, tmp_path, reports, monkeypatch):
    """With threads in place of worker processes, and with these."""
    progress, made = MagicMock(spec=Progress), MagicMock(wraps=make)
    monkeypatch.setattr("tetra_drake.evolution.evaluators.WorkerProcesses", made)
    run = tetra_drake.evolve(tiny, tmp_path / "run", seed=3, workers=2, progress=progress)
    made.assert_called_once_with(2)
    assert run.manifest.seed == 3
    assert run.evaluations["engine"].tolist() == ["compiled"] * 8
    assert run.reevaluations["engine"].tolist() == ["drake"] * 5
    assert reports == [tmp_path / "run"]
    assert sum(status.evaluations for status in progress.show.call_args.args[0]) == 8
    assert [call.args[1:3] for call in progress.stage.mock_calls] == [(i, 5) for i in range(6)]
    progress.warn.assert_not_called()
    # A run that is complete is resumed without an engine.
    monkeypatch.delattr("tetra_drake.experiment.evaluator_of")
    again = tetra_drake.evolve(None, tmp_path / "run", resume=True, progress=progress)
    assert again.evaluations.equals(run.evaluations)


def scaled(factor):
    """Objectives of the same name."""

    def objective(result):
        return factor * (1.0 + result.metrics.distance)

    return objective


TABLE = np.ones(3)
METHODS = [(Heaviest(2.0, TABLE), (None, Heaviest(3.0, TABLE)), "Heaviest")]
METHODS += [(scaled(2.0), (scaled(3.0), scaled(-2.0)), "evaluation 0")]


@pytest.mark.parametrize(("objective", "others", "fact"), METHODS)
def test_a_run_is_resumed_only_by_its_own_method(
    tiny, tmp_path, refused, capsys, interrupting, objective, others, fact
):
    method = {"objective": objective, "optimizer": RandomSearch} | QUICK

    def resume(**changes):
        return tetra_drake.evolve(None, tmp_path, resume=True, **method | changes)

    def refuse_others():
        recorded = read_record(tmp_path)
        for other in others:
            with refused(tmp_path, "objective", fact):
                resume(objective=other)
        with refused(tmp_path, "optimizer", ""):
            resume(optimizer=SteadyStateOptimizer)
        assert cli.main(["evolve", "--out", str(tmp_path), "--resume"]) == 2
        assert "objective=" in capsys.readouterr().err
        assert read_record(tmp_path) == recorded

    with pytest.raises(KeyboardInterrupt):
        tetra_drake.evolve(tiny, tmp_path, executor=interrupting, workers=2, **method)
    refuse_others()
    evaluations = resume().evaluations
    refuse_others()
    expected = 2.0 + 2.0 * evaluations["distance"]
    assert evaluations["fitness"].values == pytest.approx(expected.values)
    with refused(tmp_path, "objective", ""):
        reevaluate(tmp_path, None)


def test_an_executor_that_is_given_stays_open(tiny, tmp_path, refused):
    own = tetra_drake.evolve(tiny, tmp_path / "own", **QUICK).evaluations["fitness"]
    with ThreadPoolExecutor(2) as executor:
        for out in ("first", "second"):
            run = tetra_drake.evolve(tiny, tmp_path / out, executor=executor, **QUICK)
            assert run.evaluations["fitness"].equals(own)
    with refused("executor", "", "shutdown"):
        tetra_drake.evolve(tiny, tmp_path / "third", executor=executor, **QUICK)


def test_a_resumed_run_is_checked_only_if_it_was_begun_so(tiny, tmp_path, monkeypatch):
    again = MagicMock()
    monkeypatch.setattr("tetra_drake.evolution.reevaluation.reevaluate", again)
    out, resumed = tmp_path / "run", {"resume": True, "report": False}
    tetra_drake.evolve(tiny, out, **QUICK)
    tetra_drake.evolve(None, out, **resumed)
    again.assert_not_called()
    tetra_drake.evolve(None, out, reevaluate=True, **resumed)
    again.assert_called_once()


def test_a_resumed_run_keeps_the_units_of_its_beginning(tiny, tmp_path, monkeypatch):
    written, out = [], tmp_path / "run"

    def write(directory):
        written.append(tetra_drake.load_run(directory).scenario.units.length_name)

    monkeypatch.setattr("tetra_drake.report.run_page.write_report", write)
    for units, resume in (("SI", False), (None, True), ("mm", True)):
        with shown_in(units):
            tetra_drake.evolve(None if resume else tiny, out, resume=resume, reevaluate=False)
    assert written == ["m", "m", "mm"]


def test_a_report_that_fails_and_other_versions_are_told(tiny, tmp_path, monkeypatch):
    monkeypatch.setattr("tetra_drake.report.run_page.write_report", lambda path: {}["x1"])
    with pytest.warns(RuntimeWarning, match="x1"):
        run = tetra_drake.evolve(tiny, tmp_path / "run", reevaluate=False)
    assert run.statuses[0].stop is not None
    older = {**run.manifest.versions, "numpy": "0.9"}
    write_manifest(run.directory, replace(run.manifest, versions=older))
    with pytest.warns(RuntimeWarning, match=r"numpy 0\.9"):
        tetra_drake.evolve(None, tmp_path / "run", resume=True, **QUICK)


def test_what_hardly_acts_sinks_or_has_no_diagram_is_named(tiny, tmp_path, reports, monkeypatch):
    """The first two at the start, the last at the end."""
    monkeypatch.setattr("tetra_drake.experiment.evaluator_of", lambda *_, **__: in_threads())
    monkeypatch.setattr("tetra_drake.lab.spread.record_spread", lambda *_, **__: None)
    progress, out = MagicMock(spec=Progress), tmp_path / "run"
    changes = {"simulation.duration": "3000 s", "cpg.gain": "0.1 N", "ground.stiffness": "20 N/m"}
    odd = tiny.with_changes(changes)
    run = tetra_drake.evolve(odd, out, progress=progress)
    assert reports == [out] and run.reevaluations.empty
    tetra_drake.evolve(None, out, resume=True, progress=progress, **QUICK)
    weak, sinks, compiled_alone = (call.args[0] for call in progress.warn.mock_calls)
    assert "cpg.gain 0.1 N" in weak and "ground.stiffness" in sinks
    assert "Drake diagram" in compiled_alone and "cpg.listing_step" in compiled_alone


SMALL = ("--trials", "1", "--evaluations", "18", "--workers", "1")


@pytest.fixture
def evolve(monkeypatch, reports):
    """evolve("--out", ...): the command's exit status, on a cheap fitness and without a report."""
    for module in ("experiment", "evolution.reevaluation"):
        monkeypatch.setattr(f"tetra_drake.{module}.evaluator_of", lambda *_, **__: in_threads())
    return lambda *options: cli.main(["evolve", *map(str, options)])


def test_resuming_needs_the_directory_only_and_leaves_the_run_as_it_is(evolve, tmp_path, capsys):
    out = tmp_path / "run"
    evolve(*SMALL, "--out", out)
    whole = read_record(out)
    for options in ((), SMALL):
        assert evolve("--out", out, "--resume", *options) == 0
        assert read_record(out) == whole
    assert capsys.readouterr().err == ""
    keys = {"--trials=2": "evolution.trials", "--scenario=thesis": "simulation.duration"}
    for option, key in (keys | {"--seed=1": "seed"}).items():
        assert evolve("--out", out, "--resume", option) == 2
        assert capsys.readouterr().err.startswith(f"tetra-drake: {out}: {key}: ")


def test_an_interrupted_run_says_how_to_go_on(evolve, tmp_path, capsys, monkeypatch, interrupting):
    out = tmp_path / "my run"
    interrupting.left = 17
    name = "tetra_drake.experiment.evaluator_of"
    monkeypatch.setattr(name, lambda *_, **__: on_executor(Bowl(), interrupting, 1))
    assert evolve(*SMALL, "--out", out) == 130
    printed = capsys.readouterr()
    assert f"tetra-drake evolve --out '{out}' --resume" in printed.err
    assert f"tetra-drake figures '{out}'" in printed.out
    interrupting.left = 0
    assert evolve(*SMALL, "--out", tmp_path / "other") == 130
    assert "--resume" not in capsys.readouterr().err
    assert not (tmp_path / "other").exists()
