"""Predictions with intervals, against what tolerances give by hand."""

import json
import math

import numpy as np
import pandas
import pytest
from helpers.anchored import HUNG, SWINGING, scenario_of

import tetra_drake as td
from tetra_drake.cli import main
from tetra_drake.lab.predict.predict import drawn_scenarios, predict
from tetra_drake.lab.predict.variates import variates_of
from tetra_drake.scenario.load import dump_scenario, load_scenario
from tetra_drake.scenario.robot_structure import StructureFile
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.scenario.tolerances import Tolerance
from tetra_drake.scenario.yaml_text import parse_yaml

STIFFNESS, MASS = "robot.cables.line.stiffness", "robot.masses.b"
WIDTH_90, BAR_MASS = 1.6449, math.pi * 0.004**2 * 0.2 * 1200.0


def hung(**tolerances) -> Scenario:
    """A bar with a mass at each end on one spring, with tolerances of the robot's numbers."""
    return scenario_of(HUNG | {"tolerances": tolerances})


def bounce(robot: StructureFile) -> float:
    mass = sum(robot.masses.values()) + BAR_MASS
    return math.sqrt(robot.cables["line"].stiffness / mass) / (2.0 * math.pi)


def test_a_mass_on_a_spring_has_the_interval_and_the_shares_of_its_formula():
    frequencies = [f"frequency {mode}" for mode in range(1, 6)]
    both = hung(**{"cables.line.stiffness": "2 %", "masses.b": "4 % uniform"})
    found = predict(both, frequencies, draws=24)
    is_bounce = np.isclose(found.quantities["nominal"], bounce(both.robot), rtol=1e-6)
    (mode,) = found.quantities.index[is_bounce]
    mass = sum(both.robot.masses.values()) + BAR_MASS
    parts = np.array([0.01, 0.02 / math.sqrt(3.0) * 0.3 / mass]) ** 2  # half of relative errors
    shares = found.shares.loc[mode]
    assert shares[STIFFNESS] == pytest.approx(parts[0] / parts.sum(), abs=5e-3)
    assert shares[MASS] == pytest.approx(parts[1] / parts.sum(), abs=5e-3)
    assert shares["rest"] < 1e-3
    alone = predict(hung(**{"cables.line.stiffness": "2 %"}), [mode], draws=100)
    median, low, high = alone.quantities.loc[mode, ["median", "low", "high"]]
    assert median == pytest.approx(bounce(both.robot), rel=1e-3)
    assert (high - low) / (2.0 * WIDTH_90 * median) == pytest.approx(0.01, rel=0.02)


def test_numbers_of_one_key_vary_together_or_each_alone_and_struts_get_longer():
    pair = ["tension side n0 n3", "tension side n1 n4"]
    prism, key = load_scenario("prism"), "cables.side.stiffness"
    known = [prism.with_changes({"robot.tolerances": {key: size}}) for size in ("2 %", "2 % each")]
    together, alone = (predict(each, pair, draws=6).draws for each in known)
    assert together[pair[0]].to_list() == pytest.approx(together[pair[1]].to_list(), rel=1e-6)
    assert not np.allclose(alone[pair[0]], alone[pair[1]], rtol=1e-4)

    def length(study):
        a, b = study.robot.scenario.robot.struts["bar"].pairs[0]
        return np.linalg.norm(np.subtract(*study.nodes.loc[[a, b], ["x", "y", "z"]].to_numpy()))

    longer = hung(**{"struts.bar.length": "1 mm uniform"})
    row = predict(longer, {"length": length}, draws=40).quantities.iloc[0]
    errors = row[["low", "high"]].to_numpy(float) - row["nominal"]
    assert errors == pytest.approx([-9e-4, 9e-4], abs=2e-5)


HELD = [{}, {"a": "xyz"}, {"b": "xyz"}, {"a": "x", "b": "z"}, {"a": "xyz", "b": "y"}]


@pytest.mark.parametrize("anchors", HELD, ids=repr)
def test_a_longer_bar_keeps_what_anchors_hold(anchors):
    nodes = {"a": [0.0, 0.1, 0.3], "b": [0.4, 0.1, 0.0]}
    ladder = scenario_of(SWINGING | {"nodes": nodes, "anchors": anchors})
    known = {"robot.struts.bar.length": Tolerance(size="1 mm")}
    (drawn,) = drawn_scenarios(ladder, variates_of(ladder.model_dump(), known), np.ones((1, 1)))
    moved = drawn.robot.nodes
    assert math.dist(moved["a"], moved["b"]) == pytest.approx(0.501, abs=3e-6)
    for node, axes in anchors.items():
        for axis in axes:
            assert moved[node]["xyz".index(axis)] == nodes[node]["xyz".index(axis)]


def test_a_tolerance_in_a_text_is_one_of_the_section_and_is_kept():
    given = {"robot.cables.side.stiffness": "1.1·10² N·m⁻¹ ± 2 % uniform"}
    given |= {"ground.stiffness": "9 kN/m +/- 1 kN/m"}
    scenario = load_scenario("prism").with_changes(given)
    assert scenario.robot.tolerances["cables.side.stiffness"].law == "uniform"
    assert scenario.robot.cables["side"].stiffness == 110.0
    assert [*scenario.all_tolerances] == ["robot.cables.side.stiffness", "ground.stiffness"]
    text = dump_scenario(scenario)
    assert Scenario.from_tree(parse_yaml(text, "x"), "x") == scenario
    assert "tolerances" not in dump_scenario(load_scenario("prism"))


def test_draws_without_result_are_counted_and_the_same_seed_gives_the_same(tmp_path):
    known = {"robot.tolerances": {"cables.side.stiffness": "90 %"}}
    scenario = load_scenario("prism").with_changes(known)
    first, again = (predict(scenario, ["n3 z"], draws=4, seed=2) for _ in range(2))
    pandas.testing.assert_frame_equal(first.draws, again.draws)
    failed = int((first.draws["failure"] != "").sum())
    assert 0 < failed < 4 and first.quantities["draws"].to_list() == [4 - failed]
    assert any(note.startswith(f"{failed} of 4 draws") for note in first.notes)
    file = tmp_path / "my.yaml"
    file.write_text("base: prism\ntolerances: {robot.cables.side.stiffness: 2 %}\n")
    assert main(["predict", str(file), "--draws", "5", "--out", str(tmp_path / "out")]) == 0
    table = pandas.read_csv(tmp_path / "out/predictions.csv", index_col="quantity")
    assert table.loc["tension side", "low"] < table.loc["tension side", "high"]
    assert json.loads((tmp_path / "out/summary.json").read_text())["draws"] == 5
    assert "tension side" in (tmp_path / "out/predict.html").read_text()


def test_draws_are_simulated_with_a_gait():
    changes = {"tolerances": {"ground.stiffness": "20 %"}, "simulation.duration": "1.6 s"}
    scenario = load_scenario("prism").with_changes(changes)
    measures = {"way": "distance", "own": lambda result: result.metrics.distance}
    gait = td.seeded_gait(scenario, 1)
    draws = predict(scenario, measures, gait=gait, draws=4).draws
    assert draws["way"].nunique() == 4 and draws["way"].equals(draws["own"])
    # Quantities in motion and at rest together are those of each kind alone.
    at_rest = ["frequency 1", "n3 z"]
    both = predict(scenario, ["distance", *at_rest], gait=gait, draws=4).draws
    assert both["distance"].equals(draws["way"].rename("distance"))
    alone = predict(scenario, at_rest, draws=4).draws
    np.testing.assert_allclose(both[at_rest], alone[at_rest], rtol=1e-6)
