"""A gait as a folder for a prototype: what is in it, and that a robot walks by it."""

from pathlib import Path

import numpy as np
import pandas
import pytest
from helpers.actuations import ACTUATIONS, MOTOR

from tetra_drake.cli import main
from tetra_drake.engines.simulate import simulate
from tetra_drake.lab.prototype.export import COMMAND, EXPECTED, LIMITS_FILE, README, export
from tetra_drake.laws.actuator import LimitedActuator, Winch
from tetra_drake.robot.command_file import load_command
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.load import SCENARIO, load_scenario

SHORT = {"simulation.duration": "3 s", "simulation.steady_from": "1 s", "cpg.start_up": "0.2 s"}
BRIEF = {"simulation.duration": "0.6 s", "simulation.steady_from": "0.3 s"}


@pytest.fixture(scope="module")
def short():
    return load_scenario("coulomb").with_changes(SHORT)


def test_the_folder_has_the_signals_of_the_gait_and_begins_where_the_robot_does(short, tmp_path):
    folder, gait = tmp_path / "lab", seeded_gait(short)
    export(short, gait, rate=100.0, out=folder)
    assert {p.name for p in folder.iterdir()} == {COMMAND, EXPECTED, LIMITS_FILE, SCENARIO, README}
    command = load_command(folder / COMMAND, load_scenario(folder / SCENARIO))
    signals = simulate(scenario=short, gait=gait, record=True).trajectory.signal
    of_cable = Robot.of(short).structure.cables["signal"][Robot.of(short).driven]
    np.testing.assert_allclose(command.samples, signals.values[:, of_cable], atol=1e-6)
    assert command.period == 0.01
    assert not command.samples[:20].any() and command.samples[21:].any(), "start-up until 0.2 s"
    limits = pandas.read_csv(folder / LIMITS_FILE)
    assert limits[["limit_of_force_N", "time_at_a_limit_percent"]].isna().all(axis=None)
    expected = pandas.read_csv(folder / EXPECTED)
    assert len(expected) == 3 * 100 + 1
    # T1's base edge of 6 in lies along y.
    edge = expected["T1 bottom_left y_mm"] - expected["T1 bottom_right y_mm"]
    assert edge[0] == pytest.approx(6 * 25.4, abs=1e-5)


@pytest.mark.parametrize("kind", ACTUATIONS.values(), ids=ACTUATIONS)
def test_the_loads_are_those_of_the_metrics_and_of_what_is_wound(short, kind, tmp_path):
    often = {"simulation.sample_period": "1 ms"}
    driven = short.with_changes({"actuation": kind} | often)
    export(driven, seeded_gait(short), rate=100.0, out=tmp_path / "lab")
    result = simulate(scenario=driven, gait=seeded_gait(short), record=True)
    metrics, loads = result.metrics, pandas.read_csv(tmp_path / "lab" / LIMITS_FILE)
    peaks = loads[["peak_force_N", "peak_speed_mm_per_s", "peak_power_W"]].max().tolist()
    speed = 1e3 * metrics.peak_actuator_speed
    expected = [metrics.peak_actuator_force, speed, metrics.peak_actuator_power]
    assert peaks == pytest.approx(expected, rel=1e-5)
    assert loads["mean_power_W"].mean() == pytest.approx(metrics.mean_actuator_power, rel=0.05)
    if isinstance(kind, LimitedActuator):
        # Half the greatest force at half the greatest speed: 5 N times 0.25 m/s.
        assert loads["limit_of_power_W"].max() == 1.25
    if not kind.lacking:
        limited = 100.0 * metrics.actuator_limited
        assert loads["time_at_a_limit_percent"].mean() == pytest.approx(limited, rel=0.05)
    what = "free_length" if isinstance(kind, Winch) else "length"
    wound = 1e3 * result.trajectory[what].isel(cable=result.robot.driven)
    assert loads["cable"].tolist() == wound.cable.values.tolist()
    np.testing.assert_allclose(loads["least_length_mm"], wound.min("time"), rtol=1e-5)
    np.testing.assert_allclose(loads["travel_mm"], np.ptp(wound.values, axis=0), rtol=1e-4)
    assert loads["travel_mm"].min() > 1.0


def test_a_weak_motor_is_told_to_be_too_weak(short, tmp_path):
    for force, verdict in (("10 N", "can play it"), ("2 N", "0.000 s (T1-T2 outer bottom_left)")):
        motor = short.with_changes(MOTOR).with_changes({"actuation.max_force": force})
        assert verdict in export(motor, seeded_gait(short), rate=100.0, out=tmp_path / force)


WALKS = {"feedback": SHORT, "motors": SHORT, "prism": BRIEF | {"policy": "!Linear {}"}}
"""Gaits, and a policy, that walk by readings, and by tensions; changes of shipped scenarios."""


@pytest.mark.parametrize("name", WALKS)
def test_a_robot_walks_by_the_file_as_it_walked_once(name, tmp_path):
    scenario = load_scenario(name).with_changes(WALKS[name] | {"engine": "!Compiled"})
    gait = seeded_gait(scenario, 1)
    verdict = export(scenario, gait, rate=100.0, out=tmp_path / "lab")
    assert ("closed loop" in verdict) == (name != "motors")
    command = load_command(tmp_path / "lab" / COMMAND, scenario)
    played = simulate(scenario=scenario, command=command, record=True).trajectory.p_WN.values
    walked = simulate(scenario=scenario, gait=gait, record=True).trajectory.p_WN.values
    assert np.abs(played - walked).max() < 0.08 * np.ptp(walked, axis=0).max()


def test_a_command_is_played_on_the_scenario_beside_it(short, tmp_path, monkeypatch, capsys):
    def played(out, *options):
        assert main(["simulate", "--command", "lab/command.csv", "--out", out, *options]) == 0
        return load_scenario(tmp_path / out / SCENARIO)

    monkeypatch.chdir(tmp_path)
    brief = short.with_changes(BRIEF)
    export(brief, seeded_gait(brief), rate=50.0, out="lab")
    beside = load_scenario("lab/scenario.yaml")
    assert played("beside") == beside
    assert capsys.readouterr().err == ""
    Path("other.yaml").write_text("base: lab/scenario.yaml\nname: other\n")
    assert played("given", "--scenario", "other.yaml").name == "other"
    (line,) = capsys.readouterr().err.splitlines()
    assert all(word in line for word in ("lab/command.csv", "other", "lab/scenario.yaml"))
    Path("lab/scenario.yaml").unlink()
    assert played("alone", "--engine", "compiled").name == "thesis"
