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

from tetra_drake.cli import main
from tetra_drake.robot.gait import Gait, gait_from_json, random_gait, save_gait
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


def assert_refused_in_one_line(captured, *fragments: str) -> None:
    assert captured.out == ""
    assert captured.err.endswith("\n")
    lines = captured.err.splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("tetra-drake: ")
    for fragment in fragments:
        assert fragment in lines[0]


# Bad input: one line on stderr, exit status 2, nothing written


BAD_SCENARIOS = {
    "key.yaml": "robot.tetrahedron: unknown key; did you mean 'tetrahedra'?",
    "unit.yaml": "robot.spacing: found '3 lbf', expected a quantity that converts to m",
    "nan.yaml": "fitness.drift: found nan, expected a finite number",
    "base.yaml": "base: 'thesies': no such scenario file",
    "broken.yaml": "is not YAML",
    "missing.yaml": "no such scenario file",
    "folder": "is a directory, expected a scenario file",
}


@pytest.mark.parametrize("command", ["simulate", "cpg", "diagram"])
@pytest.mark.parametrize(("file", "problem"), BAD_SCENARIOS.items(), ids=BAD_SCENARIOS.keys())
def test_a_bad_scenario_is_refused(command, file, problem, inputs, work, capsys):
    source = str(inputs / file)
    assert main([command, "--scenario", source, *out_of(command)]) == 2
    assert_refused_in_one_line(capsys.readouterr(), source, problem)
    assert os.listdir(work) == []


BAD_GAITS = {
    "23.json": "weights: found 23 numbers, expected 24 numbers for 4 oscillators",
    "nan.json": "weights[0]: found nan, expected a finite number",
    "negative.json": "tau_a_s: found -0.3, expected more than 0",
    "key.json": "tau: unknown key, expected one of name, schema, tau_a_s, tau_b_s, weights",
    "missing.json": "no such gait file",
    "folder": "is a directory, expected a gait file",
    "short.yaml": "is not JSON",
}


@pytest.mark.parametrize("command", ["simulate", "cpg"])
@pytest.mark.parametrize(("file", "problem"), BAD_GAITS.items(), ids=BAD_GAITS.keys())
def test_a_bad_gait_is_refused(command, file, problem, inputs, work, capsys):
    source = str(inputs / file)
    assert main([command, "--gait", source, *out_of(command)]) == 2
    assert_refused_in_one_line(capsys.readouterr(), source, problem)
    assert os.listdir(work) == []


def test_a_gait_for_another_robot_is_refused(inputs, work, capsys):
    gait = str(inputs / "good.json")
    assert main(["simulate", "--scenario", str(inputs / "six.yaml"), "--gait", gait]) == 2
    # 2 n (n - 1) = 40 weights for the 5 oscillators of 6 tetrahedra.
    assert_refused_in_one_line(
        capsys.readouterr(), gait, "found 24 numbers, expected 40 numbers for 5 oscillators"
    )
    assert os.listdir(work) == []


def test_simulate_does_not_write_into_a_file(inputs, work, capsys):
    (work / "out").write_text("old")
    arguments = ["--scenario", str(inputs / "short.yaml"), "--out", "out"]
    assert main(["simulate", *arguments]) == 2
    assert_refused_in_one_line(capsys.readouterr(), "out: is a file, expected a folder")
    assert (work / "out").read_text() == "old"


@pytest.mark.parametrize("command", ["cpg", "diagram"])
def test_a_folder_is_not_a_file_to_write(command, inputs, work, capsys):
    out = work / out_of(command)[1]
    out.mkdir()
    assert main([command, "--scenario", str(inputs / "short.yaml"), "--out", str(out)]) == 2
    assert_refused_in_one_line(
        capsys.readouterr(), f"{out}: is a directory, expected a file to write"
    )
    assert list(work.rglob("*")) == [out]


@pytest.mark.parametrize("command", ["cpg", "diagram"])
def test_a_path_below_a_file_is_not_a_file_to_write(command, inputs, work, capsys):
    (work / "file").write_text("old")
    out = str(work / "file" / f"out.{'csv' if command == 'cpg' else 'dot'}")
    assert main([command, "--scenario", str(inputs / "short.yaml"), "--out", out]) == 2
    assert_refused_in_one_line(capsys.readouterr(), out, "cannot be written")
    assert (work / "file").read_text() == "old"
    assert os.listdir(work) == ["file"]


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        ([], "COMMAND"),
        (["walk"], "invalid choice: 'walk'"),
        (["simulate", "--seed", "1", "--gait", "good.json"], "not allowed with argument"),
        (["simulate", "--seed", "-1"], "--seed: found '-1', expected an integer, 0 or more"),
        (["simulate", "--seed", "one"], "argument --seed: "),
        (["simulate", "--fast"], "unrecognized arguments: --fast"),
        (["cpg", "--seed", "1"], "required: --out"),
        (["diagram"], "required: --out"),
    ],
    ids=["none", "command", "gait and seed", "negative seed", "word", "option", "cpg", "diagram"],
)
def test_options_that_make_no_sense_are_refused(arguments, problem, work, capsys):
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    assert caught.value.code == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("usage: tetra-drake")
    assert problem in captured.err.splitlines()[-1]
    assert os.listdir(work) == []


@pytest.mark.parametrize(
    ("arguments", "status", "problem"),
    [
        (["simulate", "--gait", "missing.json"], 2, "missing.json: no such gait file"),
        (["simulate", "--scenario", "key.yaml"], 2, "key.yaml: robot.tetrahedron: unknown key"),
    ],
    ids=["missing gait", "unknown key"],
)
def test_the_process_ends_with_the_status_and_no_traceback(
    arguments, status, problem, inputs, tmp_path
):
    command, option, file = arguments
    line = [command, option, str(inputs / file), "--out", str(tmp_path / "out")]
    process = subprocess.run(
        [sys.executable, "-m", "tetra_drake.cli", *line],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert process.returncode == status
    assert process.stdout == ""
    assert "Traceback" not in process.stderr
    assert len(process.stderr.splitlines()) == 1
    assert process.stderr.startswith("tetra-drake: ")
    assert problem in process.stderr
    assert os.listdir(tmp_path) == []


def test_a_simulation_that_fails_says_when_and_why_with_status_1(inputs, work, capsys):
    assert main(["simulate", "--scenario", str(inputs / "poor.yaml")]) == 1
    assert_refused_in_one_line(capsys.readouterr(), "simulation failed at t = ", "100")
    assert os.listdir(work) == []


# Help


def test_help_names_every_command(capsys):
    with pytest.raises(SystemExit) as caught:
        main(["--help"])
    assert caught.value.code == 0
    text = capsys.readouterr().out
    for command in ("simulate", "evolve", "replay", "cpg", "diagram"):
        assert command in text


@pytest.mark.parametrize("command", ["simulate", "replay", "cpg", "diagram"])
def test_every_command_explains_its_options(command, capsys):
    with pytest.raises(SystemExit) as caught:
        main([command, "--help"])
    assert caught.value.code == 0
    text = capsys.readouterr().out
    assert "--out" in text
    assert "a shipped scenario (" in text and "thesis" in text


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


def test_the_result_holds_its_gait(result, gait_3, scenario):
    assert gait_from_json(result["gait"], source="result.json", scenario=scenario) == gait_3


def test_fitness_follows_from_the_result(result):
    # Eq. 10 with phi = (1, -10, 0, -1).
    expected = result["steady_distance_in"] - 10 * result["twist_in"] - result["lateral_drift_in"]
    assert result["fitness"] == pytest.approx(expected, abs=1e-12)


def test_the_trajectory_has_named_dimensions_and_units(trajectory):
    assert {"time", "tetrahedron", "node", "cable", "contact", "axis"} <= set(trajectory.dims)
    sizes = {name: trajectory.sizes[name] for name in ("tetrahedron", "node", "cable", "contact")}
    assert sizes == {"tetrahedron": 5, "node": 4, "cable": 24, "contact": 11}
    for variable in (*trajectory.data_vars.values(), trajectory.time):
        assert variable.attrs["units"]
        assert np.isfinite(variable).all()


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


def read_csv(path: Path | str) -> tuple[list[str], np.ndarray]:
    with open(path) as file:
        return file.readline().strip().split(","), np.loadtxt(file, delimiter=",", ndmin=2)


@pytest.fixture
def run_cpg(work):
    """Runs cpg with options; returns the header and the rows of its file."""

    def run(*options: object) -> tuple[list[str], np.ndarray]:
        assert main(["cpg", *map(str, options), "--out", "signals.csv"]) == 0
        assert os.listdir(work) == ["signals.csv"]
        return read_csv(work / "signals.csv")

    return run


def test_cpg_writes_a_row_for_each_listing_step(run_cpg, inputs):
    header, rows = run_cpg("--scenario", inputs / "short.yaml", "--seed", 1)
    assert header == ["time_s", "signal_1", "signal_2", "signal_3", "signal_4"]
    assert rows[:, 0] == pytest.approx(np.arange(601) * 0.5e-3, abs=1e-12)


def test_cpg_writes_a_signal_for_each_junction(run_cpg, inputs):
    header, rows = run_cpg("--scenario", inputs / "three.yaml")
    assert header == ["time_s", "signal_1", "signal_2"]
    assert rows.shape[1] == 3


@pytest.mark.parametrize("options", [(), ("--listing",)], ids=["error control", "listing"])
def test_cpg_applies_gain_and_start_up_unless_raw(run_cpg, inputs, options):
    options = ("--scenario", inputs / "early.yaml", "--seed", 1, *options)
    _, signals = run_cpg(*options)
    _, raw = run_cpg(*options, "--raw")
    time = raw[:, 0]
    assert np.array_equal(signals[:, 0], time)
    assert np.all(signals[time < 0.0999, 1:] == 0)
    assert np.abs(raw[1:200, 1:]).min() > 0
    late = time > 0.1001
    assert signals[late, 1:] == pytest.approx(3 * raw[late, 1:], rel=1e-10)


@pytest.mark.parametrize("gait", ["gait_a", "gait_b", "single_oscillators"])
def test_cpg_listing_reproduces_the_thesis_listing(run_cpg, data, gait):
    header, reference = read_csv(data / f"cpg_{gait}.csv")
    own_header, rows = run_cpg("--gait", data / f"{gait}.json", "--listing", "--raw")
    assert own_header == header
    # Both are stamped (i - 1) * 0.5 ms after i steps; the reference holds every 20th.
    assert rows[19::20, 0] == pytest.approx(reference[:, 0], abs=1e-12)
    assert rows[19::20, 1:] == pytest.approx(reference[:, 1:], abs=1e-9)


@pytest.mark.parametrize("gait", ["gait_a", "gait_b", "single_oscillators"])
def test_cpg_stays_within_the_listings_own_error_of_it(run_cpg, data, gait):
    _, reference = read_csv(data / f"cpg_{gait}.csv")
    _, rows = run_cpg("--gait", data / f"{gait}.json", "--raw")
    # The reference's row i holds the state at t = 20 (i + 1) steps, whatever its stamp says.
    state_time = reference[:, 0] + 0.5e-3
    own = rows[20::20]
    assert own[:, 0] == pytest.approx(state_time, abs=1e-12)
    error = np.abs(own[:, 1:] - reference[:, 1:]).max(axis=1)
    assert error[state_time <= 3].max() < 2e-3
    assert error.max() < 2e-2


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
    assert_refused_in_one_line(capsys.readouterr(), "robot.docx")
    assert os.listdir(work) == []


def test_a_result_folder_below_a_file_is_refused_before_simulating(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert main(["simulate", "--out", str(tmp_path / "file" / "sub")]) == 2
    captured = capsys.readouterr()
    assert captured.out == "", "nothing was simulated"
    assert "is a file, expected a folder to write to" in captured.err


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
        assert_refused_in_one_line(capsys.readouterr(), source)
        assert os.listdir(work) == []


@pytest.mark.parametrize("out", ["folder", "file/replay.html"])
def test_replay_refuses_a_place_it_cannot_write_to(simulated, out, work, capsys):
    (work / "folder").mkdir()
    (work / "file").write_text("old")
    assert main(["replay", str(simulated[0]), "--out", out]) == 2
    assert_refused_in_one_line(capsys.readouterr(), out.split("/")[0], "is a ")
    assert sorted(os.listdir(work)) == ["file", "folder"]
    assert os.listdir(work / "folder") == []
    assert (work / "file").read_text() == "old"
