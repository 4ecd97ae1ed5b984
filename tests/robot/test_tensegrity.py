"""Structures from files at rest: an independent simulation's, and inertia by Drake's parts."""

import numpy as np
import pytest
from helpers.structures import driven_as_recorded, recorded_structure, unit_inertias
from pydrake.multibody.tree import SpatialInertia
from scipy.spatial.distance import pdist

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
    np.testing.assert_allclose(pdist(ours), pdist(theirs), atol=1e-6)

    resting = Unactuated(robot.model)
    force_at_rest(resting, structure.initial_state)
    tension = {cable["ends"][0] + cable["ends"][1]: i for i, cable in enumerate(recorded["cables"])}
    places = [tension["".join(name.split()[1:])] for name in structure.cable_names]
    expected = np.array(recorded["tensions_at_rest"])[places]
    np.testing.assert_allclose(resting.forces.cable_forces[:, TENSION], expected, rtol=1e-6)
    assert resting.forces.ground_forces[:, NORMAL].sum() == pytest.approx(robot.weight, rel=1e-9)
    assert robot.equilibrium.feet == np.count_nonzero(theirs[:, 2] < 0.0) == 3


def test_a_bent_body_with_a_motor_has_the_inertia_of_its_parts():
    scenario = load_scenario("mast").with_changes({"robot.masses": {"v2_front_low": "35 g"}})
    structure, group = Robot.of(scenario).structure, scenario.robot.struts["v2"]
    nodes = np.flatnonzero(structure.carriers == 1)
    motor, radius = structure.node_names.index("v2_front_low"), group.diameter / 2
    total = SpatialInertia.SolidSphereWithMass(0.035, 1e-9).Shift(-structure.p_BN[motor])
    for a, b in structure.struts[np.isin(structure.struts[:, 0], nodes)]:
        p_BA, p_BB = structure.p_BN[[a, b]]
        length = np.linalg.norm(p_BB - p_BA)
        rod = group.density, radius, length, (p_BB - p_BA) / length
        total += SpatialInertia.SolidCylinderWithDensity(*rod).Shift(-0.5 * (p_BA + p_BB))
    ball = SpatialInertia.SolidSphereWithDensity(group.density, group.node_diameter / 2)
    for node in nodes:
        total += ball.Shift(-structure.p_BN[node])
    assert structure.mass[1] == pytest.approx(total.get_mass(), rel=1e-12)
    found = structure.mass[1] * unit_inertias(structure)[1]
    expected = total.CalcRotationalInertia().CopyToFullMatrix3()
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(total.get_com(), 0.0, atol=1e-15)
