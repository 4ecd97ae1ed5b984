"""The benchmark of engines and settings, on short gaits."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tetra_drake.benchmark import measure as benchmark
from tetra_drake.benchmark import tables
from tetra_drake.benchmark.measure import CLOSE_IN, Row, error_statistics, measure
from tetra_drake.benchmark.settings import SETS, compiled, describe, drake, mujoco, own, settings_of
from tetra_drake.cli import main
from tetra_drake.engines import mujoco as mujoco_engine
from tetra_drake.errors import InputError
from tetra_drake.robot.gait import Gait, save_gait, seeded_gait
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.schema import Scenario


@pytest.fixture
def short(scenario: Scenario) -> Scenario:
    """0.3 s, driven from 0.1 s on."""
    times = {"simulation.duration": 0.3, "simulation.steady_from": 0.2, "cpg.start_up": 0.1}
    return scenario.with_changes(times)


@pytest.fixture
def no_mujoco(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine without MuJoCo; only few gaits in a batch."""
    for module in (mujoco_engine, benchmark):
        monkeypatch.setattr(module, "installed", lambda: False)
    monkeypatch.setattr(benchmark, "BATCH", 2)


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
        row.time([gait])
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
    assert [row["engine"] for row in rows] == ["drake", "drake", "compiled", "compiled"]
    assert [row["batch"] for row in rows] == [False, False, False, True]
    for row in rows:
        assert row["real_time_factor_per_core"] > 0.0 and row["evaluations"] > 0
        assert row["failed"] == 0 and len(row["distances_in"]) == 2
        assert row["worst_error_in"] < CLOSE_IN
    assert rows[2]["distances_in"] == rows[3]["distances_in"]
    assert [gait["well_conditioned"] for gait in found["gaits"]] == [True, True]
    assert found["mujoco"]["left_out"]
    (cost,) = found["step_costs"]
    assert cost["tetrahedra"] == 2 and cost["steps"] > 0 and cost["microseconds_per_step"] > 0.0
    assert len(stages) >= 2 + len(gaits)
    table = [line for line in tables.to_markdown(found).splitlines() if line.startswith("|")]
    assert len(table) == 2 + len(rows) + 2 + 1
    assert table[2].startswith(f"| {rows[0]['engine']} | {rows[0]['setting']} | ")


def test_gaits_that_fail_leave_blanks_and_missing_mujoco_is_an_error_if_asked_for(short, no_mujoco):
    short.simulation.max_evaluations = 10
    found = measure(short, [seeded_gait(short)], sizes=[3])
    assert [row["failed"] for row in found["rows"]] == [1] * 4
    assert not any(row["median_error_in"] or row["evaluations"] for row in found["rows"])
    assert found["step_costs"][0]["microseconds_per_step"] is None
    assert not found["gaits"][0]["well_conditioned"]
    json.dumps(found, allow_nan=False)
    with pytest.raises(InputError):
        measure(short, [seeded_gait(short)], sets=["mujoco"])  # which is not left out
    assert "| - | - | - | - | 1 |" in tables.to_markdown(found)


@pytest.mark.skipif(not mujoco_engine.installed(), reason=mujoco_engine.INSTALL)
def test_mujoco_is_measured_against_its_own_converged_runs(short, monkeypatch):
    fine = [mujoco("implicitfast", 0.0625), mujoco("implicitfast", 0.125)]
    monkeypatch.setattr(benchmark, "settings_of", lambda name: fine)
    found = measure(short, [seeded_gait(short)], sets=["mujoco"], sizes=[])
    assert [row["median_error_in"] for row in found["rows"]] == [0.0, pytest.approx(0, abs=0.02)]
    assert found["rows"][1]["evaluations"] == 2400
    assert found["mujoco"]["median_distance_from_ours_in"] > 0.0
    assert "mujoco" in found["versions"]


def test_the_command_passes_its_options_on_and_writes_json(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    calls: list[tuple[list[str], dict[str, Any]]] = []

    def measured(scenario: Scenario, gaits: list[Gait], **options: Any) -> dict[str, Any]:
        calls.append(([gait.name for gait in gaits], options))
        return {"scenario": scenario.name}

    monkeypatch.setattr(benchmark, "measure", measured)
    monkeypatch.setattr(tables, "to_markdown", str)
    save_gait(seeded_gait(load_scenario("thesis")), "walking.json")
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
    save_gait(seeded_gait(four), "three.json")
    assert main(["benchmark", *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == "" and len(captured.err.splitlines()) == 1 and found in captured.err
