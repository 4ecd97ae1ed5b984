"""Structures from files at rest: against an independent simulation, and inertia by hand."""

import numpy as np
import pytest
from helpers.structures import driven_as_recorded, recorded_structure, unit_inertias

from tetra_drake.laws.cable import TENSION
from tetra_drake.laws.contact import NORMAL
from tetra_drake.robot.equilibrium import Unactuated, force_at_rest
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import node_positions
from tetra_drake.scenario.load import load_scenario


@pytest.mark.parametrize("name", ["prism", "six_bar"])
def test_rests_where_the_independent_simulation_does(name, data):
    recorded = recorded_structure(data, name)
    robot = Robot.of(load_scenario(name).with_sections(robot=driven_as_recorded(name)))
    structure = robot.structure
    ours = node_positions(structure, structure.initial_state)
    theirs = np.array([recorded["nodes_at_rest"][node] for node in structure.node_names])
    np.testing.assert_allclose(ours[:, 2], theirs[:, 2], atol=1e-6)
    np.testing.assert_allclose(distances(ours), distances(theirs), atol=1e-6)

    resting = Unactuated(robot.model)
    force_at_rest(resting, structure.initial_state)
    tension = {cable["ends"][0] + cable["ends"][1]: i for i, cable in enumerate(recorded["cables"])}
    places = [tension["".join(name.split()[1:])] for name in structure.cable_names]
    expected = np.array(recorded["tensions_at_rest"])[places]
    np.testing.assert_allclose(resting.forces.cable_forces[:, TENSION], expected, rtol=1e-6)
    assert resting.forces.ground_forces[:, NORMAL].sum() == pytest.approx(robot.weight, rel=1e-9)
    assert robot.equilibrium.feet == np.count_nonzero(theirs[:, 2] < 0.0) == 3


def distances(p_WN: np.ndarray) -> np.ndarray:
    """Of all nodes from each other."""
    return np.linalg.norm(p_WN[:, np.newaxis] - p_WN, axis=2)


def test_a_bent_body_with_a_motor_has_the_inertia_of_its_parts():
    scenario = load_scenario("mast").with_changes({"robot.masses": {"v2_front_low": "35 g"}})
    structure, group = Robot.of(scenario).structure, scenario.robot.struts["v2"]
    nodes = np.flatnonzero(structure.carriers == 1)
    radius, ball_radius = group.diameter / 2, group.node_diameter / 2
    parts = []  # of mass, place of the centre, inertia about it
    for a, b in structure.struts[np.isin(structure.struts[:, 0], nodes)]:
        along = structure.p_BN[b] - structure.p_BN[a]
        length = np.linalg.norm(along)
        mass, u = group.density * np.pi * radius**2 * length, along / length
        axial, across = mass * radius**2 / 2, mass * (radius**2 / 4 + length**2 / 12)
        inertia = across * np.eye(3) + (axial - across) * np.outer(u, u)
        parts.append((mass, structure.p_BN[a] + along / 2, inertia))
    ball = group.density * 4 / 3 * np.pi * ball_radius**3
    for node in nodes:
        parts.append((ball, structure.p_BN[node], 0.4 * ball * ball_radius**2 * np.eye(3)))
    motor = structure.node_names.index("v2_front_low")
    parts.append((0.035, structure.p_BN[motor], np.zeros((3, 3))))
    assert structure.mass[1] == pytest.approx(sum(mass for mass, _, _ in parts), rel=1e-12)
    total = sum(
        inertia + mass * ((p @ p) * np.eye(3) - np.outer(p, p)) for mass, p, inertia in parts
    )
    found = structure.mass[1] * unit_inertias(structure)[1]
    np.testing.assert_allclose(found, total, rtol=1e-9, atol=1e-15)
    centre = sum(mass * p for mass, p, _ in parts)
    np.testing.assert_allclose(centre, 0.0, atol=1e-15)  # kg m
