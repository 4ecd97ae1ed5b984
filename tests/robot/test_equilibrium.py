"""The robot at rest: against an independent simulation, a walk that is not driven, and statics."""

import json

import numpy as np
import pytest
from helpers.quantities import with_unit

from tetra_drake.engines.simulate import simulate
from tetra_drake.robot import equilibrium
from tetra_drake.robot.bodies import tetrahedron_inertia
from tetra_drake.robot.equilibrium import settled_lengths, settled_state
from tetra_drake.robot.gait import seeded_gait
from tetra_drake.robot.structure import BOTTOM_LEFT, TIP, MakeStructure, node_positions
from tetra_drake.scenario.friction_kinds import Coulomb
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.terrain_kinds import Incline
from tetra_drake.scenario.units import INCH, POUND_FORCE


def normal_forces(scenario: Scenario) -> np.ndarray:
    """(contacts,) in N at rest: stiffness times depth."""
    structure = MakeStructure(scenario)
    height = node_positions(structure, settled_state(scenario))[structure.contacts, 2]
    return scenario.ground.stiffness * np.maximum(0.0, -height)


def weight(scenario: Scenario) -> float:
    mass = tetrahedron_inertia(MakeStructure(scenario)).get_mass()
    return scenario.robot.tetrahedra * mass * scenario.robot.gravity


def test_rests_where_the_independent_simulation_does(scenario, structure, data):
    # Its normal forces are 7e-6 off our weight (the digits of its mass, and what still moved).
    expected = json.loads((data / "expected.json").read_text())["settled"]
    p_WN = node_positions(structure, settled_state(scenario)) / INCH
    spacing = np.diff(p_WN[BOTTOM_LEFT::4, 0])
    np.testing.assert_allclose(spacing, expected["spacing_in"], rtol=1e-5)
    assert p_WN[4 * 4 + TIP, 2] == pytest.approx(expected["tip5_height_in"], rel=1e-5)
    normal = normal_forces(scenario) / POUND_FORCE
    atol = 1e-5 * expected["normal_sum_lbf"]
    np.testing.assert_allclose(normal, expected["normals"], atol=atol)


@pytest.mark.parametrize(
    "changes",
    [
        {
            "robot.tetrahedra": 3,
            "robot.offsets": [[0, 0, 0], ["2 mm", "1 mm", "1 mm"], [0, 0, "3 mm"]],
        },
        # Base triangles so near that the robot tips forward, onto the lead's tip.
        {"robot.tetrahedra": 2, "robot.spacing": "0.055 m", "cables.inner_stiffness": "26.0 N/m"},
    ],
)
def test_a_walk_that_is_not_driven_ends_there(scenario, changes):
    # Feet creep under stiction: an error of 3 mm at the start falls to 2e-7 of a length in 20 s.
    still = {
        "cpg.start_up": "100.0 s",
        "simulation.duration": "20.0 s",
        "simulation.engine": "compiled",
    }
    scenario = scenario.with_changes(still | changes)
    walk = simulate(scenario=scenario, gait=seeded_gait(scenario, 0), record=True).trajectory
    np.testing.assert_allclose(walk.length[-1], settled_lengths(scenario), rtol=1e-6)


@pytest.mark.parametrize(
    ("changes", "slack"),
    [
        ({"robot.strut_length": "0.25 m", "robot.gravity": "1.6 m/s^2"}, 0),
        # Cables of 0.12 m: the tetrahedra lean forward, and only those from tips to tops hold them.
        ({"robot.spacing": "0.08 m", "cables.free_length": "0.12 m", "robot.contacts": "all"}, 20),
    ],
)
def test_no_force_is_left_on_any_body(scenario, changes, slack):
    scenario = scenario.with_changes(changes | {"cables.slack": True})
    structure, state = MakeStructure(scenario), settled_state(scenario)
    p_WN, bodies, cables = node_positions(structure, state), len(structure.bodies), structure.cables
    force = np.zeros_like(p_WN)
    force[structure.contacts, 2] = normal_forces(scenario)
    along = p_WN[cables["node_b"]] - p_WN[cables["node_a"]]
    length = np.linalg.norm(along, axis=1)
    np.testing.assert_allclose(settled_lengths(scenario), length, rtol=0, atol=0.51e-9)
    tension = np.maximum(0.0, cables["stiffness"] * (length - cables["free_length"]))
    assert (tension == 0.0).sum() == slack
    pull = along * (tension / length)[:, np.newaxis]
    np.add.at(force, cables["node_a"], pull)
    np.add.at(force, cables["node_b"], -pull)
    by_body, p_WB = force.reshape(-1, 4, 3), state[: 7 * bodies].reshape(-1, 1, 7)[..., 4:]
    total = by_body.sum(axis=1) - [0.0, 0.0, weight(scenario) / bodies]
    torque = np.cross(p_WN.reshape(-1, 4, 3) - p_WB, by_body).sum(axis=1)
    assert np.abs(total).max() < 1e-9 * weight(scenario)
    assert np.abs(torque).max() < 1e-9 * weight(scenario) * scenario.robot.strut_length


def test_the_lengths_do_not_depend_on_how_the_solver_gets_there(scenario):
    # It gets there in other last digits on another processor, and so it does from another start.
    elsewhere = scenario.with_changes({"robot.spacing": f"{1.01 * scenario.robot.spacing} m"})
    spacings = [np.diff(settled_state(start)[4:35:7]).tolist() for start in (scenario, elsewhere)]
    assert spacings[0] != spacings[1]
    assert np.array_equal(settled_lengths(elsewhere), settled_lengths(scenario))


def test_neither_terrain_nor_offsets_nor_friction_matter(scenario):
    elsewhere = scenario.with_changes(
        {
            "terrain": Incline(slope=0.2, start=None),
            "friction": Coulomb(stiffness=100.0),
            "robot.offsets": with_unit([[0.01 * i, 0.01, 0.1] for i in range(5)], "m"),
        }
    )
    assert np.array_equal(settled_state(elsewhere), settled_state(scenario))


def test_a_robot_that_finds_no_rest_is_refused_by_name(scenario, refused, monkeypatch):
    monkeypatch.setattr(equilibrium, "ITERATIONS", 2)
    with refused("thesis", "robot", "no rest"):
        settled_state(scenario)
