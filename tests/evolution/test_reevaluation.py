"""Gaits of a run evaluated once more: which, how often, and what is kept of it."""

import pytest
from helpers.analytic import Bowl, in_threads

from tetra_drake.evolution.reevaluation import reevaluate
from tetra_drake.evolution.run import load_run
from tetra_drake.optimizers.base import Evaluation


def test_the_five_best_of_each_trial_are_evaluated_again_once(run_small, monkeypatch):
    asked = []

    def nearer(task):
        """Another evaluation of the same vectors: half a metre less than Bowl's."""
        asked.append(task)
        distance = Bowl(fails_every=10**9)(task).metrics["distance"] - 0.5
        return Evaluation(1.0, {"distance": distance}, engine="drake")

    name = "tetra_drake.evolution.reevaluation.evaluator_of"
    monkeypatch.setattr(name, lambda *_, **__: in_threads(nearer))
    directory = run_small()
    best = load_run(directory).best(5).set_index(["trial", "index"])
    chosen = reevaluate(directory).reevaluations.set_index(["trial", "index"])
    assert sorted(chosen.index) == sorted(best.index)
    assert set(chosen["engine"]) == {"drake"}
    assert (chosen["tau_A"] == best.loc[chosen.index, "tau_A"]).all()
    shorter = best.loc[chosen.index, "distance_in"] - 0.5 / 0.0254
    assert chosen["distance_in"].tolist() == pytest.approx(shorter.tolist())
    # What is recorded whole is not evaluated again.
    assert len(reevaluate(directory).reevaluations) == len(asked) == 10
    path = directory / "trial_01" / "reevaluations.jsonl"
    path.write_bytes(path.read_bytes()[:-9])
    assert len(reevaluate(directory).reevaluations) == 10
    assert len(asked) == 11
