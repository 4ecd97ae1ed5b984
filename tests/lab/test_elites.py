"""The map of a run: which gaits are on it, and which of them stay on disturbed robots."""

import numpy as np
import pytest
from helpers.synthetic_run import tiny_scenario, write_run

from tetra_drake.evolution.entries import EliteLine
from tetra_drake.evolution.run import load_run
from tetra_drake.lab.elites.elites import CELLS, elites, judge_elites, kept_gaits, notable_gaits
from tetra_drake.lab.elites.quality_diversity import FLOOR
from tetra_drake.lab.study.robustness import by_gait, robustness
from tetra_drake.scenario.optimizer_kinds import QualityDiversity

KIND = QualityDiversity(measures={"speed": [0.0, 0.1], "lifted": [0.2, 0.8]}, cells=[5, 4], draws=2)


@pytest.fixture
def run_of(tmp_path):
    """run_of({fitness: (speed, lifted)}, ...): a run with a trial for each mapping."""

    def make(*trials, **changes):
        scenario = tiny_scenario().with_changes({"optimizer": KIND, **changes})
        places = {f: dict(zip(KIND.measures, m, strict=True)) for t in trials for f, m in t.items()}
        rows = [[[(fitness, None) for fitness in trial]] for trial in trials]
        return load_run(write_run(tmp_path / "run", rows, scenario=scenario, metrics=places))

    return make


def keep(run, shares):
    """Records shares of draws kept, by the index of the first trial."""
    file = run.file("elites.jsonl")
    file.path.unlink(missing_ok=True)
    line = {"trial": 0, "mean_distance": None}
    file.append([EliteLine(**line, index=index, kept=kept) for index, kept in shares.items()])


def keys(gaits):
    return list(zip(gaits["trial"], gaits["index"], strict=True))


def test_the_map_is_that_of_pyribs(run_of):
    from ribs.archives import GridArchive  # which takes seconds to load

    generator = np.random.default_rng(4)
    fitnesses = generator.normal(2.0, 2.0, 200).tolist()
    # Some on the borders of cells, some beyond the map.
    places = [generator.uniform(-0.02, 0.12, 200), generator.uniform(0.1, 0.9, 200).round(2)]
    places = np.transpose(places).tolist()
    ours = elites(run_of(dict(zip(fitnesses, places, strict=True))))
    ranges = [tuple(ends) for ends in KIND.measures.values()]
    map_of = {"dims": KIND.cells, "ranges": ranges, "threshold_min": FLOOR}
    archive = GridArchive(solution_dim=1, learning_rate=1.0, **map_of)
    archive.add(np.arange(200)[:, None], fitnesses, places)
    theirs = archive.data(["index", "solution"])
    cells = archive.int_to_grid_index(theirs["index"]).tolist()
    solutions = theirs["solution"][:, 0].astype(int).tolist()
    by_index = ours.set_index("index")[CELLS].T.to_dict("list")
    assert dict(zip(solutions, cells, strict=True)) == by_index
    assert ours["fitness"].is_monotonic_decreasing
    assert ours["fitness"].min() > FLOOR


def test_all_trials_are_on_one_map_without_failures_and_what_lacks_a_measure(run_of):
    run = run_of({2.0: (0.01, 0.3), 9.0: (None, 0.3), 5.0: (0.05, 0.3)}, {4.0: (0.01, 0.3)})
    assert keys(elites(run)) == [(0, 2), (1, 0)]
    assert elites(run)[CELLS].to_numpy().tolist() == [[2, 0], [0, 0]]
    assert elites(run)["kept"].isna().all()


def test_the_fittest_and_those_next_to_the_corners_are_chosen_without_lucky_ones(run_of):
    gaits = {9.0: (0.09, 0.7), 8.0: (0.05, 0.5), 3.0: (0.01, 0.3), 2.0: (0.03, 0.7)}
    run = run_of(gaits | {4.0: (0.07, 0.3)})
    keep(run, {0: 0.4, 1: 0.5, 2: 1.0})
    assert keys(kept_gaits(elites(run))) == [(0, 1), (0, 4), (0, 2), (0, 3)]
    chosen = {name: gait["index"] for name, gait in notable_gaits(run).items()}
    corners = ["low speed, low lifted", "low speed, high lifted"]
    assert [*chosen][:3] == ["fittest of the map", *corners]
    assert list(chosen.values()) == [1, 2, 3, 4, 1]
    keep(run, dict.fromkeys(range(5), 0.0))
    assert notable_gaits(run) == {}


def test_elites_are_simulated_on_disturbed_robots_once(run_of):
    run = run_of({2.0: (0.01, 0.3), 3.0: (0.05, 0.3)}, engine="!Compiled")
    path = run.directory / "elites.jsonl"
    keep(run, {1: 0.25})
    with path.open("a") as file:
        file.write('{"trial": 0, "ind')
    judge_elites(run.directory, workers=1)
    options = {"draws": KIND.draws, "seed": run.manifest.seed, "alone": False}
    expected = by_gait(robustness(run.scenario, {0: run.gait(0, 0)}, **options))
    table = elites(load_run(run.directory)).set_index("index")
    assert table.loc[0, ["kept", "mean_distance"]].tolist() == pytest.approx(
        expected.loc[0, ["kept", "mean"]].tolist()
    )
    assert table.loc[1, "kept"] == 0.25
    written = path.read_bytes()
    judge_elites(run.directory)
    assert path.read_bytes() == written
