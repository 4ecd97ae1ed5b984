"""Events: cables that break, masses that fall off and friction that changes, on all engines."""

import itertools

import numpy as np
import pytest
from helpers.actuations import LIMITED
from helpers.anchored import floating_prism
from helpers.converged import shortly
from helpers.states import energy_and_momenta

from tetra_drake.engines.lanes.batch import LaneBatch
from tetra_drake.engines.simulate import simulate
from tetra_drake.laws.cable import MEETING
from tetra_drake.laws.kinematics import P_WN, V_WN
from tetra_drake.robot.command import Command, controlled_robot
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.robot.readings import Readings
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.signals import DrivenRobot
from tetra_drake.robot.structure import moved_nodes
from tetra_drake.scenario.disturbances import disturbed, draw_disturbances
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.scenario import Scenario

CUT, LOST, MASS = "T1-T2 outer top", "n0", 0.05


def test_a_cut_takes_the_energy_of_its_spring_and_a_loss_the_momentum_of_its_mass():
    changes = {f"robot.cables.{group}.damping": "0 N*s/m" for group in ("bottom", "side", "top")}
    changes["robot.offsets"] = [["0 m", "2 mm", "1 mm"], ["0 m"] * 3, ["3 mm", "0 m", "0 m"]]
    changes["robot.masses"] = {LOST: f"{MASS} kg"}
    changes["engine"] = "!Compiled {tolerance: 1e-7 m/s}"
    changes["events"] = [{"at": "0.2 s", "cut": ["side n3 n0"]}, {"at": "0.3 s", "lose": [LOST]}]
    scenario = floating_prism(duration=0.5, **changes)
    robot = controlled_robot(scenario)
    driven = DrivenRobot(robot=robot, name="still", samples=robot.first_signals[np.newaxis])
    batch = LaneBatch(driven, record=True)
    batch.advance()

    parts = batch.motion(0).by_phase(robot)
    sums = [
        np.array([energy_and_momenta(phase.robot, state) for state in part.states])
        for phase, part in parts
    ]
    size = np.abs(sums[0]).max() + 1e-4
    (number,) = np.flatnonzero(parts[1][0].robot.structure.cables["intact"] == 0.0)
    for k, (before, after) in enumerate(itertools.pairwise(sums)):
        structure = parts[k][0].robot.structure
        nodes, law = moved_nodes(structure, parts[k][1].states[-1]), structure.cables[number]
        p_WN, v_WN = (nodes[:, first : first + 3] for first in (P_WN, V_WN))
        if k == 0:
            length = np.linalg.norm(p_WN[law["node_b"]] - p_WN[law["node_a"]])
            energy = 0.5 * law["stiffness"] * (length - law["free_length"]) ** 2
            taken = np.array([energy, *np.zeros(6)])
        else:
            p, v = (x[structure.node_names.index(LOST)] for x in (p_WN, v_WN))
            taken = np.hstack([0.5 * MASS * v @ v, MASS * v, np.cross(p, MASS * v)])
        assert np.abs(taken).max() > 1e-5
        np.testing.assert_allclose(before[-1] - after[0], taken, rtol=0.0, atol=2e-5 * size)


@pytest.fixture
def walk(engine: str) -> Scenario:
    """A walk of two tetrahedra on an engine."""
    explicit = "!Drake {scheme: runge_kutta3}" if engine == "!Drake" else engine
    changes = {"engine": explicit, "robot.tetrahedra": 2, "friction.stiffness": "0 N/m"}
    return shortly(load_scenario("coulomb"), 0.3, **{"cpg.gain": "4 lbf"}).with_changes(changes)


def test_events_at_the_start_give_the_changed_scenario(walk):
    gait = seeded_gait(walk, 1)
    slippery = {"friction.kinetic": 0.1, "friction.static": 0.1}
    walks = [
        simulate(walk.with_changes(changes), gait, record=True).trajectory
        for changes in (slippery, {"events": [{"at": "0 s", "change": slippery}]}, {})
    ]
    changed, event, plain = (walk.p_WN.values for walk in walks)
    within = 1e-5 if walk.engine_name == "drake" else 1e-12  # its integrator begins anew
    np.testing.assert_allclose(event, changed, rtol=0.0, atol=within)
    assert np.abs(event - plain).max() > 1e-4


@pytest.mark.parametrize("at", [0.1303, 0.14])  # between two actions, and at the time of one
def test_a_cut_cable_has_no_tension_under_a_controller_and_a_command(walk, at):
    events = [{"at": f"{at} s", "cut": ["T1-T2 outer bottom_left"]}]
    scenario, seen = walk.with_changes({"events": events}), []
    actions = 2.0 + np.sin(np.arange(15))[:, np.newaxis] * [1.0, -1.0]

    def controller(time: float, readings: Readings) -> np.ndarray:
        seen.append(readings.tensions[0])
        return actions[round(time / 0.02)]

    controlled = simulate(scenario, controller=controller, record=True).trajectory
    command = simulate(scenario, command=Command("same", 0.02, actions), record=True).trajectory
    for trajectory in (controlled, command):
        tension = trajectory.tension.sel(cable="T1-T2 outer bottom_left")
        assert (tension[trajectory.time <= at] > 1.0).all()
        assert (tension[trajectory.time > at + 1e-3] == 0.0).all()
    knows = np.array(seen) == 0.0  # an action at the time of the event does not know of it yet
    assert knows.tolist() == [0.02 * period > at + 1e-3 for period in range(15)]
    within = 1e-3 if walk.engine_name == "drake" else 1e-6
    np.testing.assert_allclose(controlled.p_WN, command.p_WN, rtol=0.0, atol=within)


@pytest.mark.parametrize("kind", LIMITED)
def test_the_actuator_of_a_cut_cable_turns_freely(kind):
    prism = shortly(load_scenario("prism"), 0.5, engine="!Compiled", actuation=LIMITED[kind])
    driven = prism.robot.actuated[next(iter(prism.robot.actuated))][0]
    scenario = prism.with_changes({"events": [{"at": "0.2 s", "cut": [driven]}]})
    cable = simulate(scenario, seeded_gait(scenario, 1), record=True).trajectory.sel(cable=driven)
    after = cable.isel(time=cable.time.values > 0.2)
    assert (after.tension == 0.0).all() and (cable.tension[:5] > 0.0).all()
    start = float(cable.free_length[0])
    assert float(after.free_length[-1]) == pytest.approx(start, abs=1e-6)


def test_two_nodes_that_a_cut_lets_meet_cost_few_steps():
    changes = {"engine": "!Compiled", "simulation.duration": "2 s", "simulation.steady_from": "1 s"}
    whole = load_scenario("coulomb").with_changes(changes)
    cut = whole.with_changes({"events": [{"at": "1 s", "cut": ["T2-T3 inner bottom_left"]}]})
    walks = [simulate(each, seeded_gait(whole, 1), record=True) for each in (whole, cut)]
    assert walks[1].trajectory.length[-1].min() < MEETING
    assert walks[1].integrator.steps < 10 * walks[0].integrator.steps


def test_drawn_missing_cables_repeat_with_their_seed():
    cuts = {"draws": 3, "cuts": {"count": 2, "at": "0.1 s"}}
    events = [{"at": "0.2 s", "cut": [CUT]}]
    scenario = load_scenario("thesis").with_changes({"events": events, "disturbances": cuts})
    draws = [draw_disturbances(scenario, (seed,)) for seed in (*range(40), 0)]
    assert draws[0].events == draws[-1].events != draws[1].events
    names = {name for draw in draws for event in draw.events for name in event.cut}
    assert len(names) == 23 and CUT not in names
    changed = disturbed(scenario, draws[0])
    first, *_ = Robot.of(changed).phases[1:]
    assert first.begins == 0.1
    cut = np.array(first.robot.structure.cable_names)[first.robot.model.cables.law.intact == 0.0]
    assert cut.tolist() == changed.events[1].cut and len(cut) == 2
