"""The command that measures both engines, and MuJoCo beside them."""

from __future__ import annotations

import json
import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from tetra_drake.benchmark import measure
from tetra_drake.benchmark.errors import ErrorStatistics, well_conditioned
from tetra_drake.benchmark.measure import Method, measure_step_costs
from tetra_drake.benchmark.mujoco_steps import Choice, choose_steps
from tetra_drake.cli import main
from tetra_drake.engines import mujoco as mujoco_robot
from tetra_drake.robot.gait import Gait, save_gait, seeded_gait
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.schema import Scenario

SHORT = """\
base: thesis
name: short
simulation: {duration: 0.3 s, steady_from: 0.1 s}
cpg: {start_up: 0.1 s}
"""
ALL = np.ones(3, dtype=bool)
NAN = float("nan")


# Statistics


def test_errors_are_absolute_and_of_gaits_that_count_and_have_not_failed() -> None:
    errors = np.array([-0.3, 0.1, NAN, 5.0, 0.2])
    counted = np.array([True, True, True, False, True])
    assert ErrorStatistics.of(errors, counted) == ErrorStatistics(median_in=0.2, worst_in=0.3)


def test_without_gaits_there_are_no_errors() -> None:
    none = ErrorStatistics.of(np.array([1.0, 2.0]), np.zeros(2, dtype=bool))
    assert np.isnan([none.median_in, none.worst_in]).all()


def test_a_gait_is_well_conditioned_if_two_converged_runs_agree_to_a_twentieth_of_an_inch() -> None:
    one, other = np.array([1.0, 1.0, NAN]), np.array([1.049, 1.051, 1.0])
    np.testing.assert_array_equal(well_conditioned(one, other), [True, False, False])


def fake_gaits(count: int) -> list[Gait]:
    return [Gait(name=str(i), weights=(), tau_a=0.3, tau_b=0.6) for i in range(count)]


def test_failed_gaits_count_as_failed_and_in_no_time() -> None:
    distances = {"0": 1.5, "1": NAN, "2": 3.0}
    exact = np.array([1.0, 2.0, 3.0])
    method = Method("x", "y", lambda gait: distances[gait.name], exact)
    for gait in fake_gaits(3):
        method.time(gait, 15.0)
    assert method.failed == 1
    assert method.simulated == 30.0
    assert method.real_time_factor == 30.0 / method.wall_time
    assert method.errors(ALL) == ErrorStatistics(median_in=0.25, worst_in=0.5)


def test_many_gaits_are_counted_per_core() -> None:
    method = Method("x", "y", lambda gait: float(gait.name), np.zeros(2), cores=2)
    with ThreadPoolExecutor(2) as executor:
        for gaits in (fake_gaits(2), fake_gaits(2)[::-1]):
            method.time_many(gaits, 15.0, executor)
    assert method.distances_in == [0.0, 1.0]
    assert method.simulated % (2 * 2 * 15.0) == 0.0
    assert method.real_time_factor == method.simulated / (2 * method.wall_time)


# MuJoCo's steps


def chosen(errors_by_step: dict[float, float]) -> list[Choice]:
    """What is chosen if gaits end so far (in) from where they should; NaN is unstable."""
    return choose_steps(
        "implicitfast",
        (1.0, 0.5, 0.25, 0.125),
        lambda step_ms: np.full(3, errors_by_step[step_ms]),
        exact_in=np.zeros(3),
        counted=ALL,
    )


def test_the_largest_stable_and_the_largest_converged_step_are_chosen() -> None:
    # A step beyond the converged one is not even tried.
    assert chosen({1.0: NAN, 0.5: -2.0, 0.25: 0.04}) == [
        Choice("implicitfast", 0.5, "largest stable"),
        Choice("implicitfast", 0.25, "largest converged"),
    ]


def test_one_step_may_be_both() -> None:
    assert chosen({1.0: 0.01}) == [Choice("implicitfast", 1.0, "largest stable, largest converged")]


def test_if_no_step_converges_the_nearest_is_chosen_and_called_that() -> None:
    assert chosen({1.0: 3.0, 0.5: 0.2, 0.25: 0.3, 0.125: 0.4}) == [
        Choice("implicitfast", 1.0, "largest stable"),
        Choice("implicitfast", 0.5, "nearest, not converged"),
    ]


def test_if_nothing_is_stable_nothing_is_chosen() -> None:
    assert chosen(dict.fromkeys((1.0, 0.5, 0.25, 0.125), NAN)) == []


# Cost of a step


def test_a_steps_cost_is_measured_for_any_number_of_tetrahedra(scenario: Scenario) -> None:
    scenario.simulation.duration, scenario.simulation.steady_from = 0.2, 0.1
    costs = measure_step_costs(scenario, [2, 7])
    assert [cost.tetrahedra for cost in costs] == [2, 7]
    assert all(cost.steps > 0 and cost.microseconds > 0.0 for cost in costs)


def test_a_robot_that_fails_has_no_cost(scenario: Scenario) -> None:
    scenario.simulation.max_evaluations = 10
    (cost,) = measure_step_costs(scenario, [3])
    assert np.isnan(cost.microseconds)


# The command


@pytest.fixture
def work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working folder, and short.yaml beside it; only two sizes are measured."""
    (tmp_path / "short.yaml").write_text(SHORT)
    folder = tmp_path / "work"
    folder.mkdir()
    monkeypatch.chdir(folder)
    monkeypatch.setattr(measure, "SIZES", (5, 10))
    return folder


def table(text: str, heading: str) -> list[list[str]]:
    """The rows of the Markdown table whose first column has this heading."""
    lines = text.splitlines()
    first = next(i for i, line in enumerate(lines) if line.startswith(f"| {heading} |"))
    rows = []
    for line in lines[first + 2 :]:
        if not line.startswith("|"):
            break
        rows.append([cell.strip() for cell in line.strip("|").split("|")])
    return rows


def test_without_mujoco_the_command_measures_ours_and_says_how_to_install_it(
    work: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(mujoco_robot, "installed", lambda: False)
    save_gait(seeded_gait(load_scenario("thesis")), work / "walking.json")
    arguments = ["walking.json", "--scenario", "../short.yaml", "--json", "bench.json"]
    assert main(["bench", *arguments]) == 0
    captured = capsys.readouterr()
    assert captured.out.startswith("1 gait of 0.3 s on scenario short; ")
    assert 'MuJoCo: not installed: pip install "mujoco' in captured.out
    rows = table(captured.out, "what")
    assert [row[0] for row in rows] == [
        "Drake diagram, default",
        "Drake diagram",
        "compiled engine, one gait",
        "compiled engine, many gaits",
    ]
    for _, _, factor, median, worst, failed in rows:
        assert float(factor) > 0.0
        assert float(median) == float(worst) < 0.05
        assert failed == "0"
    assert [row[0] for row in table(captured.out, "tetrahedra")] == ["5", "10"]
    assert all(line.endswith(" ...") for line in captured.err.splitlines())

    found = json.loads((work / "bench.json").read_text())
    assert sorted(os.listdir(work)) == ["bench.json", "walking.json"]
    assert found["scenario"] == "short" and found["duration_s"] == 0.3
    assert {"drake", "numba", "numpy", "python", "tetra_drake"} == found["versions"].keys()
    assert found["processor"]["name"] and found["processor"]["cores"] >= 1
    assert found["compile"]["time_s"] >= 0.0
    assert found["gaits"] == [{"name": "random gait 80", "well_conditioned": True}]
    assert found["mujoco"] is None
    one, many = found["methods"][2:]
    assert one["distances_in"] == many["distances_in"]
    for method, row in zip(found["methods"], rows, strict=True):
        assert method["what"] == row[0]
        expected = method["simulated_s"] / (method["wall_time_s"] * method["cores"])
        assert method["real_time_factor_per_core"] == pytest.approx(expected)
        error = abs(method["distances_in"][0] - method["exact_in"][0])
        assert method["median_error_in"] == pytest.approx(error)
    assert [cost["tetrahedra"] for cost in found["step_costs"]] == [5, 10]


@pytest.mark.skipif(not mujoco_robot.installed(), reason=f"needs MuJoCo: {mujoco_robot.INSTALL}")
def test_with_mujoco_its_integrators_stand_in_the_same_table(
    work: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["--gaits", "2", "--scenario", "../short.yaml", "--json", "bench.json"]
    assert main(["bench", *arguments]) == 0
    text = capsys.readouterr().out
    rows = [row for row in table(text, "what") if row[0].startswith("MuJoCo ")]
    assert {row[0].split()[1] for row in rows} == {"Euler", "implicitfast", "discrete"}
    assert all("ms (" in row[1] and float(row[2]) > 0.0 and row[5] == "0" for row in rows)
    for row in rows:
        if "largest converged" in row[1]:
            assert float(row[3]) <= 0.05
    found = json.loads((work / "bench.json").read_text())
    assert "mujoco" in found["versions"]
    assert found["mujoco"]["friction"] == mujoco_robot.FRICTION
    assert len(found["gaits"]) == 2
    assert os.listdir(work) == ["bench.json"]


def test_gaits_that_fail_are_counted_and_leave_blanks(
    work: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(mujoco_robot, "installed", lambda: False)
    poor = SHORT.replace("{duration", "{max_evaluations: 10, duration")
    (work.parent / "poor.yaml").write_text(poor)
    arguments = ["--gaits", "2", "--scenario", "../poor.yaml", "--json", "bench.json"]
    assert main(["bench", *arguments]) == 0
    text = capsys.readouterr().out
    assert "in): 2 - random gait 0, random gait 1" in text
    for row in table(text, "what"):
        assert row[2:] == ["-", "-", "-", "2"]
    found = json.loads((work / "bench.json").read_text())
    assert found["methods"][0]["distances_in"] == [None, None]
    assert found["step_costs"][0]["microseconds"] is None


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (["missing.json"], "missing.json: no such gait file"),
        (["../three.json"], "weights: found 12 numbers, expected 24 numbers for 4 oscillators"),
        (["../three.json", "--gaits", "3"], "--gaits: not allowed with gait files"),
        (["--scenario", "none.yaml"], "no such scenario file"),
        (["--json", "../folder"], "is a directory, expected a file to write"),
        (["--json", "../short.yaml/x.json"], "cannot be written: its folder is a file"),
    ],
)
def test_bad_input_is_refused_before_anything_is_measured(
    arguments: list[str],
    problem: str,
    work: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.delattr(measure, "measure")
    four = load_scenario("thesis")
    four.robot.tetrahedra = 4
    save_gait(seeded_gait(four), work.parent / "three.json")
    (work.parent / "folder").mkdir()
    assert main(["bench", *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert len(captured.err.splitlines()) == 1 and problem in captured.err
    assert os.listdir(work) == []


def test_no_gaits_are_refused(work: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main(["bench", "--gaits", "0"])
    assert caught.value.code == 2
    assert "--gaits: found '0', expected an integer, 1 or more" in capsys.readouterr().err


def test_an_interrupted_measurement_leaves_no_file(
    work: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*args: object, **options: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(measure, "measure", interrupted)
    assert main(["bench", "--json", "bench.json"]) == 130
    assert os.listdir(work) == []
