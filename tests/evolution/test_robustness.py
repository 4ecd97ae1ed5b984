"""How far gaits walk with the robot or its surroundings slightly changed."""

import math
import re

import numpy as np
import pandas
import pytest
from helpers.synthetic_run import tiny_scenario, write_run

from tetra_drake.cli import main
from tetra_drake.engines.simulate import simulate
from tetra_drake.evolution.robustness import (
    DISPLACED,
    DRAWS,
    NOTHING,
    SCALED,
    robustness,
    summarize,
)
from tetra_drake.robot.gait import save_gait, seeded_gait
from tetra_drake.scenario.load import dump_scenario, load_scenario
from tetra_drake.scenario.schema import Coulomb


@pytest.fixture(scope="module")
def scenario():
    """A short walk in which the oscillators start at once."""
    return tiny_scenario().with_changes({"simulation.engine": "compiled", "cpg.start_up": 0.0})


@pytest.fixture(scope="module")
def gaits(scenario):
    return {"a": seeded_gait(scenario, 1), "b": seeded_gait(scenario, 2)}


@pytest.fixture(scope="module")
def table(scenario, gaits):
    return robustness(scenario, gaits, percents=[3.0], workers=2)


def test_coulomb_friction_is_changed_by_its_own_constants(scenario, gaits):
    sliding = scenario.with_changes({"friction": Coulomb()})
    table = robustness(sliding, dict(list(gaits.items())[:1]), percents=[3.0], workers=2)
    changed = {what for what in table["what"] if what.startswith(("friction", "sti", "prop"))}
    assert changed == {"friction coefficients μ", "friction damping c"}
    distances = table.groupby("what")["distance"].nunique()
    assert distances["friction coefficients μ"] == 2, "both are felt"


def test_every_change_is_simulated_for_every_gait(scenario, gaits, table):
    counts = table.groupby("what").size().to_dict()
    own = [what for what in SCALED if not what.startswith("friction")]  # Coulomb's
    assert counts == {NOTHING: 2, DISPLACED: 2 * DRAWS} | dict.fromkeys(own, 4)
    assert table["failure"].isna().all()
    assert np.isfinite(table["distance"]).all()
    for what, percent in (
        (NOTHING, 0.0),
        ("ground stiffness k", -3.0),
        ("ground stiffness k", 3.0),
    ):
        stiffness = scenario.ground.stiffness * (1.0 + percent / 100.0)
        changed = scenario.with_changes({"ground.stiffness": stiffness})
        chosen = table[(table["what"] == what) & (table["percent"] == percent)]
        for key, distance in zip(chosen["gait"], chosen["distance"], strict=True):
            assert distance == simulate(scenario=changed, gait=gaits[key]).metrics.distance


def test_displaced_starts_differ_and_are_the_same_again(scenario, gaits, table):
    displaced = table[table["what"] == DISPLACED]
    assert displaced["distance"].nunique() == 2 * DRAWS
    again = robustness(scenario, {"b": gaits["b"]}, percents=[3.0], workers=1)
    pandas.testing.assert_frame_equal(
        again, table[table["gait"] == "b"].reset_index(drop=True), check_exact=True
    )


def test_a_simulation_that_fails_has_a_reason_and_no_distance(scenario, gaits):
    stopped = scenario.with_changes({"simulation.max_evaluations": 100})
    table = robustness(stopped, {"a": gaits["a"]}, percents=[3.0])
    assert table["distance"].isna().all()
    assert table["failure"].notna().all()


def test_the_summary_is_of_the_changes_from_the_unchanged_distance():
    rows = [("nothing", 0.0, 10.0), ("mass", -2.0, 8.5), ("mass", 2.0, 10.2), ("mass", 5.0, 9.5)]
    table = pandas.DataFrame(
        [{"gait": 1, "what": w, "percent": p, "distance": d, "failure": None} for w, p, d in rows]
        + [{"gait": 1, "what": "mass", "percent": -5.0, "distance": math.nan, "failure": "fell"}]
    )
    summary = summarize(table, by=["what", "percent"])
    at_2, at_5 = (summary.loc[("mass", percent)].to_dict() for percent in (2.0, 5.0))
    assert at_2 == pytest.approx(
        {
            "unchanged": 10.0,
            "median": 0.85,
            "least": -1.5,
            "greatest": 0.2,
            "kept": 0.5,
            "failed": 0,
        }
    )
    assert at_5 == pytest.approx(
        {
            "unchanged": 10.0,
            "median": 0.5,
            "least": -0.5,
            "greatest": -0.5,
            "kept": 0.5,
            "failed": 1,
        }
    )


def test_the_command_writes_the_distance_of_every_simulation(scenario, gaits, tmp_path):
    gait, out, short = (tmp_path / name for name in ("gait.json", "out.csv", "short.yaml"))
    save_gait(gaits["b"], gait, scenario)
    short.write_text(dump_scenario(scenario))
    options = ["--scenario", str(short), "--percent", "3", "--out", str(out)]
    assert main(["robustness", str(gait), *options]) == 0
    found = pandas.read_csv(out)
    expected = robustness(scenario, {"b": gaits["b"]}, percents=[3.0])
    np.testing.assert_allclose(found["distance_m"], expected["distance"], rtol=1e-15)
    assert found["what"].tolist() == expected["what"].tolist()


def test_the_command_takes_the_best_gait_of_each_trial_of_a_run(tmp_path, capsys):
    trials = [[[(1.0, 0), (2.0, 1)]], [[(3.0, 0)]]]
    scenario = tiny_scenario().with_changes({"simulation.engine": "compiled"})
    run, out = write_run(tmp_path / "run", trials, scenario=scenario), tmp_path / "out.csv"
    assert main(["robustness", str(run), "--percent", "1", "--out", str(out)]) == 0
    assert pandas.read_csv(out)["gait"].unique().tolist() == ["trial 0", "trial 1"]
    assert {"trial 0", "trial 1", DISPLACED} <= set(
        re.split(r"\s{2,}|\n| ± ", capsys.readouterr().out)
    )


def test_a_gait_of_another_robot_is_refused(scenario, refused):
    with refused("gait random gait 1", "weights", "expected 4"):
        robustness(scenario, {"a": seeded_gait(load_scenario("thesis"), 1)})
