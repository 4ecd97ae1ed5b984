"""The benchmark of engines and settings, on short gaits."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tetra_drake.benchmark import measure as benchmark
from tetra_drake.benchmark import tables
from tetra_drake.benchmark.measure import CLOSE_IN, LANES, Batch, Row, error_statistics, measure
from tetra_drake.benchmark.settings import (
    SETS,
    compiled,
    describe,
    drake,
    grounds,
    mujoco,
    own,
    settings_of,
)
from tetra_drake.cli import main
from tetra_drake.engines import mujoco as mujoco_engine
from tetra_drake.errors import InputError
from tetra_drake.robot.gait import Gait, save_gait, seeded_gait
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.schema import Scenario


@pytest.fixture
def short(scenario: Scenario) -> Scenario:
    """0.3 s, driven from 0.1 s on."""
    times = {
        "simulation.duration": "0.3 s",
        "simulation.steady_from": "0.2 s",
        "cpg.start_up": "0.1 s",
    }
    return scenario.with_changes(times)


@pytest.fixture
def no_mujoco(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine without MuJoCo."""
    monkeypatch.setattr(mujoco_engine, "installed", lambda: False)


@pytest.fixture(autouse=True)
def small_batches(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two cores; few gaits at a time, measured once."""
    monkeypatch.setattr(benchmark, "available_cores", lambda: 2)
    for name, value in {
        "BATCHES": (1, 5),
        "MUJOCO_BATCH": 1,
        "GROUND_BATCH": 5,
        "ROUNDS": 1,
    }.items():
        monkeypatch.setattr(benchmark, name, value)


@pytest.mark.parametrize("name", SETS)
def test_the_settings_of_a_set_are_valid_and_belong_together(name, scenario):
    scenarios = [scenario.with_changes(changes) for changes in settings_of(name)]
    engines = {changed.simulation.engine for changed in scenarios}
    assert len(engines) == (3 if name == "default" else 1)
    described = {describe(changed) for changed in scenarios}
    assert len(described) >= len(scenarios) - 1  # the scenario's own settings may be in the list


def test_a_setting_is_described_by_its_values(scenario):
    for changes in (drake("radau3", 5e-3, 8, witness=0.5), compiled(5e-3, 8, 0.5)):
        text = describe(scenario.with_changes(changes))
        assert all(value in text for value in ("0.005", "8 ms", "0.5 ms"))


def test_errors_are_absolute_and_of_gaits_that_count_and_have_not_failed():
    errors = np.array([-0.3, 0.1, np.nan, 5.0, 0.2])
    counted = np.array([True, True, True, False, True])
    assert error_statistics(errors, counted) == (0.2, 0.3)
    assert error_statistics(errors, np.zeros(5, dtype=bool)) == (None, None)


def test_time_and_errors_are_those_of_gaits_that_do_not_fail(short, monkeypatch):
    row = Row(short.with_changes(own("compiled")))
    gaits = [seeded_gait(short, seed) for seed in range(3)]
    results = [row.simulate(gait) for gait in gaits]
    results[1] = None
    monkeypatch.setattr(Row, "simulate", lambda self, gait: results[gaits.index(gait)])
    for gait in gaits:
        row.time(gait)
    exact_in = np.array([result.metrics.distance_in if result else 0.0 for result in results])
    found = row.to_json(exact_in + 0.5, np.ones(3, dtype=bool))
    assert found["failed"] == 1 and found["distances_in"][1] is None
    assert found["median_error_in"] == pytest.approx(0.5)
    assert row.simulated == pytest.approx(0.6)
    assert found["real_time_factor_per_core"] == pytest.approx(0.6 / row.wall_time)


def test_every_setting_is_measured_on_every_gait(short, no_mujoco):
    gaits = [seeded_gait(short, seed) for seed in (0, 80)]
    stages: list[str] = []
    found = measure(short, gaits, sizes=[2], say=stages.append)
    rows = found["rows"]
    assert [row["engine"] for row in rows] == ["drake", "drake", "compiled"]
    for row in rows:
        assert row["real_time_factor_per_core"] > 0.0 and row["evaluations"] > 0
        assert row["failed"] == 0 and len(row["distances_in"]) == 2
        assert row["worst_error_in"] < CLOSE_IN
    assert [gait["well_conditioned"] for gait in found["gaits"]] == [True, True]
    assert found["mujoco"]["left_out"]
    (cost,) = found["step_costs"]
    assert cost["tetrahedra"] == 2 and cost["steps"] > 0
    for of in ("", "_in_lanes"):
        per_step = cost[f"microseconds_per_step{of}"]
        assert 0.0 < per_step == 2.0 * cost[f"microseconds_per_tetrahedron{of}"]
    assert len(stages) >= 2 + len(gaits)
    table = [line for line in tables.to_markdown(found).splitlines() if line.startswith("|")]
    lengths = len(rows), len(found["batches"]), 1, len(grounds())
    assert len(table) == sum(2 + length for length in lengths)
    assert [row["ground"] for row in found["grounds"]] == list(grounds())
    for row in found["grounds"]:
        assert row["compiled"] > row["drake"] > 0.0 < row["compiled_many"] and row["steps"] > 0
    assert table[2].startswith(f"| {rows[0]['engine']} | {rows[0]['setting']} | ")


def test_gaits_that_fail_leave_blanks_and_missing_mujoco_is_an_error_if_asked_for(short, no_mujoco):
    short.simulation.max_evaluations = 10
    found = measure(short, [seeded_gait(short)], sizes=[3])
    assert [row["failed"] for row in found["rows"]] == [1] * 3
    assert [batch["failed"] for batch in found["batches"]] == [1, 5, 5]
    assert not any(row["median_error_in"] or row["evaluations"] for row in found["rows"])
    assert found["step_costs"][0]["microseconds_per_step"] is None
    assert not found["gaits"][0]["well_conditioned"]
    json.dumps(found, allow_nan=False)
    with pytest.raises(InputError):
        measure(short, [seeded_gait(short)], sets=["mujoco"])  # which is not left out
    assert "| - | - | - | - | 1 |" in tables.to_markdown(found)


def test_batches_are_of_different_gaits_on_one_core_and_on_all_they_fill(short, no_mujoco):
    found = measure(short, [seeded_gait(short)], sets=["compiled"], sizes=[])["batches"]
    assert [(row["gaits"], row["cores"]) for row in found] == [(1, 1), (5, 1), (5, 2)]
    for row in found:
        assert row["setting"] == describe(short.with_changes(own("compiled")))
        assert row["real_time_factor"] == row["cores"] * row["real_time_factor_per_core"] > 0.0
        assert row["failed"] == 0


def test_batches_and_sizes_take_turns_and_their_medians_count(short, no_mujoco, monkeypatch):
    timed: list[tuple[int, int]] = []

    def time(batch: Batch) -> None:
        timed.append((batch.size, batch.cores))
        batch.factors.append(float(len(timed)))
        batch.step_costs.append(float(len(timed)))

    monkeypatch.setattr(Batch, "time", time)
    monkeypatch.setattr(benchmark, "ROUNDS", 3)
    monkeypatch.setattr(benchmark, "settings_of", lambda name: [own("compiled")])
    found = measure(short, [seeded_gait(short)], sets=["compiled"], sizes=[2])
    assert timed == 3 * [(1, 1), (5, 1), (5, 2), (1, 1), (LANES, 1)]
    assert [row["real_time_factor"] for row in found["batches"]] == [6.0, 7.0, 8.0]
    (cost,) = found["step_costs"]
    assert (cost["microseconds_per_step"], cost["microseconds_per_step_in_lanes"]) == (9.0, 10.0)


@pytest.mark.skipif(not mujoco_engine.installed(), reason=mujoco_engine.INSTALL)
def test_mujoco_is_measured_against_its_own_converged_runs(short, monkeypatch):
    fine = [mujoco("implicitfast", 0.0625), mujoco("implicitfast", 0.125)]
    monkeypatch.setattr(benchmark, "settings_of", lambda name: fine)
    found = measure(short, [seeded_gait(short)], sets=["mujoco"], sizes=[])
    assert [row["median_error_in"] for row in found["rows"]] == [0.0, pytest.approx(0, abs=0.02)]
    assert found["rows"][1]["evaluations"] == 2400
    assert found["mujoco"]["median_distance_from_ours_in"] > 0.0
    assert "mujoco" in found["versions"]
    batches = [(batch["setting"], batch["gaits"], batch["cores"]) for batch in found["batches"]]
    chosen = own("mujoco"), mujoco("implicitfast", 2)
    settings = [describe(short.with_changes(each)) for each in chosen]
    assert batches == [(setting, cores, cores) for setting in settings for cores in (1, 2)]


def test_the_command_passes_its_options_on_and_writes_json(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    calls: list[tuple[list[str], dict[str, Any]]] = []

    def measured(scenario: Scenario, gaits: list[Gait], **options: Any) -> dict[str, Any]:
        calls.append(([gait.name for gait in gaits], options))
        return {"scenario": scenario.name}

    monkeypatch.setattr(benchmark, "measure", measured)
    monkeypatch.setattr(tables, "to_markdown", str)
    thesis = load_scenario("thesis")
    save_gait(seeded_gait(thesis), "walking.json", thesis)
    assert main(["benchmark", "walking.json", "--json", "found.json"]) == 0
    assert main(["benchmark", "--gaits", "2", "--settings", "compiled", "--sizes", "4", "5"]) == 0
    (one, defaults), (random, options) = calls
    assert (one, random) == (["random gait 80"], ["random gait 0", "random gait 1"])
    assert (defaults["sets"], defaults["sizes"]) == (["default"], benchmark.SIZES)
    assert (options["sets"], options["sizes"]) == (["compiled"], [4, 5])
    assert json.loads(Path("found.json").read_text()) == {"scenario": "thesis"}
    assert capsys.readouterr().out.count("{'scenario': 'thesis'}") == 2


@pytest.mark.parametrize(
    ("arguments", "found"),
    [
        (["missing.json"], "missing.json: "),
        (["three.json"], "three.json: weights: "),
        (["three.json", "--gaits", "3"], "--gaits: "),
        (["--scenario", "none.yaml"], "none.yaml: "),
        (["--json", "three.json/x.json"], "three.json/x.json: "),
    ],
)
def test_bad_input_is_refused_before_measuring(arguments, found, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delattr(benchmark, "measure")
    four = load_scenario("thesis").with_changes({"robot.tetrahedra": 4})
    save_gait(seeded_gait(four), "three.json", four)
    assert main(["benchmark", *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == "" and len(captured.err.splitlines()) == 1 and found in captured.err
