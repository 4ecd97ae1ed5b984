"""Values fitted to measurements: hidden constants come back, and what data do not tell is told."""

import functools
import json
import math
import re
import shutil
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pandas
import pytest
import yaml
from helpers.anchored import HUNG, scenario_of, supported_prism
from helpers.converged import shortly
from scipy.spatial.transform import Rotation

from tetra_drake.cli import main
from tetra_drake.engines.simulate import simulate
from tetra_drake.evolution.entries import json_line
from tetra_drake.formatting import silent
from tetra_drake.lab.fit import measurements
from tetra_drake.lab.fit.fit import fit
from tetra_drake.lab.fit.measurements import MotionCapture, Prediction, Rest
from tetra_drake.lab.fit.problem import FitProblem, Parameter
from tetra_drake.robot.command import Command
from tetra_drake.robot.command_file import command_text, load_command, table_text
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.load import load_scenario, save_scenario
from tetra_drake.scenario.scenario import Scenario

STIFFNESS, FREE_LENGTH = "robot.cables.line.stiffness", "robot.cables.line.free_length"
DAMPING, MASSES = "robot.cables.line.damping", "robot.masses.a, robot.masses.b"
ALONE = {STIFFNESS: (100.0, 400.0)}
BOUNDS = ALONE | {FREE_LENGTH: (0.3, 0.5)}
NOISE, PULLS = 2e-4, (0.0, 4.0, 8.0, 12.0)


@functools.cache
def hung() -> Scenario:
    return scenario_of(HUNG)


def pulled_down(stiffness: float = 210.0, free_length: float = 0.39) -> list[Rest]:
    """Heights of the bar's upper node under loads: the cable's stretch is the force over its
    stiffness."""
    cases, weight = [], Robot.of(hung()).weight
    for pull in PULLS:
        changes = {"robot.loads.a": ["0 N", "0 N", f"{-pull!r} N"]}
        height = {"a z": 1.0 - free_length - (weight + pull) / stiffness}
        cases.append(Rest(changes=changes, positions=height, position_uncertainty=NOISE))
    return cases


@pytest.fixture
def by_formula(monkeypatch):
    """Rest predicts the bar's heights as pulled_down() has them, without an equilibrium, and with a
    wave over the stiffness, 0 at 310 N/m: of this height and number."""
    weight, below, wave = Robot.of(hung()).weight, {"a z": 0.0, "b z": 0.2}, [0.0, 0.0]

    def height(line, pull):
        ripple = wave[0] * np.sin(wave[1] * (line.stiffness - 310.0))
        return 1.0 - line.free_length - (weight + pull) / line.stiffness + ripple

    def predict(self, scenarios):
        ((*_, load),) = self.changes.values()
        pull = -float(load.removesuffix(" N"))
        a = [height(each.robot.cables["line"], pull) for each in scenarios]
        places = np.array([below[label] for label in self.positions])
        return [Prediction(z - places) for z in a]

    monkeypatch.setattr(Rest, "predict", predict)
    return wave


def test_exact_measurements_give_the_constants_and_intervals_of_a_line(by_formula):
    found = fit(hung(), pulled_down(), BOUNDS)
    assert found.parameters["value"].to_list() == pytest.approx([210.0, 0.39], rel=1e-5)
    assert found.warnings == []
    # z = 1 - l0 - c f, with the compliance c = 1 / k: linear regression of z on f.
    forces = Robot.of(hung()).weight + np.array(PULLS)
    slope = NOISE / math.sqrt(((forces - forces.mean()) ** 2).sum())
    offset = NOISE * math.sqrt(1.0 / 4.0 + (forces.mean() * slope / NOISE) ** 2)
    half = found.parameters["high"] - found.parameters["value"]
    assert half.to_list() == pytest.approx([1.96 * slope * 210.0**2, 1.96 * offset], rel=1e-3)
    expected = -forces.mean() / math.sqrt((forces**2).mean())  # of l0 and c; k falls with c
    assert found.correlations.loc[STIFFNESS, FREE_LENGTH] == pytest.approx(-expected, rel=1e-3)
    fitted = found.scenario.robot.cables["line"]
    assert (fitted.stiffness, fitted.free_length) == tuple(found.parameters["value"])


def test_two_values_hardly_apart_are_named_together_and_alike_ones_unknown(by_formula):
    found = fit(hung(), pulled_down()[:2], BOUNDS)
    assert found.correlations.loc[STIFFNESS, FREE_LENGTH] > 0.95
    assert found.parameters["determined"].all()
    (warning,) = found.warnings
    assert STIFFNESS in warning and FREE_LENGTH in warning
    # With one load, a longer cable and a softer one lower the node alike.
    (case, *_) = pulled_down()
    heights = {"a z": case.positions["a z"], "b z": case.positions["a z"] - 0.2}
    alike = fit(hung(), [case.model_copy(update={"positions": heights})], BOUNDS)
    assert not alike.parameters["determined"].any()
    assert len(alike.warnings) == 2


@pytest.mark.parametrize(("limit", "slope"), [(math.inf, 2.0), (1.0005, 1.999)])
def test_derivatives_are_central_and_one_sided_where_a_neighbour_fails(limit, slope):
    def predict(scenarios):
        x = [each.robot.cables["line"].stiffness / 200.0 for each in scenarios]
        return [Prediction(np.array([each**2 if each < limit else math.nan])) for each in x]

    numbers = pandas.DataFrame({"measured": [0.0], "uncertainty": [1.0]})
    square = measurements.Measured("", numbers, predict)
    stiffness = Parameter(STIFFNESS, "N/m", 200.0, 100.0, 400.0)
    problem = FitProblem(hung(), [stiffness], [square], "", None, silent)
    assert problem.jacobian(np.ones(1)) == pytest.approx(slope, rel=1e-9)


def test_a_parameter_without_influence_is_told_and_stays(by_formula):
    cases, damping = pulled_down(), {DAMPING: (0.0, 5.0)}
    found = fit(hung(), cases, BOUNDS | damping)
    assert found.parameters["determined"].to_list() == [True, True, False]
    assert math.isnan(found.parameters["low"][DAMPING])
    assert found.parameters["value"].to_list()[:2] == pytest.approx([210.0, 0.39], rel=1e-5)
    alone = fit(hung(), cases, damping)
    for each in (found, alone):
        assert each.parameters["value"][DAMPING] == pytest.approx(0.0, abs=1e-6)
        assert [DAMPING in warning for warning in each.warnings[-1:]] == [True]
    # Alone, it leaves the misfit of the start.
    assert (len(found.warnings), len(alone.warnings)) == (1, 2) and alone.misfit > 100.0


def test_a_tension_and_a_frequency_give_two_equal_masses_and_the_stiffness():
    scenario, stiffness = hung().with_changes({"robot.masses.b": "0.2 kg"}), 230.0
    mass = Robot.of(scenario).structure.mass.sum() + 2.0 * 0.1
    changes = {STIFFNESS: "230 N/m", "robot.masses": {"a": "0.3 kg", "b": "0.3 kg"}}
    robot = Robot.of(scenario.with_changes(changes))
    frequencies = measurements.study_equilibrium(robot).frequencies.tolist()
    bounce = math.sqrt(stiffness / mass) / (2.0 * math.pi)
    assert min(abs(np.array(frequencies) / bounce - 1.0)) < 1e-8
    weight = {"line top a": mass * scenario.robot.gravity}
    case = Rest(tensions=weight, frequencies=frequencies)
    found = fit(scenario, [case], {MASSES: (0.1, 0.5)} | ALONE)
    assert found.parameters["value"].to_list() == pytest.approx([0.3, stiffness], rel=1e-4)
    assert found.scenario.robot.masses == dict.fromkeys("ab", found.parameters["value"][MASSES])
    assert found.residuals["uncertainty"].unique().tolist() == [1.0, 0.05]


def test_predictions_that_are_not_smooth_have_no_intervals(by_formula):
    by_formula[:] = 2e-4, 1.3e3
    found = fit(hung(), pulled_down(), BOUNDS)
    assert found.parameters["determined"].all() and found.parameters["low"].isna().all()
    (warning,) = [each for each in found.warnings if STIFFNESS in each and "smooth" in each]
    # The values explain the data nevertheless.
    assert found.misfit < 1.0 and "explain" in warning


def test_a_search_finds_the_deepest_of_many_minima(by_formula, monkeypatch):
    monkeypatch.setattr("tetra_drake.lab.fit.fit.MOST", 160)
    cases = pulled_down(310.0, 0.4)[:: len(PULLS) - 1]
    by_formula[:] = 5e-3, 0.2
    near, found = (fit(hung(), cases, ALONE, search=search) for search in (False, True))
    assert near.misfit > 10.0
    assert found.parameters["value"][STIFFNESS] == pytest.approx(310.0, rel=1e-4)
    assert found.misfit < 1e-3


def test_an_interrupted_fit_goes_on_where_it_was(tmp_path, monkeypatch, by_formula):
    cases, predict = pulled_down(), Rest.predict
    cases, predicted, stop = cases[:: len(PULLS) - 1], [], math.inf

    def counted(self, scenarios):
        if len(predicted) >= stop:
            raise InterruptedError
        predicted.append(len(scenarios))
        return predict(self, scenarios)

    monkeypatch.setattr(Rest, "predict", counted)
    monkeypatch.setattr("tetra_drake.lab.fit.fit.MOST", 16)
    whole = fit(hung(), cases, BOUNDS, search=True)
    needed = len(predicted)
    predicted, stop = [], 2 * len(cases)
    with pytest.raises(InterruptedError):
        fit(hung(), cases, BOUNDS, search=True, out=tmp_path)
    stop = math.inf
    again = fit(hung(), cases, BOUNDS, search=True, out=tmp_path)
    assert len(predicted) == needed
    assert again.parameters.equals(whole.parameters)
    # Damaged evaluations are simulated again: torn, changed by a bit, of another name or record. So
    # is the solution, for the clocks and notes of logs.
    torn, changed, swapped, foreign = sorted((tmp_path / "evaluations").iterdir())[:4]
    foreign.write_text(json_line({"trial": 0, "index": 1}))
    swapped.write_bytes(changed.read_bytes())
    torn.write_bytes(torn.read_bytes()[:-8])
    changed.write_bytes(bytes(32) + changed.read_bytes()[32:])
    again = fit(hung(), cases, BOUNDS, search=True, out=tmp_path)
    assert again.parameters.equals(whole.parameters)
    assert sum(predicted[needed:]) == (4 + 1) * len(cases)
    needed = len(predicted)
    # Other values are other evaluations.
    fit(hung().with_changes({DAMPING: "1 N*s/m"}), cases, BOUNDS, out=tmp_path)
    assert len(predicted) > needed + len(cases)


SIDE = {"robot.cables.side.stiffness": ("60 N/m", "200 N/m")}
SIDE |= {"robot.cables.side.damping": ("0.1 N*s/m", "2 N*s/m")}
TRUTH = dict(zip(SIDE, ("110 N/m", "0.6 N*s/m"), strict=True))


def write_log(file: Path, times: np.ndarray, p_WN: np.ndarray) -> None:
    """A log of the nodes n3 and n4 in mm."""
    columns = [f"{node} {axis}_mm" for node in ("n3", "n4") for axis in "xyz"]
    file.write_text(table_text(columns, times, 1e3 * p_WN.reshape(-1, 6)))


def write_pulls(file: Path, scenario: Scenario, *, period: float, share: float, rate: float):
    """A command of 40 samples that pulls the cables in turn, around 1 N."""
    robot = Robot.of(scenario).without_network()
    phases = rate * period * np.arange(40)[:, np.newaxis] + 2.0 * np.arange(robot.driven.size)
    pulls = Command("pulls", period, 1.0 + share * np.sin(phases))
    file.write_text(command_text(robot, pulls))


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    """A supported prism whose cables are pulled in turn, and a log of its motion: other constants,
    noise of 0.2 mm, a clock that is 30 ms ahead, gaps, and in mm; and one without noise."""
    folder = tmp_path_factory.mktemp("lab")
    scenario, command = supported_prism(duration=1.5, engine="!Compiled"), folder / "command.csv"
    write_pulls(command, scenario, period=0.05, share=0.4, rate=2.0 * np.pi)
    truth = scenario.with_changes(TRUTH)
    played = load_command(command, truth)
    moved = simulate(truth, command=played, record=True).trajectory
    p_WN = moved.p_WN.sel(node=["n3", "n4"])
    write_log(folder / "exact.csv", p_WN.time.values, p_WN.values)
    np.save(folder / "all.npy", moved.p_WN.values)
    noisy = p_WN.values + NOISE * np.random.default_rng(2).standard_normal(p_WN.shape)
    noisy[40:61, 0, 0] = np.nan
    write_log(folder / "log.csv", p_WN.time.values + 0.03, noisy)
    save_scenario(folder, scenario)
    return folder


def captured(log: Path, lab: Path) -> MotionCapture:
    return MotionCapture(log=str(log), command=str(lab / "command.csv"), uncertainty=NOISE)


def test_stiffness_and_damping_come_back_from_a_noisy_motion_with_another_clock(lab):
    capture = captured(lab / "log.csv", lab).model_copy(update={"clock": 0.1})
    found = fit(load_scenario(lab / "scenario.yaml"), [capture], SIDE)
    assert found.clock_offsets["measurement 1, log.csv"] == pytest.approx(0.03, abs=5e-4)
    table = found.parameters
    half = table["high"] - table["value"]
    assert (abs(table["value"] - [110.0, 0.6]) < 2.0 * half).all()  # of the one draw of noise
    assert (half / table["value"] < [0.001, 0.1]).all()
    assert found.misfit == pytest.approx(1.0, abs=0.1) and found.start_misfit > 2.0
    rows = found.residuals
    assert len(rows) == 6 * rows["along"].nunique() - 21  # the gap


NODES = ("n0", "n4", "n1", "n5", "n2", "n3")


def seen_by_cameras(
    file: Path, lab: Path, *, turn=(0.0, 0.0, 0.0), origin=(0.0, 0.0, 0.0), ahead=0.0, **given
) -> MotionCapture:
    """The exact motion of all nodes in a log with another frame and clock. In it, the marker of n3
    is moved along its rod by `along` of its length, and markers have `names`."""
    p_WN = np.load(lab / "all.npy")
    p_WN[:, -1] += given.pop("along", 0.0) * (p_WN[:, -2] - p_WN[:, -1])
    seen = p_WN @ Rotation.from_euler("XYZ", turn, degrees=True).as_matrix().T + origin
    seen *= given.pop("scale", 1.0)
    seen[50:60, 1] = np.nan
    columns = [f"{name} {axis}_mm" for name in given.pop("names", NODES) for axis in "xyz"]
    times = ahead + 1e-2 * np.arange(len(seen))
    file.write_text(table_text(columns, times, 1e3 * seen.reshape(len(seen), -1)))
    return captured(file, lab).model_copy(update=given)


@pytest.fixture(scope="module")
def truth(lab):
    return load_scenario(lab / "scenario.yaml").with_changes(TRUTH)


def predicted(capture, truth, *, markers=0, within):
    """The prediction, which is as measured, but for the offsets of markers at its end."""
    measured = capture.read(truth, "")
    (found,) = measured.predict([truth])
    motion = slice(0, len(found.values) - 3 * markers)
    expected = measured.numbers["measured"].to_numpy()[motion]
    assert found.values[motion] == pytest.approx(expected, abs=within)
    return found


def test_without_a_clock_the_times_of_the_log_count(lab, truth):
    found = predicted(captured(lab / "exact.csv", lab), truth, within=1e-6)
    assert np.ptp(found.values) > 1e-2 and found.clock_offset == 0.0


TURNED = {"turn": (-90.0, 0.0, 30.0), "origin": (1.0, -2.0, 0.1)}


@pytest.mark.parametrize("ahead", [12.3, 1.7e9])
def test_the_frame_and_the_clock_of_a_log_are_found(ahead, lab, truth, tmp_path):
    capture = seen_by_cameras(tmp_path / "log.csv", lab, **TURNED, ahead=ahead)
    found = predicted(capture, truth, within=1e-5)
    assert found.clock_offset == pytest.approx(ahead, abs=1e-4)
    told = [float(x) for x in re.findall(r"(-?[0-9.]+) (?:mm|deg)", found.notes[-1])]
    assert told == pytest.approx([1000.0, -2000.0, 100.0, -90.0, 0.0, 30.0], abs=0.05)


def test_a_frame_that_is_given_is_taken(lab, truth, tmp_path):
    log = seen_by_cameras(tmp_path / "log.csv", lab, **TURNED)
    given = {"turn": ["-90 deg", 0, "30 deg"], "origin": ["1 m", "-2 m", "10 cm"]}
    capture = MotionCapture(**log.model_dump(exclude={"turn", "origin"}) | given)
    assert predicted(capture, truth, within=1e-5).notes == []


def test_the_offset_of_a_marker_is_found_in_the_axes_of_its_body(lab, truth, tmp_path):
    moved = {"along": 0.03, "marker_offset": 0.01}
    capture = seen_by_cameras(tmp_path / "log.csv", lab, **TURNED, ahead=12.3, **moved)
    found = predicted(capture, truth, markers=6, within=2e-5)
    assert found.clock_offset == pytest.approx(12.3, abs=2e-5)
    offsets = found.values[-18:].reshape(6, 3)
    p_WN = np.load(lab / "all.npy")[0]
    expected = 0.03 * np.linalg.norm(p_WN[-2] - p_WN[-1])
    assert np.linalg.norm(offsets, axis=1) == pytest.approx([0.0] * 5 + [expected], abs=4e-4)
    without = capture.model_copy(update={"marker_offset": 0.0}).read(truth, "")
    ((values, _, _),) = without.predict([truth])
    assert abs(values - without.numbers["measured"]).max() > 1e-3


def test_markers_are_named_by_their_nodes_or_refused(lab, truth, tmp_path, refused):
    file, names = tmp_path / "log.csv", [f"M{number}" for number in range(6)]
    named = seen_by_cameras(tmp_path / "named.csv", lab, **TURNED).read(truth, "")
    with refused(file, "M0 x_mm", "n0", "markers"):
        seen_by_cameras(file, lab, **TURNED, names=names).read(truth, "")
    given = dict(zip(names, NODES, strict=True))
    all_named = seen_by_cameras(file, lab, **TURNED, names=names, markers=given)
    assert all_named.read(truth, "").numbers.equals(named.numbers)
    for marker, node in (("M0", "n9"), ("M9", "n2"), ("M0", "n4")):
        with refused(file, f"markers.{marker}"):
            all_named.model_copy(update={"markers": given | {marker: node}}).read(truth, "")
    with refused(file, "", "0.001"):  # metres that are called mm
        seen_by_cameras(file, lab, scale=1e-3).read(truth, "")


def test_positions_at_rest_may_be_in_another_frame():
    robot = hung()
    (seen,) = Rest(positions={"a z": 0.0}).read(robot, "").predict([robot])
    # The model's z is along -y of the other frame, half a metre from its origin.
    turned = Rest(positions={"a y": 0.0}, origin=[0.0, 0.5, 0.0], turn=["90 deg", 0, 0])
    (there,) = turned.read(robot, "").predict([robot])
    assert there.values == pytest.approx(0.5 - seen.values)


def test_where_a_number_is_far_off_there_is_no_interval_and_it_is_named(by_formula):
    cases = pulled_down()
    cases[2] = cases[2].model_copy(update={"positions": {"a z": cases[2].positions["a z"] + 0.01}})
    found = fit(hung(), cases, BOUNDS)
    assert found.misfit > 100.0 and found.parameters["low"].isna().all()
    assert "a z of measurement 3" in found.warnings[0]


def test_the_command_writes_a_folder_with_the_fitted_scenario_and_a_page(tmp_path, capsys):
    save_scenario(tmp_path, hung())
    shutil.copy(Path(__file__).with_name("fit.yaml"), tmp_path)
    out = tmp_path / "fit"
    assert main(["fit", str(tmp_path / "fit.yaml"), "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    fitted = load_scenario(out / "scenario.yaml").robot.cables["line"]
    # The free length is 0.4 m, the node is 0.417 m below the upper end.
    weight = Robot.of(hung()).weight
    assert fitted.stiffness == pytest.approx(weight / 0.017, rel=1e-5)
    assert f"{fitted.stiffness:.1f} ± " in printed
    assert pandas.read_csv(out / "parameters.csv")["value"][0] == pytest.approx(fitted.stiffness)
    assert json.loads((out / "summary.json").read_text())["evaluations"] > 3
    assert all(STIFFNESS in (out / page).read_text() for page in ("README.md", "fit.html"))
    assert (out / "residuals.figure.svg").stat().st_size > 1000


LOGS = yaml.safe_load(Path(__file__).with_name("logs.yaml").read_text("utf-8"))


@pytest.mark.parametrize(("log", "named"), LOGS)
def test_a_log_that_does_not_fit_is_refused(log, named, lab, tmp_path, refused):
    file = tmp_path / "log.csv"
    file.write_text(log)
    capture = captured(file, lab).model_copy(update={"clock": 0.1})
    with refused(file, named):
        fit(load_scenario(lab / "scenario.yaml"), [capture], SIDE, out=tmp_path / "fit")
    assert not (tmp_path / "fit").exists()


def test_a_log_in_parquet_has_the_numbers_of_the_csv_file(lab, tmp_path, monkeypatch, refused):
    pytest.importorskip("pyarrow")
    table, scenario = pandas.read_csv(lab / "log.csv"), load_scenario(lab / "scenario.yaml")

    def numbers(log):
        return captured(log, lab).read(scenario, "").numbers

    for written in (table, table.set_index("time_s")):
        written.to_parquet(tmp_path / "log.parquet")
        assert numbers(tmp_path / "log.parquet").equals(numbers(lab / "log.csv"))
    (tmp_path / "text.parquet").write_text("time_s,n3 z_mm\n0,1\n")
    with refused(tmp_path / "text.parquet", ""):
        numbers(tmp_path / "text.parquet")
    monkeypatch.setattr(pandas, "read_parquet", Mock(side_effect=ImportError))
    with refused(tmp_path / "log.parquet", "", "pip install 'tetra_drake[parquet]'"):
        numbers(tmp_path / "log.parquet")


def test_a_tolerance_is_a_prior_and_comes_out_where_the_data_tell_nothing():
    tolerances = {FREE_LENGTH: "2 mm", "robot.cables.line.damping": "1 N*s/m uniform"}
    scenario = hung().with_changes({"robot.cables.line.damping": "3 N*s/m"})
    scenario = scenario.with_changes({"tolerances": tolerances})
    (case, *_) = pulled_down(200.0, 0.401)
    case = case.model_copy(update={"position_uncertainty": 1e-3})
    bounds = {FREE_LENGTH: (0.3, 0.5), DAMPING: (0.0, 6.0)}
    table = fit(scenario, [case], bounds).parameters
    # The height is linear in the free length: the mean is weighed by inverse variances.
    weights = np.array([1e-3, 2e-3]) ** -2.0
    assert table["value"][FREE_LENGTH] == pytest.approx(weights @ [0.401, 0.4] / weights.sum())
    half = table["high"] - table["value"]
    assert half[FREE_LENGTH] == pytest.approx(1.96 / math.sqrt(weights.sum()), rel=1e-4)
    assert table["value"][DAMPING] == pytest.approx(3.0)
    assert half[DAMPING] == pytest.approx(1.96 / math.sqrt(3.0), rel=1e-4)


SLIDING = SIDE | {"friction.kinetic": (0.1, 0.26)}


@pytest.mark.slow
def test_stiffness_damping_and_friction_of_a_sliding_robot_are_within_their_intervals(tmp_path):
    """On a slope of 25 degrees the prism slides from the start, while its cables are pulled in
    turn: three feet touch all the time, so the motion is smooth in friction. The diagram plays
    reality; the engines differ by some micrometres here, the noise is 0.2 mm."""
    settings = {"engine": "!Compiled {tolerance: 0.01 mm/s}", "friction.static": 0.26}
    settings |= {"friction.kinetic": 0.26, "terrain": "!Incline {slope: -25 deg}"}
    scenario = shortly(load_scenario("prism"), 0.8, **settings)
    file, log = tmp_path / "command.csv", tmp_path / "log.csv"
    write_pulls(file, scenario, period=0.02, share=0.3, rate=6.0 * np.pi)
    truth = np.array([110.0, 0.6, 0.25])
    hidden = dict(zip(SLIDING, ("110 N/m", "0.6 N*s/m", 0.25), strict=True))
    real = scenario.with_changes(hidden | {"engine": "!Drake {accuracy: 1e-6}"})
    moved = simulate(real, command=load_command(file, real), record=True).trajectory
    p_WN = moved.p_WN.sel(node=["n3", "n4"])[::2]
    generator, inside = np.random.default_rng(3), np.zeros(3)
    for _ in range(100):
        noisy = p_WN.values + NOISE * generator.standard_normal(p_WN.shape)
        write_log(log, p_WN.time.values, noisy)
        table = fit(scenario, [captured(log, tmp_path)], SLIDING).parameters
        inside += (table["low"] <= truth) & (truth <= table["high"])
    assert (inside >= 90).all(), inside
