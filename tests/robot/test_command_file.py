"""The file of a command: it reads back as written, and bad ones are refused."""

import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from helpers.actuations import FORCE, MOTOR, WINCH

from tetra_drake.robot.command import Command
from tetra_drake.robot.command_file import command_text, load_command
from tetra_drake.robot.robot import Robot


@pytest.fixture
def load(scenario, tmp_path, monkeypatch):
    """Reads the content of a file, c.csv."""
    monkeypatch.chdir(tmp_path)

    def load_text(text: str) -> Command:
        Path("c.csv").write_text(text)
        return load_command("c.csv", scenario)

    return load_text


QUANTITIES = [("force_N", 1.0, FORCE, 30.0), ("free_length_mm", 1e-3, WINCH, 100.0)]
QUANTITIES += [("tension_N", 1.0, MOTOR, 2000.0)]


@pytest.mark.parametrize(("quantity", "unit", "actuation", "rate"), QUANTITIES)
def test_a_command_reads_back_as_written(scenario, quantity, unit, actuation, rate, tmp_path):
    driven = scenario.with_changes(actuation)
    robot = Robot.of(driven)
    samples = np.random.default_rng(0).uniform(-1.0, 1.0, (40, 8))
    text = command_text(robot, Command("random", 1.0 / rate, samples))
    assert text.startswith(f"time_s,T1-T2 outer bottom_left {quantity},")
    assert f"\n0.000000,{samples[0, 0] / unit:.6f}," in text
    (tmp_path / "command.csv").write_text(text)
    loaded = load_command(tmp_path / "command.csv", driven)
    assert loaded.name == "command.csv"
    assert loaded.period == pytest.approx(1.0 / rate, rel=1e-5)
    np.testing.assert_allclose(loaded.samples, samples, atol=0.5e-6)  # six decimals


def test_columns_may_stand_in_any_order(robot, load):
    samples = np.arange(24.0).reshape(3, 8)
    rows = command_text(robot, Command("any", 0.01, samples)).splitlines()
    turned = "\n".join(",".join(row.split(",")[::-1]) for row in rows)
    assert np.array_equal(load(turned).samples, samples)


BAD = yaml.safe_load(Path(__file__).with_name("bad_commands.yaml").read_text("utf-8"))


@pytest.mark.parametrize(("old", "new", "key", "problem"), BAD)
def test_a_bad_file_is_refused(robot, old, new, key, problem, load, refused):
    text = command_text(robot, Command("half", 0.01, np.full((5, 8), 0.5)))
    changed = re.sub(old, new, text, count=1, flags=re.DOTALL)
    assert changed != text
    with refused("c.csv", key, problem):
        load(changed)


@pytest.mark.parametrize("late", [0.045, -0.045])
def test_times_may_be_uneven_by_a_twentieth(robot, late, load):
    text = command_text(robot, Command("uneven", 0.01, np.zeros((9, 8))))
    changed = text.replace("0.040000,", f"{0.04 + 0.01 * late:.6f},")
    assert load(changed).period == pytest.approx(0.01)


@pytest.mark.parametrize(("share", "is_enough"), [(0.955, True), (0.945, False), (0.0, False)])
def test_samples_are_hardly_denser_than_signals(robot, scenario, share, is_enough, load, refused):
    period = share * scenario.cpg.listing_step
    text = command_text(robot, Command("dense", period, np.zeros((5, 8))))
    rows = text.splitlines()
    exact = [f"{k * period:.9f},{row.partition(',')[2]}" for k, row in enumerate(rows[1:])]
    text = "\n".join([rows[0], *exact])
    if is_enough:
        assert load(text).period == pytest.approx(period)
    else:
        with refused("c.csv", "time_s", f"samples {period:g} s apart"):
            load(text)
