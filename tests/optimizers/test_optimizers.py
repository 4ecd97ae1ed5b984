"""The optimisers: what all have in common, then each by itself."""

import dataclasses
import math
import sys
import zlib

import numpy as np
import pytest
from helpers.analytic import measures, optimise, small_scenario
from threadpoolctl import threadpool_limits

from tetra_drake.lab.elites import quality_diversity
from tetra_drake.optimizers import cma_es, optimizer_of
from tetra_drake.optimizers.base import Evaluation
from tetra_drake.robot.parameter_space import ParameterSpace
from tetra_drake.scenario.optimizer_kinds import CmaEs, QualityDiversity, RandomSearch, SteadyState

LEARNING = [CmaEs(sample=0), CmaEs(sample=20)]
DIVERSE = QualityDiversity()
FLOOR = -50.0
BUDGETED = [*LEARNING, DIVERSE, RandomSearch()]
ALL = [*BUDGETED, SteadyState()]


TAU_A, TAU_B = -2, -1
"""Places of the time constants in a vector."""


@pytest.fixture(autouse=True)
def a_small_map_of_the_bowl(monkeypatch):
    """Few emitters, small batches, and a map of what is far below 0."""
    for name, value in (("EMITTERS", 2), ("BATCH", 10), ("FLOOR", FLOOR)):
        monkeypatch.setattr(quality_diversity, name, value)


def make(kind, *, seed=3, budget=600, **changes):
    scenario = small_scenario().with_changes({"evolution.evaluations": budget} | changes)
    generator = np.random.default_rng(seed)
    return optimizer_of(kind)(ParameterSpace.of(scenario), scenario.evolution, generator)


def bowl(vector):
    """0 at most, where the weights are 2 and tau_A is at its floor."""
    fitness = -float(((vector[:-2] - 2.0) ** 2).sum() + 40.0 * (vector[TAU_A] - 0.2))
    return Evaluation(fitness, measures(vector))


def failing(vector):
    return Evaluation(failure="fell")


def run(kind, evaluate=bowl, *, budget=600, **options):
    """The batches and iterations of a trial."""
    return optimise(make(kind, budget=budget, **options), evaluate, budget)


def fitnesses(batches):
    return np.array([bowl(vector).fitness for batch in batches for vector in batch])


def test_digits_do_not_depend_on_the_threads_of_linear_algebra():
    # Of a matrix with some 145 rows. This tells on a machine with two cores or more.
    asked = []
    for threads in (1, 2):
        with threadpool_limits(threads, user_api="blas"):
            batches, _ = run(CmaEs(sample=0), budget=400, **{"robot.tetrahedra": 10})
        asked.append(np.concatenate(batches))
    assert asked[0].shape[1] > 140
    np.testing.assert_array_equal(*asked)


@pytest.mark.parametrize("kind", LEARNING)
def test_a_quarter_of_the_evaluations_of_random_search_is_enough(kind):
    best = fitnesses(run(RandomSearch(), budget=2400)[0]).max()
    assert fitnesses(run(kind)[0]).max() > 0.5 * best


@pytest.mark.parametrize("kind", BUDGETED)
def test_no_vector_is_below_a_floor_and_none_is_asked_for_twice(kind):
    vectors = np.concatenate(run(kind)[0])
    assert (vectors[:, :-2] >= 0.0).all() and (vectors[:, TAU_A] >= 0.2).all()
    np.testing.assert_array_equal(vectors[:, TAU_B], 2.0 * vectors[:, TAU_A])
    assert len(np.unique(vectors[:, :-1], axis=0)) == 600
    assert (vectors[:, TAU_A] == 0.2).mean() < 0.01


@pytest.mark.parametrize("kind", ALL)
def test_parameters_with_equal_bounds_stay_and_tau_b_may_go_its_own_way(kind):
    def vectors(**bounds):
        changes = {f"gait_bounds.{name}": value for name, value in bounds.items()}
        return np.concatenate(run(kind, budget=100, **changes)[0])

    fixed = vectors(tau_a_min="0.3 s", tau_a_max="0.3 s")
    assert (fixed[:, -2:] == [0.3, 0.6]).all() and np.ptp(fixed[:, 0]) > 0.5
    fixed = vectors(weight_min=2.0, weight_max=2.0)
    assert (fixed[:, :-2] == 2.0).all() and np.ptp(fixed[:, TAU_A]) > 0.1
    free = vectors(independent_tau_b=True)
    assert (free[:, TAU_B] >= 0.4).all()
    if kind != RandomSearch():  # random gaits are always coupled
        assert (free[:, TAU_B] != 2.0 * free[:, TAU_A]).mean() > 0.4


@pytest.mark.parametrize("kind", LEARNING)
def test_a_failure_is_worse_than_all_others(kind):
    """However large the other fitnesses are, and wherever the failures are."""

    def steep(vector):
        if vector[0] > 2.0:
            return failing(vector)
        return Evaluation(1e6 * (bowl(vector).fitness - 1e3))

    batches, iterations = run(kind, steep, budget=900)
    shares = [np.mean([vector[0] > 2.0 for vector in batch]) for batch in batches]
    assert shares[0] > 0.3
    assert fitnesses(batches[-3:]).mean() > 0.3 * fitnesses(batches[:1]).mean()
    assert all(math.isfinite(iteration.report["mean_fitness"]) for iteration in iterations)


@pytest.mark.parametrize("kind", BUDGETED)
def test_batches_that_fail_as_a_whole_teach_nothing_and_stop_nothing(kind):
    optimizer = make(kind, budget=1200)
    _, iterations = optimise(optimizer, failing, 240)
    assert {iteration.report["mean_fitness"] for iteration in iterations} == {None}
    batches, _ = optimise(optimizer, bowl, 900)
    if kind in LEARNING:
        assert fitnesses(batches).max() > -1.5


def test_the_mean_fitness_of_the_steady_state_never_falls_and_rises_much():
    _, iterations = run(SteadyState(population=20), budget=420)
    means = np.array([iteration.report["mean_fitness"] for iteration in iterations])
    assert (np.diff(means) >= -1e-12).all()
    assert means[-1] > 0.6 * means[0]


def test_a_trial_ends_when_the_mean_fitness_levels_off_and_not_for_want_of_one():
    kind = SteadyState(population=12, stop_after=20, stop_window=10)
    _, level = run(kind, lambda vector: Evaluation(1.0))
    assert [iteration.stop for iteration in level] == [None] * 21 + ["mean fitness levelled off"]
    _, failed = run(kind, failing)
    assert {(each.report["mean_fitness"], each.stop) for each in failed} == {(None, None)}


def test_it_begins_with_a_random_sample_and_goes_on_from_the_mean_of_its_best_quarter(monkeypatch):
    monkeypatch.setattr(cma_es, "SIGMA", 1e-9)
    batches, iterations = run(CmaEs(sample=32), seed=8, budget=60)
    generator, space = np.random.default_rng(8), ParameterSpace.of(small_scenario())
    np.testing.assert_allclose(batches[0], [space.random(generator) for _ in range(32)])
    best = sorted(batches[0], key=lambda vector: bowl(vector).fitness)[-8:]
    np.testing.assert_allclose(batches[1] - np.mean(best, axis=0), 0.0, atol=1e-6)
    assert iterations[1].report["sigma"] == pytest.approx(1e-9, rel=1e-4)


def test_without_a_sample_it_starts_in_the_middle_as_wide_as_sigma_says(monkeypatch):
    monkeypatch.setattr(cma_es, "SIGMA", 0.2)  # hardly bent by the floors
    (batch, *_), _ = run(CmaEs(sample=0, population=400), budget=400)
    widths = np.array([2.4] * 24 + [0.3])  # of [1, 3.4] and [0.2, 0.5] s
    middle = np.array([2.2] * 24 + [0.35])
    deviations = (np.array(batch)[:, :-1] - middle) / widths
    # Of 400 numbers: the standard error of the mean is 0.01, of the deviation 0.007.
    np.testing.assert_allclose(deviations.mean(axis=0), 0.0, atol=0.04)
    np.testing.assert_allclose(deviations.std(axis=0), cma_es.SIGMA, atol=0.03)


def test_the_best_of_several_searches_goes_on(monkeypatch):
    for name, value in (("TRYOUT", 45), ("SIGMA", 0.01), ("TOLERANCE", 1e-9)):
        monkeypatch.setattr(cma_es, name, value)
    kind = CmaEs(population=10, sample=12, starts=5)
    batches, iterations = run(kind, budget=300)
    starts = [iteration.report["start"] for iteration in iterations]
    tried, after = starts[:18], starts[18:]
    # A fourth search would take more than 150 in all. Each has a sample of its own.
    assert tried == [None, *[0] * 5, None, *[1] * 5, None, *[2] * 5]
    best = max(range(3), key=lambda i: fitnesses(batches[6 * i + 1 : 6 * i + 6]).max())
    assert set(after) == {best}


def test_where_a_search_has_stalled_another_begins_elsewhere(monkeypatch):
    for name, value in (("TRYOUT", 60), ("PATIENCE", 80), ("SIGMA", 0.1)):
        monkeypatch.setattr(cma_es, name, value)

    kind = CmaEs(population=10, sample=0, starts=1)
    _, iterations = run(kind, lambda vector: Evaluation(1.0), budget=400)
    reports = [iteration.report for iteration in iterations[:-1]]
    # The first batch sets the level. After 80 more without a rise, the next search begins.
    for start in (0, 1):
        first, *later = (each["population"] for each in reports if each["start"] == start)
        assert first == 10 and sum(later) >= 80 > sum(later[:-1])
    assert iterations[-1].report["start"] == 2
    _, iterations = run(kind, budget=300)  # the bowl: it rises
    assert {iteration.report["start"] for iteration in iterations} == {0}


def test_it_begins_anew_and_larger_around_its_best_where_it_has_converged():
    kind, small = CmaEs(population=6), {"robot.tetrahedra": 3}
    batches, iterations = run(kind, budget=3000, **small)  # four weights and tau_A
    reports = [iteration.report for iteration in iterations]
    assert {(0, 6), (1, 12), (2, 24)} <= {(r["restart"], r["population"]) for r in reports[1:-1]}
    first = next(i for i, report in enumerate(reports) if report["restart"] == 1)
    assert reports[first - 1]["sigma"] < cma_es.TOLERANCE
    assert reports[first]["sigma"] == pytest.approx(cma_es.SIGMA, rel=1e-4)
    best = max(np.concatenate(batches[:first]), key=lambda vector: bowl(vector).fitness)
    assert np.abs(np.mean(batches[first], axis=0) - best)[:-2].max() < 3 * 0.2 * 2.4 / 3


def walker(vector):
    """As bowl(), but every seventh vector fails, and every seventh lacks a measure."""
    chance = zlib.crc32(vector.tobytes()) % 7
    if chance == 0:
        return failing(vector)
    metrics = {"lifted": 0.5} if chance == 1 else measures(vector)
    return dataclasses.replace(bowl(vector), metrics=metrics)


def cells(batches):
    """By the cells of the default map, the greatest fitness above the floor."""
    best = {}
    for vector in np.concatenate(batches):
        evaluation = walker(vector)
        if len(evaluation.metrics) == 2 and evaluation.fitness > FLOOR:
            x, y = evaluation.metrics["travelling_index"], evaluation.metrics["lifted"]
            cell = tuple(np.clip([int(20 * x), int(20 * (y - 0.4) / 0.2)], 0, 19).tolist())
            best[cell] = max(evaluation.fitness, best.get(cell, -math.inf))
    return best


def test_elites_are_the_cells_of_gaits_above_the_floor_that_have_not_failed(monkeypatch):
    batches, iterations = run(DIVERSE, walker)
    elites = [len(cells(batches[: i + 1])) for i in range(len(batches))]
    assert [iteration.report["elites"] for iteration in iterations] == elites
    assert elites[-1] > 30
    monkeypatch.setattr(quality_diversity, "FLOOR", 0.0)  # the bowl is below it everywhere
    _, iterations = run(DIVERSE)
    assert iterations[-1].report["elites"] == 0


@pytest.mark.parametrize("measure", [None, math.nan])
def test_nothing_is_learnt_from_a_batch_without_a_measure(measure):
    optimizer, elites = make(DIVERSE), []
    for metrics in ({}, {"lifted": measure}, {}):
        evaluations = [bowl(vector) for vector in optimizer.ask()]
        changed = [dataclasses.replace(e, metrics=e.metrics | metrics) for e in evaluations]
        elites.append(optimizer.tell(changed).report["elites"])
    assert 0 < elites[0] == elites[1] < elites[2]


def test_a_measure_that_no_gait_has_ends_the_search(refused):
    optimizer = make(DIVERSE)
    evaluations = [failing(vector) for vector in optimizer.ask()]  # without metrics
    evaluations[0] = Evaluation(1.0, {"travelling_index": 0.5, "lifted": None})
    with refused("scenario", "optimizer.measures.lifted", "1 gaits"):
        optimizer.tell(evaluations)


def test_the_map_is_fuller_and_fitter_than_that_of_random_search():
    runs = (run(kind, walker, budget=4000) for kind in (DIVERSE, RandomSearch()))
    ours, theirs = (cells(batches) for batches, _ in runs)
    assert len(ours) > 1.2 * len(theirs)
    assert np.median([ours[cell] - theirs[cell] for cell in ours.keys() & theirs.keys()]) > 2.0


def test_without_pyribs_it_is_refused(monkeypatch, refused):
    monkeypatch.setitem(sys.modules, "ribs", None)
    with refused("optimizer", "", "tetra_drake[qd]"):
        optimizer_of(QualityDiversity())
