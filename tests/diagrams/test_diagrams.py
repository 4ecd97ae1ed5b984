"""The example scripts in diagrams/: the pictures they write and the numbers they print."""

from __future__ import annotations

import dataclasses
import importlib.util
import shutil
from pathlib import Path
from types import ModuleType

import pytest

from tetra_drake import thesis
from tetra_drake.engines.simulate import simulate
from tetra_drake.robot.gait import seeded_gait
from tetra_drake.scenario.schema import Scenario

DIAGRAMS = Path(__file__).parents[2] / "diagrams"


def load_script(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, DIAGRAMS / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


robot = load_script("robot")

FIGURES = {
    "single_oscillator": {"figure_09.svg", "figure_10.svg"},
    "settling_node": {"figure_05.svg"},
    "sliding_tetrahedron": {"figure_06.svg"},
}
"""The scripts that take about a second, and the figures they write."""

needs_dot = pytest.mark.skipif(shutil.which("dot") is None, reason="Graphviz is not installed")


@needs_dot
@pytest.mark.parametrize("name", FIGURES)
def test_script_writes_its_pictures_and_prints_the_thesis_numbers(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert load_script(name).main(["--out", str(tmp_path)]) == 0
    written = {path.name: path.stat().st_size for path in tmp_path.iterdir()}
    assert set(written) == {f"{name}.svg", *FIGURES[name]}
    assert all(1_000 < size < 150_000 for size in written.values())
    assert "thesis" in capsys.readouterr().out


@needs_dot
@pytest.mark.parametrize("name", FIGURES)
def test_script_refuses_a_file_for_a_folder(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "file"
    file.write_text("")
    with pytest.raises(SystemExit) as ended:
        load_script(name).main(["--out", str(file)])
    assert ended.value.code == 2
    assert "cannot be written" in capsys.readouterr().err


@needs_dot
def test_robot_writes_its_pictures(
    scenario: Scenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenario = scenario.with_changes({"simulation.duration": 2.0, "simulation.steady_from": 1.0})
    monkeypatch.setattr(robot, "load_scenario", lambda name: scenario)
    assert robot.main(["--out", str(tmp_path)]) == 0
    written = {path.name for path in tmp_path.iterdir()}
    assert written == {"robot.svg", "figure_14.svg", "figure_19.svg"}


def test_robot_reports_distance_and_forces(scenario: Scenario) -> None:
    scenario = scenario.with_changes({"simulation.duration": 2.0, "simulation.steady_from": 1.0})
    gait = dataclasses.replace(seeded_gait(scenario), name="short walk")
    result = simulate(scenario=scenario, gait=gait, record=True)
    report = robot.report(gait, result)
    assert f"short walk: {result.metrics.distance_in:.2f} in in 2 s" in report
    assert str(thesis.BEST_INITIAL_DISTANCE_IN) in report


def test_robot_refuses_a_missing_gait_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        robot.main(["--gait", str(tmp_path / "none.json"), "--out", str(tmp_path)])
    assert ended.value.code == 2
    assert capsys.readouterr().err.endswith("none.json: no such gait file\n")
    assert list(tmp_path.iterdir()) == []
