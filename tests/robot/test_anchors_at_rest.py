"""Anchored and loaded structures at rest: balance, frequencies, statics, text and page."""

import math

import numpy as np
import pytest
from helpers.anchored import HUNG, SWINGING, scenario_of, supported_prism

from tetra_drake.lab.study.equilibrium import structure_text, study_equilibrium
from tetra_drake.robot.remarks import yielding_remark
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import node_positions

G = 9.80665
TENSION, SIZE, SPREAD = 2e4, 10.0, 6.0


def guyed_mast(scale: float = 1.0, **changes: object) -> dict[str, object]:
    """A steel mast on a pin, held by three steel guys; of another size, with the same stresses."""
    places = {f"g{i}": math.tau * i / 3 for i in range(3)}
    nodes = {node: [SPREAD * math.cos(a), SPREAD * math.sin(a), 0.0] for node, a in places.items()}
    nodes |= {"foot": [0.0, 0.0, 0.0], "top": [0.0, 0.0, SIZE]}
    guy = {"stiffness": 2e6 * scale, "damping": 5e2 * scale**2, "tension": TENSION * scale**2}
    mast = {"diameter": 0.1 * scale, "density": 7850.0, "node_diameter": 0.0}
    return {
        "nodes": {node: [scale * x for x in place] for node, place in nodes.items()},
        "struts": {"mast": mast | {"pairs": [["foot", "top"]]}},
        "cables": {"guy": guy | {"pairs": [[node, "top"] for node in places]}},
        "anchors": dict.fromkeys(["foot", *places], "xyz"),
    } | changes


def test_reactions_balance_loads_and_weight():
    robot = Robot.of(supported_prism())
    study = study_equilibrium(robot)
    forces = study.nodes[["anchor_x", "anchor_y", "anchor_z"]].to_numpy()
    p_WN, loads = study.nodes[["x", "y", "z"]].to_numpy(), robot.structure.node_load
    down = np.array([0.0, 0.0, -G])
    weights = robot.structure.mass[:, np.newaxis] * down
    total = forces.sum(axis=0) + loads.sum(axis=0) + weights.sum(axis=0)
    np.testing.assert_allclose(total, 0.0, atol=1e-9)
    torque = np.cross(p_WN, forces + loads).sum(axis=0)
    p_WB = robot.equilibrium.state[:21].reshape(3, 7)[:, 4:]
    np.testing.assert_allclose(torque + np.cross(p_WB, weights).sum(axis=0), 0.0, atol=1e-9)
    assert study.nodes.anchor_x["n1"] == study.nodes.anchor_x["n2"] == 0.0, "n1 is held along yz"
    assert study.nodes.anchor_y["n2"] == 0.0, "n2 is held along z"
    # Supports that hold a rigid body add no self-stress state and leave the prism's mechanism.
    assert (len(study.statics.self_stresses), study.statics.mechanisms) == (1, 1)


def test_what_is_anchored_does_not_move_to_the_ground():
    scenario = scenario_of(HUNG).with_changes({"terrain": "!Flat"})
    assert study_equilibrium(Robot.of(scenario)).nodes.z["top"] == 1.0


def test_the_text_tells_of_anchors():
    study = study_equilibrium(Robot.of(scenario_of(HUNG)))
    text = structure_text(study)
    weight = study.robot.weight  # in N, the unit of the structure
    (row,) = [line for line in text.splitlines() if line.startswith("top")]
    assert [float(cell) for cell in row.split()[1:]] == pytest.approx([0, 0, weight], rel=1e-2)
    assert "ground, undamped" not in text


@pytest.mark.parametrize("scale", [5e-4, 1.0, 20.0])
def test_a_guyed_mast_of_any_size_keeps_its_tension_and_the_frequency_of_a_rigid_foot(scale):
    study = study_equilibrium(Robot.of(scenario_of(guyed_mast(scale))))
    tension, rope = TENSION * scale**2, math.hypot(SIZE, SPREAD) * scale
    assert study.cables.tension.to_numpy() == pytest.approx(tension, rel=3e-3)
    # Horizontal stiffness at the top: of the guys, elastic and by tension, less the thrust's.
    cos2, mass = (SPREAD * scale / rope) ** 2, study.robot.structure.mass.sum()
    lateral = 3e6 * scale * cos2 - 1.5 * tension / rope * cos2 - mass * G / (2.0 * SIZE * scale)
    swing = math.sqrt(3.0 * lateral / mass) / (2.0 * math.pi)
    assert study.frequencies[:2] == pytest.approx([swing, swing], rel=1e-4)
    stretch = tension / (2e6 * scale)
    assert -study.nodes.z["foot"] < 3e-3 * stretch  # the foot bears three guys
    assert (yielding_remark(study.robot) == "") == (scale >= 1.0), "the small one has a bound"


def test_a_foot_that_gives_way_by_a_twentieth_of_the_guys_stretch_is_told():
    robot = Robot.of(scenario_of(guyed_mast(anchor_stiffness=1e8)))
    told, foot = yielding_remark(robot), -node_positions(robot.structure, robot.equilibrium.state)
    assert "anchors.foot" in told
    assert f"{foot[robot.structure.node_names.index('foot'), 2]:.4g} m" in told
    assert told[1:] in structure_text(study_equilibrium(robot))


def test_without_cables_the_weight_moves_an_anchor_by_a_hundredth_of_a_millimetre_per_metre():
    bar = {key: value for key, value in SWINGING.items() if key != "anchor_stiffness"}
    study = study_equilibrium(Robot.of(scenario_of(bar)))
    assert -study.nodes.z["a"] == pytest.approx(1e-5 * 0.4, rel=1e-6)
