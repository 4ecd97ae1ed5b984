"""Momentum, angular momentum and energy of a falling robot, on the engines of the package."""

import numpy as np
import pytest
from helpers.quantities import with_unit
from helpers.states import body_velocities

from tetra_drake.engines.simulate import simulate
from tetra_drake.physics.inertia import XX
from tetra_drake.robot.gait import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.engine_kinds import Compiled, Drake

G = 9.80665
FALLING = {
    # Bodies are off their balance by some 5 mm, a metre above the ground.
    "robot.offsets": with_unit(np.random.default_rng(0).normal([0, 0, 1], 0.005, (3, 3)), "m"),
    "robot.tetrahedra": 3,
    "robot.gravity": with_unit(G, "m/s^2"),
    "robot.cables.damping": 0.0,
    "cpg.gain": 0.0,
    "simulation.duration": "0.2 s",
    "simulation.steady_from": "0.1 s",
}


@pytest.mark.parametrize(
    "engine",
    [Drake(scheme="runge_kutta3", accuracy=1e-9, max_step=1e-3), Compiled(tolerance=1e-7)],
    ids=["drake", "compiled"],
)
def test_a_falling_robot_keeps_momentum_and_energy(scenario, engine):
    falling = scenario.with_changes({**FALLING, "engine": engine})
    robot = Robot.of(falling)
    structure, bodies = robot.structure, robot.model.bodies
    mass, moment = bodies.mass[0], bodies.inertia[0, XX]
    flight = simulate(scenario=falling, gait=seeded_gait(falling), record=True).trajectory
    assert flight is not None
    t, p_WB = flight.time.values, flight.p_WB.values
    v_WB, w_WB = body_velocities(flight, structure)

    # The centre of mass falls as Galilei says.
    height = p_WB[0, :, 2].mean() - G * t**2 / 2.0
    np.testing.assert_allclose(p_WB.mean(axis=1)[:, 2], height, atol=1e-9)
    np.testing.assert_allclose(v_WB.mean(axis=1), np.outer(-G * t, [0, 0, 1]), atol=1e-9)
    # About the centre of mass: angular momentum; kinetic and elastic energy.
    p_CB, v_CB = p_WB - p_WB.mean(axis=1, keepdims=True), v_WB - v_WB.mean(axis=1, keepdims=True)
    angular = moment * w_WB + mass * np.cross(p_CB, v_CB)
    np.testing.assert_allclose(angular.sum(axis=1), 0.0, atol=1e-7 * np.abs(angular).max())
    kinetic = 0.5 * (mass * v_CB**2 + moment * w_WB**2).sum(axis=(1, 2))
    stretch = flight.length.values - structure.cables["free_length"]
    elastic = 0.5 * stretch**2 @ structure.cables["stiffness"]
    np.testing.assert_allclose(kinetic + elastic, elastic[0], atol=1e-6 * kinetic.max())
