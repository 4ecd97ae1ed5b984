"""A thinned run: the gaits that matter are whole, every evaluation is there."""

import itertools

import numpy as np
import pandas
import pytest
from helpers.analytic import in_threads
from helpers.synthetic_run import tiny_scenario, write_run
from thinning import thin

from tetra_drake.evolution.entries import EliteLine
from tetra_drake.evolution.manifest import RunRecord
from tetra_drake.evolution.reevaluation import BEST_GAITS, reevaluate
from tetra_drake.evolution.run import load_run
from tetra_drake.lab.elites.elites import elites
from tetra_drake.laws.height_field import HeightField
from tetra_drake.report.summary import run_text
from tetra_drake.scenario.optimizer_kinds import QualityDiversity

AGAIN, ALONE, EDGE, BEYOND = range(20, 24)
"""Evaluations that nothing else makes matter: reevaluated; alone in its cell of the map, and one
that rounding would put alone into the next cell, where it is not the fittest of its own."""

GENERATOR = np.random.default_rng(3)
RISING = [12.0 + i for i in range(2 * BEST_GAITS)]
LOW = GENERATOR.uniform(1.0, 11.0, 31).tolist()
FITNESS = [[*LOW[:6], *RISING, *LOW[6:]], GENERATOR.normal(8.0, 3.0, 41).tolist()]
FITNESS[0][AGAIN : BEYOND + 1] = [2.5, 2.0, 3.0, 4.0]
PLACES = {2.0: (0.1, 0.45), 3.0: (1.00001 / 3.0, 0.59), 4.0: (0.5, 0.59)}
"""On the map, by fitness; of all others one place."""
TRIALS = [
    [
        [(f, i) for i, f in enumerate(trial[:6])],
        [*((f, i % 6) for i, f in enumerate(trial[6:])), (None, None)],
    ]
    for trial in FITNESS
]
"""Six initial gaits, then 35 that take the places of one another, and a failure."""


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """A run, and the same thinned."""
    folder = tmp_path_factory.mktemp("runs")
    kind = QualityDiversity(cells=[3, 3])
    np.save(folder / "level.npy", np.zeros((11, 11)))
    field = HeightField(file=str(folder / "level.npy"), cell=0.5)
    changes = {"optimizer": kind, "engine": "!Compiled", "terrain": field}
    metrics = {}
    for fitness in itertools.chain(*FITNESS):
        index, lifted = PLACES.get(fitness, (0.9, 0.5))
        chosen = {"travelling_index": index, "lifted": lifted, "twist": 0.1 + fitness / 70.0}
        metrics[fitness] = chosen | {"tension": 1.0 / 3.0}  # which selects no gaits
    scenario = tiny_scenario().with_changes(changes)
    run = write_run(folder / "run", TRIALS, scenario=scenario, metrics=metrics)
    recorded = load_run(run)
    entry = list(recorded.file("evaluations.jsonl", 0).read())[AGAIN]
    recorded.file("reevaluations.jsonl", 0).append([entry.model_copy(update={"engine": "drake"})])
    on_map = EliteLine(trial=0, index=1, kept=1.0, mean_distance=2.0)
    recorded.file("elites.jsonl").append([on_map])
    thin(run, folder / "thinned")
    return load_run(run), load_run(folder / "thinned")


def test_every_evaluation_is_there_and_those_that_matter_have_their_genomes(runs):
    run, thinned = runs
    assert len(thinned.evaluations) == len(run.evaluations)
    assert len(thinned.with_parameters) < 0.8 * len(run.with_parameters)
    first = run.evaluations.query("trial == 0")
    rises = first[first["fitness"] == first["fitness"].cummax()]
    again = first.query("index == @AGAIN")
    start = first.query("iteration == 0")
    for matter in (start, rises, run.best(BEST_GAITS), again, elites(run)):
        rows = run.evaluations.loc[matter.index].drop(columns="wall_time_s")
        kept = thinned.evaluations.loc[matter.index].drop(columns="wall_time_s")
        pandas.testing.assert_frame_equal(kept, rows, check_exact=True)
    tensions = thinned.evaluations["tension"]
    walked = thinned.with_parameters.dropna(subset="fitness").index
    assert (tensions[walked] == 1.0 / 3.0).all() and tensions.drop(walked).isna().all()


def test_what_does_not_matter_has_three_digits_and_seems_no_better(runs):
    run, thinned = runs
    rest = thinned.evaluations.index.difference(thinned.with_parameters.index)
    before, after = run.evaluations.loc[rest], thinned.evaluations.loc[rest]
    loss = (before["fitness"] - after["fitness"]).dropna()
    assert (loss >= 0.0).all() and (loss < 1e-4).all() and (loss > 0.0).any()
    is_best = run.evaluations["fitness"] == run.evaluations.groupby("trial")["fitness"].cummax()
    assert (loss[is_best.loc[loss.index]] == 0.0).all() and (is_best.loc[rest]).any()
    assert [float(f"{x:.3g}") for x in before["twist"].dropna()] == after["twist"].dropna().tolist()
    assert thinned.evaluations["failure"].equals(run.evaluations["failure"])


def test_what_is_made_of_a_run_is_made_of_a_thinned_one(runs):
    run, thinned = runs
    assert thinned.fittest().drop("tension").equals(run.fittest().drop("tension"))
    assert run_text(thinned).replace(str(thinned.directory), str(run.directory)) == run_text(run)
    on_map = [table[["trial", "index"]].to_numpy().tolist() for table in map(elites, runs)]
    assert on_map[0] == on_map[1]
    assert [0, ALONE] in on_map[0] and [0, BEYOND] in on_map[0] and [0, EDGE] not in on_map[0]
    assert thinned.reevaluations["distance"].equals(run.reevaluations["distance"])


def test_a_thinned_run_is_reevaluated_but_not_resumed(runs, refused, monkeypatch):
    _, thinned = runs
    name = "tetra_drake.evolution.reevaluation.evaluator_of"
    monkeypatch.setattr(name, lambda *_, **__: in_threads())
    again = reevaluate(thinned.directory)
    assert len(again.reevaluations) == 1 + 2 * BEST_GAITS
    with refused(thinned.directory, "", "thinned"):
        RunRecord.resume(thinned.directory)
