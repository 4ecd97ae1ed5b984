"""A thinned run: the gaits that matter are whole, every evaluation is there."""

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pandas
import pytest
from helpers.analytic import Bowl
from helpers.synthetic_run import tiny_scenario, write_run

from tetra_drake.evolution.comparison import compare
from tetra_drake.evolution.elites import elites
from tetra_drake.evolution.json_lines import append_lines, read_lines
from tetra_drake.evolution.pareto import champions
from tetra_drake.evolution.record import RunRecord
from tetra_drake.evolution.reevaluation import BEST_GAITS, reevaluate
from tetra_drake.evolution.robustness import gaits_of
from tetra_drake.evolution.summary import summary
from tetra_drake.evolution.tables import load_run
from tetra_drake.evolution.thinning import thin
from tetra_drake.report.run_page import write_report
from tetra_drake.scenario.optimizers import QualityDiversity

GENERATOR = np.random.default_rng(3)
FITNESS = GENERATOR.normal(8.0, 3.0, (2, 40)).tolist()
TRIALS = [
    [
        [(f, i) for i, f in enumerate(trial[:6])],
        [(None, None), *((f, i % 6) for i, f in enumerate(trial[6:], 5))],
    ]
    for trial in FITNESS
]
"""Six initial gaits, then a failure and 34 that take the places of one another."""

AGAIN = 17
"""An evaluation that only its reevaluation makes matter."""


def metrics_of(fitness):
    """More than a synthetic run has; the cheapest gait is another than the fittest."""
    cost = 10.0 + (fitness - 9.0) ** 2 / 3.0
    return {"cost_of_transport": cost, "travelling_index": fitness % 1.0, "lifted": 0.5 + 1e-13}


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """A run, and the same thinned."""
    folder = tmp_path_factory.mktemp("runs")
    kind = QualityDiversity(cells=[3, 3])
    changes = {"optimizer": kind, "simulation.engine": "compiled"}
    metrics = {fitness: metrics_of(fitness) for trial in FITNESS for fitness in trial}
    scenario = tiny_scenario().with_changes(changes)
    run = write_run(folder / "run", TRIALS, scenario=scenario, metrics=metrics)
    entry = read_lines(run / "trial_01/evaluations.jsonl")[AGAIN]
    append_lines(run / "trial_01/reevaluations.jsonl", [entry | {"engine": "drake"}])
    append_lines(run / "elites.jsonl", [{"trial": 0, "index": 1, "kept": 1, "mean_distance": 2.0}])
    thin(run, folder / "thinned")
    return load_run(run), load_run(folder / "thinned")


def test_every_evaluation_is_there_and_those_that_matter_are_whole(runs):
    run, thinned = runs
    assert len(thinned.evaluations) == len(run.evaluations)
    assert len(thinned.whole) < 0.8 * len(run.whole) == 0.8 * len(run.evaluations)
    fitness = run.evaluations.groupby("trial")["fitness"]
    rises = run.evaluations[run.evaluations["fitness"] == fitness.cummax()]
    last = pandas.concat([run.last_population(0), run.last_population(1)])
    again = run.evaluations.query("trial == 1 and index == @AGAIN")
    assert AGAIN not in rises["index"].values and AGAIN not in last["index"].values
    champion = pandas.DataFrame(champions(run).values())
    for matter in (run.initial(), rises, run.best(BEST_GAITS), last, again, elites(run), champion):
        rows = run.evaluations.loc[matter.index].drop(columns="wall_time_s")
        kept = thinned.evaluations.loc[matter.index].drop(columns="wall_time_s")
        pandas.testing.assert_frame_equal(kept, rows, check_exact=True)


def test_what_does_not_matter_has_three_digits_and_seems_no_better(runs):
    run, thinned = runs
    rest = thinned.evaluations.index.difference(thinned.whole.index)
    before, after = run.evaluations.loc[rest], thinned.evaluations.loc[rest]
    loss = (before["fitness"] - after["fitness"]).dropna()
    assert (loss >= 0.0).all() and (loss < 1e-4).all() and (loss > 0.0).any()
    cost = after["cost_of_transport"].dropna()
    assert [float(f"{x:.3g}") for x in before["cost_of_transport"].dropna()] == cost.tolist()
    assert thinned.evaluations["failure"].equals(run.evaluations["failure"])
    trial, index = after.iloc[0][["trial", "index"]]
    with pytest.raises(Exception, match="genome"):
        thinned.gait(trial, index)


def test_what_is_made_of_a_run_is_made_of_a_thinned_one(runs):
    run, thinned = runs
    assert thinned.fittest() == run.fittest()
    assert summary(thinned).replace(str(thinned.directory), str(run.directory)) == summary(run)
    named = ({n: (g["trial"], g["index"]) for n, g in champions(r).items()} for r in runs)
    assert next(named) == next(named)
    assert elites(thinned)["index"].tolist() == elites(run)["index"].tolist()
    assert gaits_of(thinned.directory)[1] == gaits_of(run.directory)[1]
    ours, theirs = (compare([r.directory], reach=0.01).trials for r in (thinned, run))
    assert ours.drop(columns="run").equals(theirs.drop(columns="run"))
    assert thinned.reevaluations["distance"].equals(run.reevaluations["distance"])
    assert math.isnan(thinned.reevaluations["tau_a_s"].item())
    for page in write_report(thinned.directory):
        assert page.exists()


def test_a_thinned_run_is_reevaluated_but_not_resumed(runs, refused):
    _, thinned = runs
    again = reevaluate(thinned.directory, evaluate=Bowl(), executor=ThreadPoolExecutor)
    assert len(again.reevaluations) == 1 + 2 * BEST_GAITS
    with refused(thinned.directory, "", "thinned"):
        RunRecord.resume(thinned.directory)
