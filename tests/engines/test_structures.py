"""Structures: against an independent simulation, what they sense, and robots that nothing drives.

In tests/data/structures.json sines pull at the cables of structures at rest. After 5 s, starts
1e-7 m apart end 3e-7 m apart there, and half the step makes a difference of 9e-8 m.
"""

import json

import numpy as np
import pytest
from helpers.anchored import BAR, floating_prism
from helpers.converged import shortly
from helpers.structures import (
    driven_as_recorded,
    recorded_structure,
)
from scipy.spatial.transform import Rotation

from tetra_drake.engines.engine import engine_of
from tetra_drake.engines.simulate import simulate, simulate_many
from tetra_drake.laws.cable import LENGTH
from tetra_drake.laws.contact import CONTACT, MODE_COLUMNS, NORMAL
from tetra_drake.laws.feedback import Gains, sense
from tetra_drake.laws.forces import Forces
from tetra_drake.report import run_page
from tetra_drake.report.result_folder import save_result
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.signals import DrivenRobot
from tetra_drake.robot.structure import node_positions
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.robot_structure import StructureFile


@pytest.mark.parametrize("name", ["prism", "six_bar"])
def test_driven_structures_move_as_the_independent_simulation(name, data):
    recorded = recorded_structure(data, name)
    scenario = load_scenario(name).with_sections(robot=driven_as_recorded(name))
    # Coulomb friction without bristles, as in MuJoCo and in the independent simulation.
    changes = {"friction.stiffness": "0 N/m", "cpg.listing_step": "1 ms"}
    changes |= {"engine": "!Compiled {tolerance: 1e-6 m/s}", "simulation.sample_period": "0.5 s"}
    robot = Robot.of(shortly(scenario, 5.0, **changes))
    times = 1e-3 * np.arange(5002)[:, np.newaxis]
    sines = 1.5 * np.sin(2.0 * np.pi * times + recorded["drive"]["phase"])  # in N
    driven = DrivenRobot(robot=robot, name="sines", samples=sines)
    walk = engine_of(robot.scenario).simulate(driven, record=True).trajectory
    theirs = np.array([recorded["nodes_at_rest"][node] for node in walk.node.values])
    origin, ours = theirs.mean(axis=0), walk.p_WN[0].mean("node").values
    turn, _ = Rotation.align_vectors(theirs - origin, walk.p_WN[0] - ours)
    there = turn.apply(walk.p_WB.mean("body") - ours) + origin
    expected = np.array(recorded["drive"]["centre_of_bars"])[: len(there)]
    assert np.ptp(expected, axis=0).max() > 3e-3, "it moves"
    np.testing.assert_allclose(there, expected, atol=2e-6)


BRIEF = {"cpg.start_up": "0.2 s", "simulation.duration": "1 s", "simulation.steady_from": "0.4 s"}


def felt(robot: Robot, *, longer: float = 1.0, pushes: float = 0.0, **gains: float):
    """(oscillators, 2): the feedback to extensor and flexor of a robot in its pose of rest, whose
    cables are longer by a factor, and whose contacts near the ground bear some force in N each."""
    structure, state = robot.structure, robot.equilibrium.state
    p_WN = node_positions(structure, state)
    along = p_WN[structure.cables["node_a"]] - p_WN[structure.cables["node_b"]]
    forces, feedback = Forces.of(robot.model), np.empty(2 * structure.signals)
    forces.cable_forces[:, LENGTH] = longer * np.linalg.norm(along, axis=1)
    forces.ground_forces[:, NORMAL] = pushes * (p_WN[structure.contacts, 2] < 0.02)
    modes = np.zeros((len(structure.contacts), MODE_COLUMNS))
    modes[:, CONTACT] = forces.ground_forces[:, NORMAL] > 0.0
    table = np.array(Gains(**gains))
    sense(robot.senses, table, state, modes, forces, feedback)
    return feedback.reshape(-1, 2)


GROUPS = {"robot.actuation": [["outer bottom_left", "outer bottom_right"], ["inner top"]]}
FELT = [("thesis", GROUPS), *((name, {}) for name in ("prism", "six_bar", "mast", "pair"))]


@pytest.mark.parametrize(("name", "changes"), FELT)
def test_oscillators_feel_longer_cables_and_what_their_bodies_bear(name, changes):
    live = {"cpg.signals": "live", "cpg.feedback": ["length", "load"]}
    robot = Robot.of(load_scenario(name).with_changes(live | changes))
    # 10 % longer, times the gain: 0.05 on the extensor, however many cables a group has.
    for longer, expected in ((1.0, 0.0), (1.1, 0.05)):
        found = felt(robot, length=0.5, longer=longer)
        np.testing.assert_allclose(found - [expected, -expected], 0.0, atol=1e-6)
    if name == "prism":  # each bar bears a third of the weight
        loads = felt(robot, load=0.6, pushes=robot.weight / 3.0)
        np.testing.assert_allclose(loads, 0.6 / 3.0)


def test_a_structure_walks_as_far_as_its_centre_of_mass():
    heavy = load_scenario("prism").with_changes(BRIEF | {"robot.masses": {"n4": "50 g"}})
    result = simulate(scenario=heavy, gait=seeded_gait(heavy, 3), record=True)
    way = result.trajectory.p_WB[-1] - result.trajectory.p_WB[0]
    mass = Robot.of(heavy).structure.mass
    x, y, _ = mass @ way.values / mass.sum()
    start, *_, end = result.path.centre
    assert end - start == pytest.approx(mass @ way.values / mass.sum(), abs=1e-9)
    assert result.metrics.distance == pytest.approx(x, abs=1e-9)
    assert result.metrics.lateral_drift == pytest.approx(abs(y), abs=1e-9)
    assert abs(float(way.mean("body")[0]) - x) > 1e-4, "the mean of the bodies goes another way"


LIFTED_BAR = {
    "nodes": {"a": [0.0, 0.0, 0.0], "b": [0.2, 0.0, 0.0]},
    "struts": {"bar": BAR},
    "offsets": [[0.0, 0.0, 0.02]],
}
UNDRIVEN = {
    "a pair whose cables nothing drives": ("pair", {"robot.actuated": {}}),
    "a body without cables": ("prism", {"robot": StructureFile.model_validate(LIFTED_BAR)}),
}


@pytest.mark.parametrize(("name", "changes"), UNDRIVEN.values(), ids=UNDRIVEN)
@pytest.mark.parametrize("signals", ["listing", "live"])
def test_a_robot_that_nothing_drives_falls_and_rests(engine, name, changes, signals):
    brief = BRIEF | {"simulation.duration": "0.7 s", "cpg.signals": signals}
    changes = brief | {"engine": engine, "friction.stiffness": "0 N/m"} | changes
    scenario = load_scenario(name).with_changes(changes)
    (result,) = simulate_many(scenario, [seeded_gait(scenario)], record=True)
    robot, end = Robot.of(scenario), result.trajectory.isel(time=-1)
    heights = node_positions(robot.structure, robot.equilibrium.state)[:, 2]
    np.testing.assert_allclose(end.p_WN.sel(axis="z"), heights, atol=1e-5)
    assert float(end.normal_force.sum()) == pytest.approx(robot.weight, rel=1e-3)
    assert result.metrics.actuator_work == result.metrics.signal_rate == 0.0


def test_what_a_structure_lacks_is_null_in_its_result(tmp_path):
    scenario = load_scenario("prism").with_changes(BRIEF)
    save_result(tmp_path / "result.json", simulate(scenario, seeded_gait(scenario, 3)))
    saved = json.loads((tmp_path / "result.json").read_text())
    lacking = {name for name, value in saved["metrics"].items() if value is None}
    assert lacking == {"twist", "lead", "heading_change", "actuator_limited"}
    assert saved["twist_in"] is None
    assert set(saved["path"]["heading_rad"]) == {None}


def test_pictures_of_a_lifted_robot_leave_out_the_ground():
    scenario = floating_prism(duration=0.2)
    result = simulate(scenario, seeded_gait(scenario, 3), record=True)
    assert result.trajectory.sizes["contact"] == 0
    assert result.metrics.lifted == 1.0
    pictures = [draw for part in run_page.pictures_of_gait(result).values() for draw in part]
    assert "ground_forces" not in {draw.func.__name__ for draw in pictures}
    assert all(draw().axes for draw in pictures) and len(pictures) > 3
