"""Anchored and loaded structures at rest: balance, frequencies, statics, text and page."""

import math

import numpy as np
import pytest
from helpers.anchored import BAR, HUNG, SWINGING, scenario_of, supported_prism

from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.robot_structure import StructureFile
from tetra_drake.study.equilibrium import structure_text, study_equilibrium

G = 9.80665
K = 200.0  # N/m, of the cable of HUNG


def test_a_mass_hangs_by_the_stretch_of_its_cable_and_bounces_as_a_spring():
    robot = Robot.of(scenario_of(HUNG))
    study, mass = study_equilibrium(robot), robot.structure.mass.sum()
    assert study.cables.tension["line top a"] == pytest.approx(mass * G, rel=1e-10)
    assert study.nodes.z["a"] == pytest.approx(0.6 - mass * G / K, abs=1e-12)
    assert study.nodes.anchor_z["top"] == pytest.approx(mass * G, rel=1e-10)
    bounce = math.sqrt(K / mass) / (2.0 * math.pi)
    assert min(abs(study.frequencies / bounce - 1.0)) < 1e-8
    # It swings in two ways in two planes.
    assert (len(study.statics.self_stresses), study.statics.mechanisms) == (0, 4)


def test_a_held_bar_swings_at_the_frequency_of_a_physical_pendulum():
    robot = Robot.of(scenario_of(SWINGING))
    structure, study = robot.structure, study_equilibrium(robot)
    mass, lever = structure.mass[0], np.linalg.norm(structure.p_BN[0])
    moment = mass * (structure.unit_inertia[0, 0] + lever**2)
    swing = math.sqrt(mass * G * lever / moment) / (2.0 * math.pi)
    assert study.frequencies[:2] == pytest.approx([swing, swing], rel=1e-5)
    assert study.statics.mechanisms == 2
    # The anchor bears the weight by giving way.
    assert study.nodes.z["a"] == pytest.approx(-mass * G / 1e6, rel=1e-6)
    assert study.nodes.anchor_z["a"] == pytest.approx(mass * G, rel=1e-6)


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


def test_what_is_anchored_neither_moves_to_the_ground_nor_turns_with_an_incline(refused):
    scenario = scenario_of(HUNG).with_changes({"terrain": "!Flat"})
    assert study_equilibrium(Robot.of(scenario)).nodes.z["top"] == 1.0
    with refused("anchored", "terrain", "anchors"):
        Robot.of(scenario_of(HUNG).with_changes({"terrain": "!Incline {slope: 3 deg}"}))


def test_the_text_tells_of_anchors():
    study = study_equilibrium(Robot.of(scenario_of(HUNG)))
    text = structure_text(study)
    weight = study.robot.weight  # in N, the unit of the structure
    (row,) = [line for line in text.splitlines() if line.startswith("top")]
    assert [float(cell) for cell in row.split()[1:]] == pytest.approx([0, 0, weight], rel=1e-2)
    assert "ground, undamped" not in text


def test_bodies_may_be_joined_by_the_world_alone():
    two = {"a": [0.0, 0.0, 0.5], "b": [0.0, 0.0, 0.3], "c": [0.2, 0.0, 0.5], "d": [0.2, 0.0, 0.3]}
    bars = {"bar": BAR | {"pairs": [["a", "b"], ["c", "d"]]}}
    tree = {"nodes": two, "struts": bars, "anchors": {"a": "xyz", "c": "xyz"}}
    assert StructureFile.model_validate(tree).body_count == 2
