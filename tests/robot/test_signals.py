"""The signals computed beforehand: the thesis's listing and the converged network."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tetra_drake.robot.gait import load_gait
from tetra_drake.robot.signals import integrate_network, save_signals, signal_trajectory
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.units import POUND_FORCE


def read(path: Path) -> tuple[np.ndarray, np.ndarray]:
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    return table[:, 0], table[:, 1:]


@pytest.mark.parametrize("name", ["gait_a", "gait_b", "single_oscillators"])
def test_error_control_stays_near_the_listing(
    scenario: Scenario, data: Path, tmp_path: Path, name: str
) -> None:
    # The difference is the listing's own Euler error: up to 1.4e-2 by 15 s on gait_a. The
    # listing stamps a state one step early, so its rows belong to the following time here.
    gait = load_gait(data / f"{name}.json", oscillators=4)
    save_signals(tmp_path / "s.csv", scenario, gait, raw=True, listing=False)
    times, signals = read(tmp_path / "s.csv")
    reference_times, reference = read(data / f"cpg_{name}.csv")
    rows = np.round(reference_times / scenario.cpg.listing_step).astype(int) + 1
    np.testing.assert_allclose(times[rows - 1], reference_times, atol=1e-9)
    error = np.abs(signals[rows] - reference).max(axis=1)
    assert error[reference_times <= 3.0].max() < 2e-3
    assert error.max() < 2e-2


def test_the_csv_has_gain_and_start_up_applied_unless_raw(
    scenario: Scenario, data: Path, tmp_path: Path
) -> None:
    gait = load_gait(data / "gait_b.json", oscillators=4)
    save_signals(tmp_path / "raw.csv", scenario, gait, raw=True, listing=False)
    save_signals(tmp_path / "lbf.csv", scenario, gait, raw=False, listing=False)
    header = (tmp_path / "lbf.csv").read_text().splitlines()[0]
    assert header == "time_s,signal_1,signal_2,signal_3,signal_4"
    times, raw = read(tmp_path / "raw.csv")
    _, signals = read(tmp_path / "lbf.csv")
    assert times[0] == 0.0 and times[-1] == 15.0
    started = times >= 1.25
    np.testing.assert_array_equal(signals[~started], 0.0)
    np.testing.assert_allclose(signals[started], 2.0 * raw[started], atol=1e-11)


@pytest.mark.parametrize("signals", ["recorded", "listing"])
def test_the_trajectory_is_in_newtons_and_covers_the_whole_time(
    scenario: Scenario, data: Path, signals: str
) -> None:
    scenario.cpg.signals = signals
    gait = load_gait(data / "gait_b.json", oscillators=4)
    trajectory = signal_trajectory(scenario.cpg, gait, oscillators=4, duration=15.0)
    assert trajectory.start_time() == 0.0 and trajectory.end_time() == 15.0
    # Eq. 9 with a gain of 2 lbf: about a pound peak to peak or more, never beyond 2 lbf.
    values = trajectory.vector_values(np.linspace(2.0, 15.0, 500))
    assert 0.5 * POUND_FORCE < np.ptp(values) < 2.0 * POUND_FORCE


def test_the_recording_loses_nothing_of_the_network(scenario: Scenario, data: Path) -> None:
    # By Eq. 7 curvature is of the order of the signal over tau_A^2, 1 lbf / (0.1 s)^2 at most
    # here: between knots 1 ms apart the signal leaves its chord by 100 * 1e-6 / 8 = 1.3e-5 lbf.
    # Kinks have knots of their own; without, they would add 1e-3 lbf.
    scenario.cpg.signals = "recorded"
    gait = load_gait(data / "gait_b.json", oscillators=4)
    recording = signal_trajectory(scenario.cpg, gait, oscillators=4, duration=4.0)
    states = integrate_network(scenario.cpg, gait, oscillators=4, duration=4.0)
    times = np.sort(np.random.default_rng(3).uniform(0.0, 4.0, 20_000))
    y = np.maximum(0.0, states.vector_values(times)[:8])
    exact = scenario.cpg.gain * (y[0::2] - y[1::2])
    error = np.abs(recording.vector_values(times) - exact).max()
    assert error / POUND_FORCE < 2e-5


def test_without_weights_all_oscillators_give_the_same_signal(
    scenario: Scenario, data: Path
) -> None:
    scenario.cpg.signals = "recorded"
    gait = load_gait(data / "single_oscillators.json", oscillators=4)
    trajectory = signal_trajectory(scenario.cpg, gait, oscillators=4, duration=5.0)
    values = trajectory.vector_values(np.linspace(0.0, 5.0, 100))
    np.testing.assert_allclose(values, np.broadcast_to(values[0], values.shape), atol=1e-12)
