"""Gaits of a run evaluated once more: which, how often, and what is kept of it."""

from dataclasses import replace

import pytest
from helpers.analytic import Bowl, in_threads

from tetra_drake.evolution.progress import Progress
from tetra_drake.evolution.reevaluation import reevaluate
from tetra_drake.evolution.run import load_run


class Slope:
    """Another evaluation of the same vectors: half a metre less than Bowl's."""

    def __init__(self):
        self.asked = 0

    def __call__(self, task):
        self.asked += 1
        bowl = Bowl(fails_every=10**9)(task)
        return replace(bowl, metrics={"distance": bowl.metrics["distance"] - 0.5}, engine="drake")


@pytest.fixture
def slope(monkeypatch):
    """Takes the place of the evaluation on the diagram."""
    evaluate = Slope()
    monkeypatch.setattr(
        "tetra_drake.evolution.reevaluation.evaluator_of", lambda *_, **__: in_threads(evaluate)
    )
    return evaluate


def test_the_five_best_of_each_trial_are_evaluated_again(run_small, slope):
    directory = run_small()
    run = load_run(directory)
    assert run.reevaluations.empty
    run = reevaluate(directory)
    assert list(run.reevaluations.groupby("trial").size()) == [5, 5]
    best = run.best(5).set_index(["trial", "index"])
    chosen = run.reevaluations.set_index(["trial", "index"])
    assert set(chosen.index) == set(best.index)
    assert set(chosen["engine"]) == {"drake"}
    assert (chosen["weight_7"] == best.loc[chosen.index, "weight_7"]).all()
    shorter = best.loc[chosen.index, "distance_in"] - 0.5 / 0.0254
    assert chosen["distance_in"].tolist() == pytest.approx(shorter.tolist())


class Stages(Progress):
    def __init__(self):
        self.titles = []

    def stage(self, title, done, total, text=""):
        self.titles.append(title)


def test_what_is_recorded_whole_is_not_evaluated_again(run_small, slope):
    directory = run_small()
    shown, not_shown = Stages(), Stages()
    reevaluate(directory, progress=shown)
    assert len(reevaluate(directory, progress=not_shown).reevaluations) == slope.asked == 10
    assert not_shown.titles == [] and shown.titles
    path = directory / "trial_01" / "reevaluations.jsonl"
    path.write_bytes(path.read_bytes()[:-9])
    assert len(load_run(directory).reevaluations) == 9
    assert len(reevaluate(directory).reevaluations) == 10
    assert slope.asked == 11
