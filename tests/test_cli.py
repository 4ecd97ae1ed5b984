"""The commands, as a person meets them."""

import contextlib
import io
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray

import tetra_drake
from tetra_drake.cli import main
from tetra_drake.robot.gait import Gait, load_gait, random_gait, save_gait
from tetra_drake.scenario.load import load_scenario

SHORT = """\
base: thesis
name: short
simulation: {duration: 0.3 s, steady_from: 0.1 s, sample_period: 70 ms}
"""
"""The sample period does not divide the duration."""

INCH = 0.0254


@pytest.fixture(scope="module")
def inputs(tmp_path_factory) -> Path:
    """A folder with one file of each kind, good and bad."""
    folder = tmp_path_factory.mktemp("inputs")
    weights = [1.5] * 24
    good = {"schema": 1, "name": "good", "weights": weights, "tau_a_s": 0.3}
    gaits = {
        "good.json": good,
        "23.json": good | {"weights": weights[:23]},
        "nan.json": good | {"weights": [float("nan"), *weights[1:]]},
        "negative.json": good | {"tau_a_s": -0.3},
        "key.json": good | {"tau": 0.3},
    }
    scenarios = {
        "short.yaml": SHORT,
        "key.yaml": "base: thesis\nrobot: {tetrahedron: 4}\n",
        "unit.yaml": "base: thesis\nrobot: {spacing: 3 lbf}\n",
        "nan.yaml": "base: thesis\nfitness: {drift: .nan}\n",
        "base.yaml": "base: thesies\n",
        "broken.yaml": "robot: [\n",
        "three.yaml": SHORT + "robot: {tetrahedra: 3}\n",
        "six.yaml": SHORT + "robot: {tetrahedra: 6}\n",
        "early.yaml": SHORT + "cpg: {start_up: 0.1 s, gain: 3 lbf}\n",
        "poor.yaml": SHORT.replace("{", "{max_evaluations: 100, "),
    }
    for name, content in gaits.items():
        (folder / name).write_text(json.dumps(content))
    for name, text in scenarios.items():
        (folder / name).write_text(text)
    (folder / "folder").mkdir()
    return folder


@pytest.fixture
def work(tmp_path, monkeypatch) -> Path:
    """An empty working folder, where a command without --out would write."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def out_of(command: str) -> list[str]:
    return ["--out", {"simulate": "out", "cpg": "out.csv", "diagram": "out.dot"}[command]]


def assert_refused(capsys, source: object, *values: str) -> None:
    """One line on stderr that names the source and holds the values, and nothing on stdout."""
    captured = capsys.readouterr()
    assert captured.out == ""
    (line,) = captured.err.splitlines()
    assert line.startswith(f"tetra-drake: {source}: ")
    assert all(value in line for value in values), line


BAD_SCENARIOS = {
    "key.yaml": ("robot.tetrahedron", "tetrahedra"),
    "unit.yaml": ("robot.spacing", "3 lbf"),
    "nan.yaml": ("fitness.drift", "nan"),
    "base.yaml": ("base", "thesies"),
    "broken.yaml": (),
    "missing.yaml": (),
    "folder": (),
}
"""Files with the key at fault, and what was found or is suggested."""


@pytest.mark.parametrize("command", ["simulate", "cpg", "diagram"])
@pytest.mark.parametrize(("file", "values"), BAD_SCENARIOS.items(), ids=BAD_SCENARIOS)
def test_a_bad_scenario_is_refused(command, file, values, inputs, work, capsys):
    source = str(inputs / file)
    assert main([command, "--scenario", source, *out_of(command)]) == 2
    assert_refused(capsys, source, *values)
    assert os.listdir(work) == []


BAD_GAITS = {
    "23.json": ("weights", "23", "24"),
    "nan.json": ("weights[0]", "nan"),
    "negative.json": ("tau_a_s", "-0.3"),
    "key.json": ("tau: ", "tau_b_s"),
    "missing.json": (),
    "folder": (),
    "short.yaml": (),
}


@pytest.mark.parametrize("command", ["simulate", "cpg"])
@pytest.mark.parametrize(("file", "values"), BAD_GAITS.items(), ids=BAD_GAITS)
def test_a_bad_gait_is_refused(command, file, values, inputs, work, capsys):
    source = str(inputs / file)
    assert main([command, "--gait", source, *out_of(command)]) == 2
    assert_refused(capsys, source, *values)
    assert os.listdir(work) == []


def test_a_gait_for_another_robot_is_refused(inputs, work, capsys):
    gait = str(inputs / "good.json")
    assert main(["simulate", "--scenario", str(inputs / "six.yaml"), "--gait", gait]) == 2
    # 2 n (n - 1) = 40 weights for the 5 oscillators of 6 tetrahedra.
    assert_refused(capsys, gait, "weights", "24", "40")
    assert os.listdir(work) == []


@pytest.mark.parametrize("command", ["simulate", "cpg", "diagram"])
@pytest.mark.parametrize("what", ["below a file", "the other kind"])
def test_a_path_that_cannot_be_written_is_refused(command, what, inputs, work, capsys):
    out = out_of(command)[1]
    if what == "below a file":
        (work / "file").write_text("old")
        out = f"file/{out}"
    elif command == "simulate":
        (work / out).write_text("old")
    else:
        (work / out).mkdir()
    before = sorted(work.rglob("*"))
    assert main([command, "--scenario", str(inputs / "short.yaml"), "--out", out]) == 2
    assert_refused(capsys, out)
    assert sorted(work.rglob("*")) == before


@pytest.mark.parametrize(
    ("arguments", "value"),
    [
        ([], "COMMAND"),
        (["walk"], "walk"),
        (["simulate", "--seed", "1", "--gait", "good.json"], "--gait"),
        (["simulate", "--seed", "-1"], "-1"),
        (["simulate", "--seed", "one"], "one"),
        (["simulate", "--fast"], "--fast"),
        (["cpg", "--rate", "0", "--out", "a.csv"], "--rate"),
        (["cpg", "--seed", "1"], "--out"),
    ],
)
def test_options_that_make_no_sense_are_refused(arguments, value, work, capsys):
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    assert caught.value.code == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("usage: tetra-drake")
    assert value in captured.err.splitlines()[-1]
    assert os.listdir(work) == []


def test_the_process_ends_with_the_status_and_no_traceback(inputs, tmp_path):
    gait = str(inputs / "missing.json")
    line = ["-m", "tetra_drake", "simulate", "--gait", gait, "--out", str(tmp_path / "out")]
    process = subprocess.run([sys.executable, *line], capture_output=True, text=True, timeout=60)
    assert (process.returncode, process.stdout) == (2, "")
    (message,) = process.stderr.splitlines()
    assert message.startswith(f"tetra-drake: {gait}: ")
    assert os.listdir(tmp_path) == []


def test_a_simulation_that_fails_says_when_and_why_with_status_1(inputs, work, capsys):
    assert main(["simulate", "--scenario", str(inputs / "poor.yaml")]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "t = 0.0" in line and "100" in line
    assert os.listdir(work) == []


# Help


COMMANDS = (
    *("simulate", "evolve", "reevaluate", "replay", "figures"),
    *("robustness", "benchmark", "cpg", "diagram"),
)


def printed(arguments, capsys) -> str:
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    assert caught.value.code == 0
    return capsys.readouterr().out


def test_help_names_every_command_and_each_explains_its_options(capsys):
    overview = printed(["--help"], capsys)
    for command in COMMANDS:
        assert command in overview
        assert "--help" in printed([command, "--help"], capsys)


def test_the_version_and_a_completion_script_are_printed(capsys):
    assert printed(["--version"], capsys).split() == ["tetra-drake", tetra_drake.__version__]
    script = printed(["--print-completion", "bash"], capsys)
    assert all(command in script for command in COMMANDS)


# simulate


@pytest.fixture(scope="module")
def simulated(inputs, tmp_path_factory) -> tuple[Path, str]:
    """The folder and the printed text of one short simulation."""
    out = tmp_path_factory.mktemp("simulated") / "made" / "when missing"
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        status = main(
            ["simulate", "--scenario", str(inputs / "short.yaml"), "--seed", "3", "--out", str(out)]
        )
    assert status == 0
    return out, printed.getvalue()


@pytest.fixture(scope="module")
def result(simulated) -> dict:
    return json.loads((simulated[0] / "result.json").read_text())


@pytest.fixture(scope="module")
def trajectory(simulated) -> xarray.Dataset:
    return xarray.load_dataset(simulated[0] / "trajectory.nc", engine="h5netcdf")


@pytest.fixture(scope="module")
def gait_3() -> Gait:
    return random_gait(load_scenario(), np.random.default_rng(3), name="random gait 3")


def test_simulate_writes_numbers_trajectory_and_replay(simulated):
    names = ["replay.html", "result.json", "scenario.yaml", "trajectory.nc"]
    assert sorted(os.listdir(simulated[0])) == names


def test_simulate_prints_how_far_the_robot_went_and_which_page_shows_it(simulated, result):
    folder, printed = simulated
    lines = printed.splitlines()
    distance = next(line.split() for line in lines if line.split()[0] == "distance")
    assert distance[1:] == [f"{result['distance_in']:.2f}".replace("-0.00", "0.00"), "in"]
    assert lines[-1].endswith(str(folder / "replay.html"))
    # The scenario is shorter than the thesis's, whose distances are not comparable.
    assert "14.34" not in printed


def test_the_result_holds_what_was_asked_for_and_done(result, scenario):
    assert (result["schema"], result["scenario"], result["duration_s"]) == (1, "short", 0.3)
    assert result["real_time_factor"] == pytest.approx(0.3 / result["wall_time_s"])
    assert result["integrator"]["scheme"] == scenario.simulation.scheme
    assert result["integrator"]["accuracy"] == scenario.simulation.accuracy
    assert 0 < result["integrator"]["steps"] < result["integrator"]["derivative_evaluations"]
    assert {"python", "drake", "numpy", "tetra_drake"} <= result["versions"].keys()
    for name, metres in result["metrics"].items():
        assert result[f"{name}_in"] == pytest.approx(metres / INCH)


def test_the_result_holds_its_gait(simulated, gait_3, scenario):
    assert load_gait(simulated[0] / "result.json", scenario, key="gait") == gait_3


def test_fitness_follows_from_the_result(result):
    # Eq. 10 with phi = (1, -10, 0, -1).
    expected = result["steady_distance_in"] - 10 * result["twist_in"] - result["lateral_drift_in"]
    assert result["fitness"] == pytest.approx(expected, abs=1e-12)


def test_the_trajectory_ends_where_the_result_says(trajectory, result):
    x1 = trajectory.p_WN.sel(tetrahedron="T1", node="bottom_left", axis="x") / INCH
    assert float(x1[-1] - x1[0]) == pytest.approx(result["distance_in"], abs=1e-12)


def test_a_gait_file_gives_the_numbers_of_the_seed_it_was_drawn_with(
    inputs, work, gait_3, result, capsys
):
    save_gait(gait_3, "gait.json")
    arguments = ["--scenario", str(inputs / "short.yaml"), "--gait", "gait.json"]
    assert main(["simulate", *arguments]) == 0
    assert capsys.readouterr().err == ""
    again = json.loads(Path("out/result.json").read_text())  # the default folder
    varying = {"wall_time_s", "real_time_factor"}
    assert {k: v for k, v in again.items() if k not in varying} == {
        k: v for k, v in result.items() if k not in varying
    }


# cpg


def test_cpg_writes_the_signals_that_its_options_ask_for(inputs, work):
    options = ["--scenario", str(inputs / "three.yaml"), "--seed", "1", "--signals", "recorded"]
    for more in ([], ["--unit", "N", "--rate", "100"], ["--raw"]):
        assert main(["cpg", *options, *more, "--out", f"{len(more)}.csv"]) == 0
    pounds, newtons, raw = (
        np.loadtxt(f"{name}.csv", delimiter=",", comments=("#", "t")) for name in (0, 4, 1)
    )
    assert pounds.shape == (601, 3) and newtons.shape == (31, 3)  # 0.3 s, two junctions
    np.testing.assert_allclose(newtons[:, 1:], pounds[::20, 1:] * 4.4482216152605, atol=1e-9)
    assert not pounds[:, 1:].any(), "zero before the start-up time"
    assert raw[1:, 1:].any()


# diagram


def test_diagram_writes_graphviz_source_that_names_the_subsystems(inputs, work):
    arguments = ["--scenario", str(inputs / "short.yaml"), "--out", "robot.dot"]
    assert main(["diagram", *arguments]) == 0
    assert os.listdir(work) == ["robot.dot"]
    text = (work / "robot.dot").read_text()
    assert text.startswith("digraph")
    for name in ("cpg", "start_up", "cables", "ground", "plant"):
        assert name in text


def test_diagram_refuses_a_kind_of_file_it_cannot_draw(inputs, work, capsys):
    arguments = ["--scenario", str(inputs / "short.yaml"), "--out", "robot.docx"]
    assert main(["diagram", *arguments]) == 2
    assert_refused(capsys, "robot.docx", ".docx")
    assert os.listdir(work) == []


# replay


def test_replay_makes_the_page_of_simulate_again_from_its_recording(simulated, work, capsys):
    assert main(["replay", str(simulated[0]), "--out", "again.html"]) == 0
    assert (work / "again.html").read_bytes() == (simulated[0] / "replay.html").read_bytes()
    assert capsys.readouterr().out.splitlines()[-1].endswith("again.html")


def test_replay_simulates_a_gait_file(inputs, simulated, work, gait_3):
    save_gait(gait_3, "gait.json")
    arguments = ["gait.json", "--scenario", str(inputs / "short.yaml"), "--out", "sub/gait.html"]
    assert main(["replay", *arguments]) == 0
    assert (work / "sub/gait.html").read_bytes() == (simulated[0] / "replay.html").read_bytes()


def test_replay_refuses_what_is_not_there_or_does_not_fit(inputs, work, capsys):
    six = ["--scenario", str(inputs / "six.yaml")]
    sources = ("missing", []), ("folder", []), ("23.json", []), ("good.json", six)
    for source, options in (*sources, ("short.yaml", [])):
        source = str(inputs / source)
        assert main(["replay", source, *options, "--out", "new/replay.html"]) == 2
        assert_refused(capsys, source)
        assert os.listdir(work) == []


@pytest.mark.parametrize("out", ["folder", "file/replay.html"])
def test_replay_refuses_a_place_it_cannot_write_to(simulated, out, work, capsys):
    (work / "folder").mkdir()
    (work / "file").write_text("old")
    assert main(["replay", str(simulated[0]), "--out", out]) == 2
    assert_refused(capsys, out.split("/")[0])
    assert sorted(os.listdir(work)) == ["file", "folder"]
    assert os.listdir(work / "folder") == []
    assert (work / "file").read_text() == "old"
