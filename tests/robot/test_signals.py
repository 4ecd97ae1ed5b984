"""The precomputed signals: the thesis's listing, the converged network, and the CSV file."""

import numpy as np
import pytest

from tetra_drake.robot.gait import Gait, load_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.signals import raw_output, save_signals, signal_samples
from tetra_drake.scenario.units import shown_in


@pytest.fixture(params=["gait_a", "gait_b", "single_oscillators"])
def listing(request, scenario, data) -> tuple[Gait, np.ndarray, np.ndarray]:
    """A gait, and of its output by the listing the numbers of some steps and their rows."""
    table = np.loadtxt(data / f"cpg_{request.param}.csv", delimiter=",", skiprows=1)
    steps = np.round(table[:, 0] / 0.5e-3).astype(int)
    return load_gait(data / f"{request.param}.json", scenario), steps, table[:, 1:]


@pytest.fixture
def gait(scenario, data) -> Gait:
    return load_gait(data / "gait_b.json", scenario)


def test_stepped_as_the_listing_steps_it_gives_the_listings_output(robot, listing):
    gait, steps, reference = listing
    output = raw_output(robot, gait)
    assert output.shape == (30_000, 4)
    np.testing.assert_allclose(output[steps], reference, rtol=0, atol=1e-9)


def test_the_converged_network_stays_within_the_listings_own_error(scenario, listing):
    # Euler's error reaches 1.4e-2 by 15 s on gait_a. The listing stamps a state one step early.
    gait, steps, reference = listing
    scenario = scenario.with_changes({"cpg.signals": "live"})
    error = np.abs(raw_output(Robot.of(scenario), gait)[steps + 1] - reference).max(axis=1)
    assert error[steps * 0.5e-3 <= 3.0].max() < 2e-3
    assert error.max() < 2e-2


def test_the_csv_holds_what_the_cables_are_fed(robot, gait, tmp_path):
    save_signals(tmp_path / "lbf.csv", robot, gait)
    lines = (tmp_path / "lbf.csv").read_text().splitlines()
    head = [line for line in lines if line.startswith("#")]
    assert head[2] == "# signal_1: T1-T2 outer bottom_left + T1-T2 outer bottom_right"
    assert lines[len(head)].split(",") == ["time_s", *(f"signal_{i}" for i in (1, 2, 3, 4))]
    table = np.loadtxt(lines[len(head) + 1 :], delimiter=",")
    assert table[0, 0] == 0.0 and table[-1, 0] == 15.0 and len(table) == 30_001
    started = table[:, 0] >= 1.25
    fed = signal_samples(robot, gait)[: len(table)] / 4.4482216152605
    assert not table[~started, 1:].any()
    np.testing.assert_allclose(table[started, 1:], fed[started], atol=1e-10)


def test_the_csv_has_the_unit_and_the_rate_that_are_asked_for(robot, gait, tmp_path):
    save_signals(tmp_path / "lbf.csv", robot, gait)
    with shown_in("SI"):
        save_signals(tmp_path / "N.csv", robot, gait, rate=30.0)
    lbf, newton = (
        np.loadtxt(tmp_path / name, delimiter=",", skiprows=7) for name in ("lbf.csv", "N.csv")
    )
    assert "force in N " in (tmp_path / "N.csv").read_text().splitlines()[1]
    np.testing.assert_allclose(newton[:, 0], np.arange(451) / 30.0, rtol=1e-11)
    fed = np.column_stack([np.interp(newton[:, 0], lbf[:, 0], column) for column in lbf.T[1:]])
    np.testing.assert_allclose(newton[:, 1:], 4.4482216152605 * fed, atol=1e-9)
    assert fed.any()


@pytest.mark.parametrize("rate", [0.0, -1.0, 2001.0, float("nan"), float("inf")])
def test_a_rate_beyond_the_signals_own_is_refused(robot, gait, rate, tmp_path, refused):
    with refused("rate", "", "Hz"):
        save_signals(tmp_path / "a.csv", robot, gait, rate=rate)
    assert not list(tmp_path.iterdir())
