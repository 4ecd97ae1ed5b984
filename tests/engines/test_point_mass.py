"""A point mass that only cables hold: a payload in the middle of a structure."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers.anchored import scenario_of
from helpers.hanging import HANGING, MASS, STIFFNESS

from tetra_drake.analysis.equilibrium import study_equilibrium
from tetra_drake.engines.simulate import simulate
from tetra_drake.robot.gait import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import node_positions
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.robot_structure import StructureFile
from tetra_drake.scenario.section import written

GRAVITY, DROP = 9.80665, 0.01


def test_it_hangs_below_its_cables_by_its_weight_over_their_stiffness_and_swings():
    # Cables without free length: the pull is 2 k times the way to the middle of the bar.
    study = study_equilibrium(Robot.of(scenario_of(HANGING)))
    sag = MASS * GRAVITY / (2.0 * STIFFNESS)
    assert study.nodes.loc["p", ["x", "y"]].tolist() == pytest.approx([0.1, 0.0], abs=1e-6)
    assert study.nodes.loc["p", "z"] == pytest.approx(1.0 - sag, abs=1e-6)
    assert study.robot.structure.mass[-1] == pytest.approx(MASS)
    frequency = math.sqrt(2.0 * STIFFNESS / MASS) / (2.0 * math.pi)
    assert study.frequencies[:3] == pytest.approx([frequency] * 3, rel=1e-3)
    # Without weight the point is in the middle of the bar, that is, on a line with both cables:
    # they prestress each other, and it moves across them.
    assert (len(study.statics.self_stresses), study.statics.mechanisms) == (1, 2)


@pytest.mark.parametrize("engine", ["!Compiled", "!Drake", "!Mujoco"])
def test_it_swings_up_and_down_on_all_engines(engine):
    if engine == "!Mujoco":
        pytest.importorskip("mujoco")
    changes = {
        "engine": engine,
        "friction.stiffness": "0 N/m",
        "robot.offsets": [["0 m"] * 3, ["0 m", "0 m", f"{-DROP} m"]],
    }
    scenario = scenario_of(HANGING, duration=0.6, **changes)
    trajectory = simulate(scenario, seeded_gait(scenario), record=True).trajectory
    height = trajectory["p_WN"].sel(node="p", axis="z").values
    rest = 1.0 - MASS * GRAVITY / (2.0 * STIFFNESS)
    rate = math.sqrt(2.0 * STIFFNESS / MASS)
    expected = rest - DROP * np.cos(rate * trajectory["time"].values)
    np.testing.assert_allclose(height, expected, atol=0.02 * DROP)


def test_a_payload_in_a_prism_walks_along():
    tree = load_scenario("prism").robot.model_dump()
    given = StructureFile.model_validate(tree)
    # Between two bars: with a third, the compiled engine would need a kernel of its own.
    ends = [node for pair in given.struts["bar"].pairs[1:] for node in pair]
    middle = np.mean([given.nodes[node] for node in ends], axis=0).tolist()
    pairs = [[node, "payload"] for node in ends]
    nodes = given.nodes | {"payload": middle}
    line = {"pairs": pairs, "stiffness": 30.0, "damping": 0.3, "free_length": 0.02}
    tree |= {"nodes": nodes, "masses": {"payload": 0.02}}
    tree["cables"] = tree["cables"] | {"hanger": line}
    robot = StructureFile.model_validate(tree)
    scenario = load_scenario("prism").with_sections(robot=robot)
    made = Robot.of(scenario)
    before = Robot.of(load_scenario("prism")).structure.mass.sum()
    assert made.structure.mass.sum() == pytest.approx(before + 0.02)
    heights = node_positions(made.structure, made.structure.initial_state)[:, 2]
    assert 0.0 < heights[-1] < heights.max()
    short = {"simulation.duration": "2 s", "simulation.steady_from": "1 s"}
    result = simulate(scenario.with_changes(short), seeded_gait(scenario, 3))
    assert math.isfinite(result.metrics.distance_in)


def test_a_mass_that_nothing_holds_is_refused(refused):
    lonely = StructureFile.model_validate(HANGING).model_dump() | {"cables": {}}
    with refused("file", "masses.p", "cable"):
        StructureFile.from_tree(written(lonely), "file")
