"""Predictions for measured robots: the page's claims."""

import functools
import hashlib

import measured
import measured_intervals
import measured_robots
import numpy as np
import pandas
import pytest

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


@pytest.mark.slow
def test_longer_bottom_cables_lower_the_upper_nodes_as_longer_top_cables_do():
    all_groups = measured.fitted_free_lengths("bottom", "top", "vertical").parameters
    assert all_groups["determined"].to_list() == [False, False, True]


def test_the_simplex_vibrates_faster_with_more_self_stress():
    slow, fast = (measured.simplex_frequency(stress) for stress in measured.SELF_STRESSES)
    assert slow == pytest.approx(2.28, abs=0.02) and fast == pytest.approx(2.72, abs=0.02)


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
    rise, clearance = measured.jump(share=0.2, damping=2.0)
    assert rise == pytest.approx(0.34, abs=0.01) and clearance > 0.06


def test_the_hash_of_the_blind_predictions_is_on_the_page():
    page = (measured.HERE / "README.md").read_text(encoding="utf-8")
    assert hashlib.sha256((measured.HERE / "blind.csv").read_bytes()).hexdigest() in page
    table = pandas.read_csv(measured.HERE / "blind.csv")
    assert (table["low"] < table["median"]).all() and (table["median"] < table["high"]).all()
    assert table["structure"].nunique() == 7 and table["assumed"].notna().all()


def test_bowed_tubes_lower_the_simplex_under_a_high_load_only():
    loads = [float(load) for load in LOADS]
    case = measured_intervals.simplex_loads_case(1.5, loads, is_known=True)
    middle = {name: unknown.middle for name, unknown in case.unknowns.items()}
    straight, bowed = case.predict(
        [(case.scenario(), middle | {"bow of the tubes": bow}) for bow in (0.0, 3e-3)]
    )
    lower = {load: straight[f"H at {load} kN"] - bowed[f"H at {load} kN"] for load in LOADS}
    assert lower["0.60"] < 0.5 and lower["2.08"] > 2.0


def test_a_longer_tube_stresses_all_members_of_the_simplex_by_the_published_mode():
    case = measured_intervals.simplex_tightened_case((2.0, 8.0))
    middle = {name: unknown.middle for name, unknown in case.unknowns.items()}
    (force,) = case.predict([(case.scenario(), middle)])
    added = {member: force[f"{member} at +8 mm"] - force[f"{member} at +2 mm"] for member in MODE}
    for member, share in MODE.items():
        assert added[member] / added["S1"] == pytest.approx(share, rel=0.02)


def test_totals_count_the_intervals_that_hold_the_measured_value():
    rows = pandas.DataFrame({"kind": ["shape", "shape"], "median": [1.0, 2.2], "low": [0.9, 2.1]})
    rows = rows.assign(high=[1.1, 2.3], measured=[1.0, 2.0])
    lines = measured.totals_table(rows, "kind").rows
    assert lines[0] == ["shape", "2", "5.0", "1 of 2 (50 %)"] and lines[1][0] == "all"
