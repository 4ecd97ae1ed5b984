"""Bars that touch, against analytic results, Drake's own contact, and engine against engine."""

import math

import numpy as np
import pytest
from helpers.bars import ACROSS, CROSSED, RADIUS, STIFFNESS, loose_bars
from helpers.states import mass_matrix
from helpers.structures import poses_of, simulated, thrown
from pydrake.geometry import (
    AddContactMaterial,
    Capsule,
    ProximityProperties,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import DiagramBuilder

from tetra_drake.physics.forces import Forces, compute_state_forces
from tetra_drake.robot.gait import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import AddBodies, moved_nodes
from tetra_drake.simd.packed import Packed
from tetra_drake.systems.diagram import MakeTensegrityDiagram


def moving(robot: Robot, *velocities: list[float]) -> Robot:
    """A robot whose bodies move at t = 0 with [angular velocity (rad/s), velocity (m/s)]."""
    return thrown(robot, np.array(velocities))


def final_state(robot: Robot) -> np.ndarray:
    """State at the end on the compiled engine."""
    return simulated(robot)[1].states[-1]


def diagram_state(robot: Robot, duration: float) -> np.ndarray:
    """State after a duration (s) on the diagram, with small errors."""
    diagram = MakeTensegrityDiagram(robot, seeded_gait(robot.scenario))
    simulator = Simulator(diagram)
    ResetIntegratorFromFlags(simulator, "runge_kutta3", 1e-4).set_target_accuracy(1e-9)
    simulator.get_mutable_context().SetContinuousState(robot.structure.initial_state)
    simulator.AdvanceTo(duration)
    return diagram.GetOutputPort("state").Eval(simulator.get_context())


def momenta_and_energy(robot: Robot, state: np.ndarray) -> tuple[np.ndarray, float]:
    """Momentum and angular momentum about the origin (6,), and kinetic energy."""
    poses = poses_of(state[np.newaxis])[0]
    v = state[poses.size :]
    wrench = (mass_matrix(robot.model, state) @ v).reshape(-1, 6)
    angular = (wrench[:, :3] + np.cross(poses[:, 4:], wrench[:, 3:])).sum(axis=0)
    return np.concatenate([wrench[:, 3:].sum(axis=0), angular]), 0.5 * v @ wrench.ravel()


def rebound_speed(speed: float, dissipation: float) -> float:
    """Speed (m/s) after an impact by Hunt and Crossley's law with n = 1.

    m v dv/dd = -k d (1 + c v) has the integral v / c - ln(1 + c v) / c² + k d² / (2 m): it is the
    same at both ends of the impact, where d = 0.
    """

    def potential(v: float) -> float:
        return v / dissipation - math.log(1.0 + dissipation * v) / dissipation**2

    low, high = -min(speed, (1.0 - 1e-12) / dissipation), 0.0
    for _ in range(100):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if potential(middle) > potential(speed) else (low, middle)
    return -high


@pytest.mark.parametrize("dissipation", [0.5, 3.0])
def test_two_bars_rebound_as_hunt_and_crossley_say(dissipation):
    still, falling = [0.0] * 6, [0.0, 0.0, 0.0, 0.0, 0.0, -0.3]
    robot = moving(loose_bars(ACROSS, dissipation=dissipation, duration=0.2), still, falling)
    v_WB = final_state(robot)[14:].reshape(2, 6)
    np.testing.assert_allclose(v_WB[:, :5], 0.0, atol=1e-6)
    expected = rebound_speed(0.3, dissipation)
    assert v_WB[1, 5] - v_WB[0, 5] == pytest.approx(expected, abs=2e-4)
    assert v_WB[:, 5].sum() == pytest.approx(-0.3, abs=1e-6), "momentum"


def tumbling(dissipation: float, duration: float) -> Robot:
    """Two bars that tumble towards each other and touch several times."""
    first, second = [3.0, 2.0, -1.0, 0.1, 0.0, 0.1], [-2.0, 4.0, 3.0, 0.0, 0.05, -0.1]
    return moving(loose_bars(ACROSS, dissipation=dissipation, duration=duration), first, second)


def test_an_impact_without_dissipation_keeps_momenta_and_energy():
    robot = tumbling(0.0, 0.5)
    before, energy = momenta_and_energy(robot, robot.structure.initial_state)
    after, energy_after = momenta_and_energy(robot, final_state(robot))
    np.testing.assert_allclose(after, before, atol=1e-6 * np.abs(before).max())
    assert energy_after == pytest.approx(energy, rel=1e-3)


def test_bars_that_tumble_move_alike_on_both_engines():
    robot = tumbling(1.0, 2.0)
    state, on_diagram = final_state(robot), diagram_state(robot, 2.0)
    np.testing.assert_allclose(poses_of(on_diagram[None]), poses_of(state[None]), atol=1e-5)


def test_a_bar_rests_across_two_others_where_the_contact_bears_its_weight():
    beams = [((-0.1, y, 0.0), (0.1, y, 0.0)) for y in (-0.05, 0.05)]
    across = ((0.0, -0.1, 2.0 * RADIUS), (0.0, 0.1, 2.0 * RADIUS))
    robot = loose_bars([*beams, across], dissipation=1.0, gravity=9.80665, anchors=CROSSED)
    heights = moved_nodes(robot.structure, robot.structure.initial_state)[:, 5]
    depth = 2.0 * RADIUS - (heights[-1] - heights[0])
    assert 2.0 * STIFFNESS * depth == pytest.approx(robot.weight / 3.0, rel=1e-6)
    moved = final_state(robot) - robot.structure.initial_state
    np.testing.assert_allclose(moved, 0.0, atol=1e-6)


def drake_state(robot: Robot, dissipation: float, duration: float) -> np.ndarray:
    """State after a duration (s) with Drake's own point contact of capsules."""
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, time_step=0.0)
    for body, (a, b) in zip(AddBodies(plant, robot.structure), robot.structure.struts, strict=True):
        start, end = robot.structure.p_BN[a], robot.structure.p_BN[b]
        pose = RigidTransform(RotationMatrix.MakeFromOneVector(end - start, 2), (start + end) / 2)
        properties = ProximityProperties()
        # Two equal springs in series.
        AddContactMaterial(dissipation, 2.0 * STIFFNESS, CoulombFriction(0.0, 0.0), properties)
        shape = Capsule(RADIUS, float(np.linalg.norm(end - start)))
        plant.RegisterCollisionGeometry(body, pose, shape, body.name(), properties)
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, 0.0])
    plant.Finalize()
    simulator = Simulator(builder.Build())
    ResetIntegratorFromFlags(simulator, "runge_kutta3", 1e-4).set_target_accuracy(1e-9)
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    plant.SetPositionsAndVelocities(context, robot.structure.initial_state)
    simulator.AdvanceTo(duration)
    return plant.GetPositionsAndVelocities(context)


def test_bars_that_tumble_move_as_drakes_capsules():
    robot = tumbling(1.0, 0.5)
    state, expected = final_state(robot), drake_state(robot, 1.0, 0.5)
    np.testing.assert_allclose(poses_of(state[None]), poses_of(expected[None]), atol=1e-4)


def test_forces_do_not_depend_on_when_near_struts_were_searched():
    robot = tumbling(0.0, 0.5)
    states = simulated(robot)[1].states

    def forces_at(state: np.ndarray, memory: Forces) -> np.ndarray:
        force = np.empty(12)
        compute_state_forces(Packed((robot.model, memory)), state, force)
        return force

    kept = Forces.of(robot.model)
    forces = np.array([forces_at(state, kept) for state in states])
    anew = np.array([forces_at(state, Forces.of(robot.model)) for state in states])
    assert 3 < np.count_nonzero(anew.any(axis=1)) < len(states)
    np.testing.assert_array_equal(forces, anew)


@pytest.mark.parametrize("where", ["nodes", "offsets"])
def test_struts_that_overlap_at_the_start_are_named(refused, where):
    through = (ACROSS[0], ((0.0, -0.1, 0.0075), (0.0, 0.1, 0.0075)))  # 0.5 mm too near
    with refused("prism", "strut_contact", "a0 b0", "a1 b1", "0.5 mm"):
        if where == "nodes":
            loose_bars(through, dissipation=1.0)
        else:
            scenario = loose_bars(ACROSS, dissipation=1.0).scenario
            offsets = [["0 m", "0 m", "1 m"], ["0 m", "0 m", "0.9875 m"]]
            Robot.of(scenario.with_changes({"robot.offsets": offsets}))
