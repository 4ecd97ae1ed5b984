"""A run made ready to be shown: which gaits walk again, and that they walk as recorded."""

from concurrent.futures import ThreadPoolExecutor

import pytest
from helpers.synthetic_run import tiny_scenario, write_run

from tetra_drake.evolution.evaluation import GaitEvaluation
from tetra_drake.evolution.record import RunRecord
from tetra_drake.evolution.run import evolve
from tetra_drake.evolution.study import study_run
from tetra_drake.robot.gait import load_gait


def test_the_gaits_walk_as_they_did_in_the_run(tmp_path):
    scenario = tiny_scenario(trials=2)
    scenario.evolution.population, scenario.evolution.max_iterations = 3, 2
    with RunRecord.create(tmp_path / "run", scenario=scenario, seed=1) as record:
        evolve(
            record,
            evaluate=GaitEvaluation(scenario),
            workers=1,
            make_executor=ThreadPoolExecutor,
        )
    study = study_run(tmp_path / "run")
    assert (study.best.deviation_in, study.initial.deviation_in) == (0.0, 0.0)
    best_gait = tmp_path / "run" / f"trial_0{study.best.trial}" / "best_gait.json"
    assert study.best.gait == load_gait(best_gait, scenario)
    assert study.best.result.fitness == max(status.best_fitness for status in study.statuses)
    assert study.best.trajectory.time.values[-1] == pytest.approx(0.3)


def test_the_best_trial_is_that_of_the_fittest_gait(tmp_path):
    run = write_run(
        tmp_path / "run",
        [[[(9.0, 0), (8.0, 1)]], [[(2.0, 0), (1.0, 1)], [(10.0, 1)]]],
    )
    study = study_run(run)
    assert (study.best.trial, study.best.evaluation, study.best.label) == (
        1,
        2,
        "trial 1, evaluation 2",
    )
    assert (study.initial.trial, study.initial.evaluation) == (1, 0)
    assert study.best.gait.name == "tiny, seed 7, trial 1, evaluation 2"
    assert study.best.deviation_in == abs(study.best.result.metrics.distance_in - 5.0) > 0.1


def test_a_gait_that_stays_the_best_is_simulated_once(tmp_path):
    study = study_run(write_run(tmp_path / "run", [[[(3.0, 0), (2.0, 1)], [(1.0, None)]]]))
    assert study.initial is study.best


def test_an_initial_population_may_have_failed_as_a_whole(tmp_path):
    run = write_run(tmp_path / "run", [[[(None, 0)], [(2.0, 0), (1.0, None)], [(3.0, 0)]]])
    study = study_run(run)
    assert (study.initial.evaluation, study.best.evaluation) == (1, 3)


@pytest.mark.parametrize("iterations", [[], [[(None, 0), (None, 1)]]], ids=["begun", "all failed"])
def test_without_any_fitness_there_is_nothing_to_show(tmp_path, iterations, refused):
    run = write_run(tmp_path / "run", [iterations, []])
    with refused(run, "", "no gait of this run has a fitness yet"):
        study_run(run)
