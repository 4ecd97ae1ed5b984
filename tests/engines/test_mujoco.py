"""The robot in MuJoCo is ours: bodies, cables, actuation, weight; only the ground differs."""

from __future__ import annotations

import json
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tetra_drake.engines.mujoco import (
    INSTALL,
    control_signals,
    installed,
    make_mjcf,
    mujoco_kept_quiet,
    walk_in_mujoco,
)
from tetra_drake.physics.cable import PASSIVE, cable_forces
from tetra_drake.robot.bodies import tetrahedron_inertia
from tetra_drake.robot.gait import seeded_gait
from tetra_drake.robot.signals import even_samples
from tetra_drake.robot.structure import MakeStructure
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.units import INCH, POUND_FORCE

pytestmark = pytest.mark.skipif(not installed(), reason=f"needs MuJoCo: {INSTALL}")

STEP = 0.25e-3  # s


def make_model(scenario: Scenario) -> tuple[Any, Any]:
    """MuJoCo's model and data of the robot."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(make_mjcf(scenario, integrator="Euler", step=STEP))
    return model, mujoco.MjData(model)


@pytest.fixture(params=[2, 5, 8])
def robot(request: pytest.FixtureRequest, scenario: Scenario) -> Scenario:
    """Robots of several sizes."""
    scenario.robot.tetrahedra = request.param
    return scenario


def test_bodies_have_our_mass_and_inertia(robot: Scenario) -> None:
    model, _ = make_model(robot)
    inertia = tetrahedron_inertia(MakeStructure(robot.robot, robot.cables))
    assert model.nbody == 1 + robot.robot.tetrahedra
    np.testing.assert_allclose(model.body_mass[1:], inertia.get_mass(), rtol=1e-12)
    moments = inertia.get_mass() * inertia.get_unit_inertia().get_moments()
    for found in model.body_inertia[1:]:
        np.testing.assert_allclose(found, moments, rtol=1e-12)
    assert model.opt.gravity[2] == -robot.robot.gravity


def test_cables_are_as_long_as_ours_at_the_start(robot: Scenario) -> None:
    import mujoco

    model, data = make_model(robot)
    mujoco.mj_forward(model, data)
    structure = MakeStructure(robot.robot, robot.cables)
    p_WN = (structure.p_WB[:, None] + structure.p_BN).reshape(-1, 3)
    way = p_WN[structure.cables["node_b"]] - p_WN[structure.cables["node_a"]]
    np.testing.assert_allclose(data.ten_length, np.linalg.norm(way, axis=1), rtol=1e-12)


def test_cables_and_motors_pull_as_ours_do_on_bodies_that_move(robot: Scenario) -> None:
    import mujoco

    model, data = make_model(robot)
    structure = MakeStructure(robot.robot, robot.cables)
    bodies = len(structure.bodies)
    generator = np.random.default_rng(0)
    state = structure.initial_state
    p_WB = state[: 7 * bodies].reshape(bodies, 7)[:, 4:]
    p_WB += generator.normal(scale=0.01, size=p_WB.shape)
    v_WB = generator.normal(scale=0.1, size=(bodies, 6))  # ours: angular, linear
    state[7 * bodies :] = v_WB.ravel()
    signals = generator.normal(size=structure.signals)

    force = np.zeros(6 * bodies)
    tensions, lengths = np.empty((2, len(structure.cables)))
    cable_forces(state, signals, structure.p_BN, structure.cables, False, force, tensions, lengths)
    data.qpos[:] = np.column_stack([p_WB, np.tile([1.0, 0.0, 0.0, 0.0], (bodies, 1))]).ravel()
    data.qvel[:] = v_WB[:, [3, 4, 5, 0, 1, 2]].ravel()
    driven = structure.cables["signal"]
    data.ctrl[:] = signals[driven[driven != PASSIVE]]
    mujoco.mj_forward(model, data)
    found = (data.qfrc_passive + data.qfrc_actuator).reshape(bodies, 6)[:, [3, 4, 5, 0, 1, 2]]
    np.testing.assert_allclose(found, force.reshape(bodies, 6), rtol=1e-9, atol=1e-10)


def test_motors_get_the_signals_of_their_cables_after_the_start_up(scenario: Scenario) -> None:
    gait, step = seeded_gait(scenario), scenario.cpg.listing_step
    control = control_signals(scenario, gait, step=step, steps=5000)
    samples = even_samples(scenario, gait)[:5000]
    active = np.arange(5000) * step >= scenario.cpg.start_up - 1e-9
    assert not control[~active].any()
    # The two bottom outer cables of each junction have the same signal.
    for motor in range(8):
        np.testing.assert_allclose(
            control[active, motor], samples[active, motor // 2], rtol=1e-9, atol=1e-12
        )


def test_at_rest_the_ground_bears_the_weight_and_the_pose_is_ours(
    scenario: Scenario, data: Path
) -> None:
    import mujoco

    model, mujoco_data = make_model(scenario)
    for _ in range(round(1.2 / STEP)):
        mujoco.mj_step(model, mujoco_data)
    borne, wrench = 0.0, np.zeros(6)
    for i in range(mujoco_data.ncon):
        mujoco.mj_contactForce(model, mujoco_data, i, wrench)
        borne += wrench[0]
        # Our spring: normal force = stiffness x depth.
        depth = -mujoco_data.contact[i].dist
        assert wrench[0] == pytest.approx(scenario.ground.stiffness * depth, rel=1e-2)
    settled = json.loads((data / "expected.json").read_text())["settled"]
    assert borne / POUND_FORCE == pytest.approx(settled["normal_sum_lbf"], rel=1e-3)
    spacing = np.diff(mujoco_data.xpos[1:, 0]) / INCH
    np.testing.assert_allclose(spacing, settled["spacing_in"], atol=0.05)
    tip = mujoco_data.site_xpos[-1, 2] / INCH
    assert tip == pytest.approx(settled["tip5_height_in"], abs=0.05)


def test_the_same_gait_goes_equally_far_in_any_thread(scenario: Scenario) -> None:
    scenario.simulation.duration, scenario.cpg.start_up = 0.4, 0.1
    gait = seeded_gait(scenario)
    walk = partial(walk_in_mujoco, scenario=scenario, integrator="implicitfast", step=STEP)
    alone = walk(gait)
    with ThreadPoolExecutor(2) as threads:
        assert list(threads.map(walk, [gait] * 3)) == [alone] * 3
    finer = walk_in_mujoco(gait, scenario=scenario, integrator="Euler", step=0.5 * STEP)
    assert alone == pytest.approx(finer, abs=0.02)


def test_a_robot_that_is_thrown_about_has_no_distance(scenario: Scenario) -> None:
    # In steps of 4 ms it jumps for ever, but nothing overflows.
    gait = seeded_gait(scenario, 0)
    assert np.isnan(walk_in_mujoco(gait, scenario=scenario, integrator="implicitfast", step=4e-3))


def test_what_is_unstable_has_no_distance_and_leaves_no_log(
    scenario: Scenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with mujoco_kept_quiet():
        distance = walk_in_mujoco(
            seeded_gait(scenario), scenario=scenario, integrator="Euler", step=4e-3
        )
    assert np.isnan(distance)
    assert list(tmp_path.iterdir()) == []
