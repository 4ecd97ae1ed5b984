"""Predictions for measured robots: the page's claims."""

import functools
import hashlib
import math

import measured
import measured_intervals
import measured_robots
import numpy as np
import pandas
import pytest

PAGE = (measured.HERE / "README.md").read_text(encoding="utf-8")
COMMITTED = "9cf13261876d975a23feb837d32f42ee3c363f7971770eb066e5d711b7d9f5d0"
"""SHA-256 of the blind predictions before their measured values were looked at."""
LOADS = ("0.60", "2.08")
MODE = {"S1": 1.0, "S2": 1.0, "S3": 1.0, "CB1": 0.393, "CT2": 0.393, "CV3": 0.681}
"""Forces of members of the simplex by the compression of its tubes, as published."""


@pytest.fixture(autouse=True, scope="module")
def simplex_once():
    """Each simplex with a self-stress is looked for once."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(measured_robots, "simplex", functools.cache(measured_robots.simplex))
        yield


def read_only(monkeypatch, file: str, rows) -> None:
    """Leaves only some rows of a file of measurements: an index, or a function of the table."""
    table = pandas.read_csv(measured.HERE / file)
    monkeypatch.setattr(pandas, "read_csv", lambda _: table[rows].copy())


def test_the_simplex_is_as_high_as_measured_up_to_a_load_of_1_kn(monkeypatch):
    read_only(monkeypatch, "simplex_loading.csv", lambda table: table["x"] < 1.01)
    moderate = measured.simplex_under_load()
    assert len(moderate) > 8 and moderate["load"].max() > 0.9
    np.testing.assert_allclose(moderate["H"], moderate["H measured"], atol=1.0)  # mm
    for kind in ("CB", "CT", "CV"):
        np.testing.assert_allclose(moderate[kind], moderate[f"{kind} measured"], rtol=0.05)


@pytest.mark.slow
def test_the_measured_heights_of_the_simplex_tell_its_free_lengths():
    found = measured.fitted_free_lengths("top", "vertical").parameters
    assert ((found["low"] < found["start"]) & (found["start"] < found["high"])).all()
    np.testing.assert_allclose(found["value"], found["start"], atol=5e-4)


def test_the_simplex_vibrates_faster_with_more_self_stress():
    slow, fast = (measured.simplex_frequency(stress) for stress in (1.5, 2.5))
    assert slow == pytest.approx(2.28, abs=0.02) and fast == pytest.approx(2.72, abs=0.02)
    assert f"{slow:.2f} and {fast:.2f} Hz" in PAGE


@pytest.mark.parametrize("every", [16, pytest.param(1, marks=pytest.mark.slow)])
def test_the_spine_rests_where_the_authors_statics_wants_it(every, monkeypatch):
    read_only(monkeypatch, "spine_poses.csv", slice(None, None, every))
    poses = measured.spine_poses()
    assert len(poses) > 350 / every
    for axis in ("x_m", "y_m"):
        np.testing.assert_allclose(poses[f"predicted_{axis}"], poses[f"wanted_{axis}"], atol=5e-5)
    angles = np.degrees(poses["predicted_rad"] - poses["wanted_rad"])
    assert np.abs(angles).max() < 0.01


def test_the_jumper_rises_as_on_the_page():
    rise, clearance = measured.jump(measured.jumper(2.0), 0.2)
    assert rise == pytest.approx(0.34, abs=0.01) and clearance > 0.06


def test_the_blind_predictions_are_as_they_were_committed():
    found = hashlib.sha256((measured.HERE / "blind.csv").read_bytes()).hexdigest()
    assert found == COMMITTED and COMMITTED in PAGE
    table = pandas.read_csv(measured.HERE / "blind.csv")
    assert (table["low"] < table["median"]).all() and (table["median"] < table["high"]).all()
    assert table["structure"].nunique() == 7 and table["assumed"].notna().all()


def test_blind_heights_do_not_hold_until_the_supports_stay_in_place():
    blind = measured.measured_rows()["blind"]
    bare = measured_robots.in_the_air("simplex")
    depth = 1e3 * 0.5 * measured_robots.stressed(bare, 8.5e3)[1] * 1.950 / 2.9998
    assert depth == pytest.approx(1.52, abs=0.01) and f"sank by {depth:.1f} mm" in PAGE
    heights = blind[(blind["kind"] == "shape") & (blind["unit"] == "mm")]
    heights = heights[heights["quantity"].str.startswith("H")]
    mended = heights.assign(measured=heights["measured"] - depth)
    assert [measured.Score.of(each).inside for each in (heights, mended)] == [0, 12]
    assert "12 of 15 hold" in PAGE


@pytest.mark.parametrize("self_stress", [1.5, 8.5])
def test_members_of_the_simplex_balance_on_supports_that_stay_in_place(self_stress):
    bare = measured_robots.in_the_air("simplex")
    stressed, lengthening = measured_robots.stressed(bare, 1e3 * self_stress)
    p_WN = measured_robots.at_rest(measured_robots.Robot.of(stressed))
    robot, tube = bare.robot, bare.robot.struts["tube"]
    forces = {name: np.array([0.0, 0.0, -9.81 * robot.masses[name]]) for name in robot.nodes}

    def pull(a: str, b: str, stiffness: float, unstressed: float) -> None:
        span = p_WN[b] - p_WN[a]
        force = stiffness * (1.0 - unstressed / np.linalg.norm(span)) * span
        forces[a] += force
        forces[b] -= force

    for a, b in tube.pairs:
        pull(a, b, tube.axial_stiffness, math.dist(robot.nodes[a], robot.nodes[b]) + lengthening)
    for group in robot.cables.values():
        for a, b in group.pairs:
            pull(a, b, group.stiffness, group.free_length)
    left = [forces[name] for name in measured_robots.UPPER]
    np.testing.assert_allclose(left, 0.0, atol=self_stress)  # N, a thousandth
    np.testing.assert_allclose([p_WN[name][2] for name in ("n0", "n1", "n2")], 0.0, atol=1e-5)


def test_lifts_of_laika_are_in_the_middle_of_their_recorded_draws():
    case = measured_intervals.cases()["blind_laika"]
    found = case.predict(case.scenario(), case.unknowns)
    rows = measured_intervals.predicted("blind_laika", case).set_index("quantity")
    assert found == pytest.approx(rows["median"].to_dict(), rel=0.02)


@pytest.mark.slow
def test_bowed_tubes_lower_the_simplex_under_a_high_load_only():
    loads = [float(load) for load in LOADS]
    case = measured_intervals.case_of("simplex_loads", loads=loads)
    bows = ({"bow of the tubes": bow} for bow in (0.0, 3e-3))
    straight, bowed = (case.predict(case.scenario(), case.unknowns | bow) for bow in bows)
    lower = {load: straight[f"H at {load} kN"] - bowed[f"H at {load} kN"] for load in LOADS}
    assert lower["0.60"] < 0.5 and lower["2.08"] > 2.0


def test_a_longer_tube_stresses_all_members_of_the_simplex_by_the_published_mode():
    case = measured_intervals.case_of("anew_simplex_tightened", lengthenings=[2, 8])
    force = case.predict(case.scenario(), case.unknowns)
    added = {member: force[f"{member} at +8 mm"] - force[f"{member} at +2 mm"] for member in MODE}
    for member, share in MODE.items():
        assert added[member] / added["S1"] == pytest.approx(share, rel=0.02)
