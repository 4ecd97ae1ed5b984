"""The work-precision measurement, on a short stretch of one gait."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from tetra_drake.benchmark import work_precision
from tetra_drake.benchmark.work_precision import (
    CONVERGED,
    CONVERGED_COMPILED,
    HEADER,
    LOOK_AHEAD,
    STEP_END,
    WITNESS,
    CompiledSetting,
    Row,
    Run,
    Setting,
    default_setting,
    format_row,
    measure,
)
from tetra_drake.robot.gait import load_gait
from tetra_drake.scenario.schema import Scenario


def test_a_setting_changes_the_integrator_and_nothing_else(scenario: Scenario) -> None:
    setting = Setting("runge_kutta3", 1e-4, 2.0, WITNESS, 0.5)
    changed = setting.apply(scenario)
    assert default_setting(changed) == setting
    assert dataclasses.replace(changed, simulation=scenario.simulation) == scenario


def test_the_default_row_is_the_scenarios_own(scenario: Scenario) -> None:
    assert default_setting(scenario).apply(scenario) == scenario


@pytest.mark.parametrize("placement", [STEP_END, LOOK_AHEAD])
def test_step_end_settings_switch_the_look_ahead(scenario: Scenario, placement: str) -> None:
    resolution = 1.0 if placement == LOOK_AHEAD else 0.0
    applied = Setting("radau3", 1e-2, 2.0, placement, resolution).apply(scenario)
    assert applied.simulation.mode_changes == "step_end"
    assert applied.simulation.look_ahead == pytest.approx(1e-3 * resolution)


def test_errors_are_against_the_converged_run(
    scenario: Scenario, data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenario.simulation.duration, scenario.simulation.steady_from = 0.2, 0.1
    monkeypatch.setattr(work_precision, "settings_to_compare", lambda: [])
    gaits = [load_gait(data / f"gait_{letter}.json", scenario) for letter in "bc"]
    converged, default = measure(scenario, gaits)
    assert converged.setting == CONVERGED
    np.testing.assert_array_equal(converged.errors_in, 0.0)
    assert default.setting == default_setting(scenario)
    expected = [
        ours.distance_in - exact.distance_in
        for ours, exact in zip(default.runs, converged.runs, strict=True)
    ]
    np.testing.assert_array_equal(default.errors_in, expected)
    assert default.runs[0].derivative_evaluations < converged.runs[0].derivative_evaluations


def test_a_row_says_how_many_gaits_failed() -> None:
    run = Run(1.0, 2.0, 10, 1000, 100)
    failed = Run(np.nan, np.nan, 0, 0, 0)
    row = Row(Setting("radau3", 1e-2, 2.0, STEP_END), (run, failed), np.array([0.25, np.nan]))
    line = format_row(row, 15.0)
    assert "0.250 (1 failed)" in line and "| 7.5 |" in line
    assert line.count("|") == HEADER.splitlines()[0].count("|")


def test_the_compiled_engine_has_settings_of_its_own(
    scenario: Scenario, data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenario = scenario.with_changes({"simulation.engine": "compiled"})
    scenario.simulation.duration, scenario.simulation.steady_from = 0.2, 0.1
    assert default_setting(scenario).apply(scenario).compiled.max_step == pytest.approx(
        scenario.compiled.max_step
    )
    coarse = CompiledSetting(1.0, 4.0, 0.05)
    monkeypatch.setattr(work_precision, "compiled_settings_to_compare", lambda: [coarse])
    rows = list(measure(scenario, [load_gait(data / "gait_b.json", scenario)]))
    assert [row.setting for row in rows] == [
        CONVERGED_COMPILED,
        default_setting(scenario),
        coarse,
    ]
    evaluations = [row.runs[0].derivative_evaluations for row in rows]
    assert evaluations == sorted(evaluations, reverse=True)
    assert format_row(rows[2], 0.2).startswith("| ros2 | 1 mm/s | 4 ms | look-ahead 0.05 ms |")
