"""Which runs are outdated: scenario, search, or the simulation of a gait is another today."""

import outdated
import pytest
import record
from helpers.brief import BRIEF
from thinning import thin

from tetra_drake.evolution.evaluation import GaitEvaluation
from tetra_drake.experiment import evolve
from tetra_drake.optimizers import cma_es
from tetra_drake.scenario.optimizer_kinds import CmaEs

FEW = {"robot.tetrahedra": 2, "optimizer": CmaEs(sample=8), "simulation.duration": "1.6 s"}
FEW |= {"evolution.trials": 2, "evolution.evaluations": 32}
FEW |= {"disturbances": {"draws": 2, "start": 0.05}}
TINY = record.Experiment("two tetrahedra", "thesis", BRIEF | FEW)


def recorded(experiment, directory):
    evolve(experiment.scenario("tiny"), directory, reevaluate=False, report=False)
    thinned = directory.with_name(f"{directory.name} thinned")
    thin(directory, thinned)
    return thinned


@pytest.fixture(scope="module")
def tiny(tmp_path_factory):
    """A recorded and thinned run of TINY."""
    return recorded(TINY, tmp_path_factory.mktemp("runs") / "tiny")


def test_the_keys_that_differ_are_named(tiny):
    changes = TINY.changes | {"robot.cables.outer_stiffness": "0.3 lbf/in"}
    stiffer = record.Experiment(TINY.title, TINY.base, changes)
    assert "robot.cables.outer_stiffness" in outdated.why_outdated("tiny", stiffer, tiny)


def test_another_optimiser_is_seen_where_its_search_differs(tiny, monkeypatch):
    """Random samples do not depend on SIGMA, so gaits differ from the first population on: from its
    first gait whose genome a thinned run keeps."""
    monkeypatch.setattr(cma_es, "SIGMA", 0.9 * cma_es.SIGMA)
    found = outdated.why_outdated("tiny", TINY, tiny)
    assert found.startswith("search differs at evaluation ")
    (index,) = [int(word) for word in found.split() if word.isdecimal()]
    assert 8 <= index < 32


def test_a_gait_that_goes_elsewhere_is_seen_and_last_digits_are_not(tiny, monkeypatch):
    """A signal that is weaker by a tenth changes a walk; by 1e-13, less than 1 nm does."""
    run = outdated.load_run(tiny)
    evaluation = outdated.GaitEvaluation
    for weaker, seen in ((0.1, True), (1e-13, False)):
        gain = {"cpg.gain": f"{run.scenario.cpg.gain * (1.0 - weaker)} N"}
        monkeypatch.setattr(
            outdated,
            "GaitEvaluation",
            lambda given, gain=gain: evaluation(given.with_changes(gain)),
        )
        found = outdated.first_difference(run)
        assert found.startswith("evaluation 0 goes ") if seen else found == ""


def test_a_run_is_up_to_date_if_its_search_repeats_it_told_the_recorded_fitness(tiny, monkeypatch):
    """So that its own do not lead it elsewhere, where they round in another way."""
    monkeypatch.setattr(GaitEvaluation, "_fitness", lambda self, result: 1.0)
    assert outdated.why_outdated("tiny", TINY, tiny) == ""
