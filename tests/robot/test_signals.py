"""The precomputed signals: the thesis's listing, the converged network, and the CSV file."""

import numpy as np
import pytest

from tetra_drake.robot.gait import Gait
from tetra_drake.robot.gait_file import load_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.signals import save_signals, signal_samples
from tetra_drake.settings.units import shown_in


@pytest.fixture(params=["gait_a", "gait_b", "single_oscillators"])
def listing(request, scenario, data) -> tuple[Gait, np.ndarray, np.ndarray]:
    """A gait, and of its output by the listing the numbers of some steps and their rows."""
    table = np.loadtxt(data / f"cpg_{request.param}.csv", delimiter=",", skiprows=1)
    steps = np.round(table[:, 0] / 0.5e-3).astype(int)
    return load_gait(data / f"{request.param}.json", scenario), steps, table[:, 1:]


@pytest.fixture
def gait(scenario, data) -> Gait:
    return load_gait(data / "gait_b.json", scenario)


def network_output(robot: Robot, gait: Gait) -> np.ndarray:
    """y_extensor - y_flexor (samples, m)."""
    return signal_samples(robot, gait) / robot.scenario.cpg.gain


def test_stepped_as_the_listing_steps_it_gives_the_listings_output(scenario, listing):
    gait, steps, reference = listing
    robot = Robot.of(scenario.with_changes({"cpg.signals": "listing"}))
    output = network_output(robot, gait)
    assert output.shape == (30_002, 4), "the last is held for two more samples"
    np.testing.assert_allclose(output[steps], reference, rtol=0, atol=1e-9)


def test_the_converged_network_stays_within_the_listings_own_error(scenario, listing):
    # Euler's error reaches 1.4e-2 by 15 s on gait_a. The listing stamps a state one step early.
    gait, steps, reference = listing
    error = np.abs(network_output(Robot.of(scenario), gait)[steps + 1] - reference).max(axis=1)
    assert error[steps * 0.5e-3 <= 3.0].max() < 2e-3
    assert error.max() < 2e-2


@pytest.mark.parametrize(
    ("system", "unit", "rate", "count"),
    [("in", 4.4482216152605, None, 30_001), ("SI", 1.0, 30.0, 451)],
)
def test_the_csv_holds_what_the_cables_are_fed(robot, gait, tmp_path, system, unit, rate, count):
    with shown_in(system):
        save_signals(tmp_path / "signals.csv", robot, gait, rate=rate)
    _, forces, first, *lines = (tmp_path / "signals.csv").read_text().splitlines()
    assert f"force in {'N' if unit == 1.0 else 'lbf'} " in forces
    assert first == "# signal_1: T1-T2 outer bottom_left + T1-T2 outer bottom_right"
    assert lines[3].split(",") == ["time_s", *(f"signal_{i}" for i in (1, 2, 3, 4))]
    times, *signals = np.loadtxt(lines[4:], delimiter=",").T
    np.testing.assert_allclose(times, np.linspace(0.0, 15.0, count), rtol=1e-11)
    steps = 5e-4 * np.arange(30_001)
    fed = signal_samples(robot, gait)[:30_001] * (steps >= 1.25)[:, np.newaxis] / unit
    expected = [np.interp(times, steps, column) for column in fed.T]
    np.testing.assert_allclose(signals, expected, atol=1e-9)
