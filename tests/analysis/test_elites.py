"""The map of a run: which gaits are on it, and which of them stay on disturbed robots."""

import json
import math

import numpy as np
import pytest
from helpers.synthetic_run import tiny_scenario, write_run
from ribs.archives import GridArchive

from tetra_drake.analysis.elites import (
    CELLS,
    chosen,
    elites,
    judge_elites,
    robust,
)
from tetra_drake.analysis.robustness import by_gait, judge
from tetra_drake.evolution.run import load_run
from tetra_drake.optimizers.quality_diversity import FLOOR
from tetra_drake.scenario.optimizer_kinds import QualityDiversity

KIND = QualityDiversity(measures={"speed": [0.0, 0.1], "lifted": [0.2, 0.8]}, cells=[5, 4], draws=2)


@pytest.fixture
def run_of(tmp_path):
    """run_of({fitness: (speed, lifted)}, ...): a run with a trial for each mapping."""

    def make(*trials, kind=KIND, **changes):
        scenario = tiny_scenario().with_changes({"optimizer": kind, **changes})
        places = {f: dict(zip(KIND.measures, m, strict=True)) for t in trials for f, m in t.items()}
        rows = [[[(fitness, None) for fitness in trial]] for trial in trials]
        return load_run(write_run(tmp_path / "run", rows, scenario=scenario, metrics=places))

    return make


def keep(run, shares):
    """Records shares of draws kept, by (trial, index)."""
    lines = [
        json.dumps({"trial": trial, "index": index, "kept": kept, "mean_distance": None}) + "\n"
        for (trial, index), kept in shares.items()
    ]
    (run.directory / "elites.jsonl").write_text("".join(lines))


def keys(gaits):
    return list(zip(gaits["trial"], gaits["index"], strict=True))


def test_the_map_is_that_of_pyribs(run_of):
    generator = np.random.default_rng(4)
    fitnesses = generator.normal(2.0, 2.0, 200).tolist()
    # Some on the borders of cells, some beyond the map.
    places = [generator.uniform(-0.02, 0.12, 200), generator.uniform(0.1, 0.9, 200).round(2)]
    places = np.transpose(places).tolist()
    found = elites(run_of(dict(zip(fitnesses, places, strict=True))))
    ranges = [tuple(ends) for ends in KIND.measures.values()]
    archive = GridArchive(
        solution_dim=1, dims=KIND.cells, ranges=ranges, threshold_min=FLOOR, learning_rate=1.0
    )
    archive.add(np.arange(200)[:, None], fitnesses, places)
    expected = archive.data(["index", "solution"])
    theirs = zip(archive.int_to_grid_index(expected["index"]), expected["solution"], strict=True)
    wanted = {tuple(cell.tolist()): int(solution[0]) for cell, solution in theirs}
    assert dict(zip(zip(*(found[c] for c in CELLS), strict=True), found["index"], strict=True)) == (
        wanted
    )
    assert found["fitness"].is_monotonic_decreasing
    assert found["fitness"].min() > FLOOR


def test_all_trials_are_on_one_map_without_failures_and_what_lacks_a_measure(run_of):
    run = run_of({2.0: (0.01, 0.3), 9.0: (None, 0.3), 5.0: (0.05, 0.3)}, {4.0: (0.01, 0.3)})
    assert keys(elites(run)) == [(0, 2), (1, 0)]
    assert elites(run)[CELLS].to_numpy().tolist() == [[2, 0], [0, 0]]
    assert elites(run)["kept"].isna().all()


def test_a_run_that_asks_for_no_map_has_none(run_of):
    run = run_of({2.0: (0.01, 0.3)}, **{"optimizer": tiny_scenario().optimizer})
    assert elites(run).empty and chosen(run) == {}
    judge_elites(run.directory)
    assert not (run.directory / "elites.jsonl").exists()


def test_the_fittest_and_those_next_to_the_corners_are_chosen_without_lucky_ones(run_of):
    run = run_of(
        {9.0: (0.09, 0.7), 8.0: (0.05, 0.5), 3.0: (0.01, 0.3), 2.0: (0.03, 0.7), 4.0: (0.07, 0.3)}
    )
    keep(run, {(0, 0): 0.4, (0, 1): 0.5, (0, 2): 1.0})
    assert keys(robust(elites(run))) == [(0, 1), (0, 4), (0, 2), (0, 3)]
    assert {name: gait["index"] for name, gait in chosen(run).items()} == {
        "fittest of the map": 1,
        "low speed, low lifted": 2,
        "low speed, high lifted": 3,
        "high speed, low lifted": 4,
        "high speed, high lifted": 1,
    }
    keep(run, {(0, index): 0.0 for index in range(5)})
    assert chosen(run) == {}


def test_elites_are_simulated_on_disturbed_robots_once(run_of):
    changes = {"cpg.start_up": 0.0, "engine": "!Compiled"}
    run = run_of({2.0: (0.01, 0.3), 3.0: (0.05, 0.3)}, **changes)
    path = run.directory / "elites.jsonl"
    keep(run, {(0, 1): 0.25})
    with path.open("a") as file:
        file.write('{"trial": 0, "ind')
    judge_elites(run.directory, workers=1)
    found = elites(load_run(run.directory)).set_index("index")
    expected = by_gait(
        judge(run.manifest.scenario, {0: run.gait(0, 0)}, draws=2, seed=7, workers=1)
    )
    ours = found.loc[0, ["kept", "mean_distance"]].tolist()
    assert ours == expected.loc[0, ["kept", "mean"]].tolist()
    assert not math.isnan(ours[1])
    assert found.loc[1, "kept"] == 0.25
    written = path.read_bytes()
    judge_elites(run.directory, workers=1)
    assert path.read_bytes() == written
