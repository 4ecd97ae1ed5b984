"""The benchmark of engines and settings, on short gaits."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tetra_drake.benchmark import measure as benchmark
from tetra_drake.benchmark.measure import CLOSE_IN, Row, error_statistics, measure, step_cost
from tetra_drake.benchmark.settings import (
    SETS,
    compiled,
    describe,
    drake,
    mujoco,
    own,
    settings_of,
)
from tetra_drake.benchmark.tables import to_markdown
from tetra_drake.cli import main
from tetra_drake.engines import mujoco as mujoco_engine
from tetra_drake.errors import InputError
from tetra_drake.robot.gait import Gait, save_gait, seeded_gait
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.schema import Scenario

NAN = float("nan")


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


# Settings


@pytest.mark.parametrize("name", SETS)
def test_the_settings_of_a_set_are_valid_and_differ(name: str, scenario: Scenario) -> None:
    scenarios = [scenario.with_changes(changes) for changes in settings_of(name)]
    described = [(s.simulation.engine, describe(s)) for s in scenarios]
    repeated = len(described) - len(set(described))
    assert repeated <= 1 and settings_of(name)[0] in (own("drake"), own("compiled"), own("mujoco"))
    if name != "default":
        assert len({engine for engine, _ in described}) == 1


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        (drake("radau3", 5e-3, 8, 0.25), "radau3 at 0.005, steps up to 8 ms, look-ahead 0.25 ms"),
        (drake("radau3", 1e-2, 2), "radau3 at 0.01, steps up to 2 ms, step end"),
        (
            drake("runge_kutta3", 1e-4, 2, witness=0.5),
            "runge_kutta3 at 0.0001, steps up to 2 ms, witness 0.5 ms",
        ),
        (compiled(0.1, 3, 0.02), "ros2 at 0.1 mm/s, steps up to 3 ms, look-ahead 0.02 ms"),
        (mujoco("Euler", 0.25), "Euler, steps of 0.25 ms"),
    ],
)
def test_a_setting_is_described_by_its_values(
    changes: dict[str, Any], expected: str, scenario: Scenario
) -> None:
    assert describe(scenario.with_changes(changes)) == expected


# Statistics


def test_errors_are_absolute_and_of_gaits_that_count_and_have_not_failed() -> None:
    errors = np.array([-0.3, 0.1, NAN, 5.0, 0.2])
    counted = np.array([True, True, True, False, True])
    assert error_statistics(errors, counted) == (0.2, 0.3)
    assert error_statistics(errors, np.zeros(5, dtype=bool)) == (None, None)


def test_time_and_errors_are_those_of_gaits_that_do_not_fail(
    short: Scenario, monkeypatch: pytest.MonkeyPatch
) -> None:
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


def test_the_cost_per_step_is_measured_for_any_number_of_tetrahedra(short: Scenario) -> None:
    cost = step_cost(short, 7)
    assert cost["tetrahedra"] == 7 and cost["steps"] > 0 and cost["microseconds_per_step"] > 0.0
    short.simulation.max_evaluations = 10
    assert step_cost(short, 3)["microseconds_per_step"] is None


# The measurement


def test_every_setting_is_measured_on_every_gait(short: Scenario, no_mujoco: None) -> None:
    gaits = [seeded_gait(short, seed) for seed in (0, 80)]
    stages: list[str] = []
    found = measure(short, gaits, sizes=[2], say=stages.append)
    rows = found["rows"]
    assert [(row["engine"], row["batch"]) for row in rows] == [
        *[("drake", False)] * 2,
        *[("compiled", False), ("compiled", True)],
    ]
    for row in rows:
        assert row["real_time_factor_per_core"] > 0.0 and row["evaluations"] > 0
        assert row["failed"] == 0 and len(row["distances_in"]) == 2
        assert row["worst_error_in"] < CLOSE_IN
    assert rows[2]["distances_in"] == rows[3]["distances_in"]
    assert [gait["well_conditioned"] for gait in found["gaits"]] == [True, True]
    assert found["mujoco"]["left_out"]
    assert [cost["tetrahedra"] for cost in found["step_costs"]] == [2]
    assert len(stages) >= 2 + len(gaits)
    table = [line for line in to_markdown(found).splitlines() if line.startswith("|")]
    assert len(table) == 2 + len(rows) + 2 + 1
    for row, line in zip(rows, table[2:], strict=False):
        assert [cell.strip() for cell in line.split("|")][1:3] == [row["engine"], row["setting"]]


def test_gaits_that_fail_leave_blanks(short: Scenario, no_mujoco: None) -> None:
    short.simulation.max_evaluations = 10
    found = measure(short, [seeded_gait(short)], sizes=[])
    assert [row["failed"] for row in found["rows"]] == [1] * 4
    assert not any(row["median_error_in"] or row["evaluations"] for row in found["rows"])
    assert not found["gaits"][0]["well_conditioned"]
    json.dumps(found, allow_nan=False)
    assert "| - | - | - | - | 1 |" in to_markdown(found)


@pytest.mark.skipif(not mujoco_engine.installed(), reason=mujoco_engine.INSTALL)
def test_mujoco_is_measured_against_its_own_converged_runs(
    short: Scenario, monkeypatch: pytest.MonkeyPatch
) -> None:
    fine = [mujoco("implicitfast", 0.0625), mujoco("implicitfast", 0.125)]
    monkeypatch.setattr(benchmark, "settings_of", lambda name: fine)
    found = measure(short, [seeded_gait(short)], sets=["mujoco"], sizes=[])
    assert [row["median_error_in"] for row in found["rows"]] == [0.0, pytest.approx(0, abs=0.02)]
    assert found["rows"][1]["evaluations"] == 2400
    assert found["mujoco"]["median_distance_from_ours_in"] > 0.0
    assert "mujoco" in found["versions"]


def test_mujoco_asked_for_but_missing_is_an_error(short: Scenario, no_mujoco: None) -> None:
    with pytest.raises(InputError) as caught:
        measure(short, [seeded_gait(short)], sets=["mujoco"])
    assert caught.value.key == "simulation.engine"


# The command


@pytest.fixture
def work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working folder."""
    (tmp_path / "folder").mkdir()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_command_passes_its_options_on_and_writes_json(
    work: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    calls: list[tuple[Scenario, list[Gait], dict[str, Any]]] = []
    found = {"step_costs": [], "rows": [], "gaits": [], "scenario": "thesis", "duration_s": 15.0}
    found |= {"cores": 2, "converged": "", "mujoco": {"median_distance_from_ours_in": None}}
    found["mujoco"]["left_out"] = ""  # type: ignore[index]

    def measured(scenario: Scenario, gaits: list[Gait], **options: Any) -> dict[str, Any]:
        calls.append((scenario, gaits, options))
        return found

    monkeypatch.setattr(benchmark, "measure", measured)
    save_gait(seeded_gait(load_scenario("thesis")), "walking.json")
    assert main(["benchmark", "walking.json", "--json", "found.json"]) == 0
    assert main(["benchmark", "--gaits", "3", "--settings", "compiled", "--sizes", "4", "5"]) == 0
    (_, one, defaults), (_, random, options) = calls
    assert [gait.name for gait in one] == ["random gait 80"] and len(random) == 3
    assert (defaults["sets"], defaults["sizes"]) == (["default"], benchmark.SIZES)
    assert (options["sets"], options["sizes"]) == (["compiled"], [4, 5])
    assert json.loads(Path("found.json").read_text()) == found
    assert capsys.readouterr().out.count("| engine |") == 2


@pytest.mark.parametrize(
    ("arguments", "source", "key"),
    [
        (["missing.json"], "missing.json", ""),
        (["three.json"], "three.json", "weights"),
        (["three.json", "--gaits", "3"], "--gaits", ""),
        (["--scenario", "none.yaml"], "none.yaml", ""),
        (["--json", "folder"], "folder", ""),
        (["--json", "three.json/x.json"], "three.json/x.json", ""),
    ],
)
def test_bad_input_is_refused_before_anything_is_measured(
    arguments: list[str],
    source: str,
    key: str,
    work: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.delattr(benchmark, "measure")
    save_gait(
        seeded_gait(load_scenario("thesis").with_changes({"robot.tetrahedra": 4})), "three.json"
    )
    assert main(["benchmark", *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == "" and len(captured.err.splitlines()) == 1
    assert f" {source}: {key}" in captured.err


def test_an_interrupted_measurement_leaves_no_file(
    work: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*args: object, **options: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(benchmark, "measure", interrupted)
    assert main(["benchmark", "--json", "found.json"]) == 130
    assert os.listdir(work) == ["folder"]
