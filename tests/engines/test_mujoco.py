"""The engine `mujoco`: the same robot as on the other engines, on ground of its own."""

import math

import numpy as np
import pytest
import xarray
from helpers.converged import shortly
from helpers.outcomes import assert_same

from tetra_drake.engines import mujoco as engine
from tetra_drake.engines.mjcf import loose_remark
from tetra_drake.engines.simulate import simulate, simulate_many
from tetra_drake.errors import Diverged, StepBudgetExceeded
from tetra_drake.laws.friction import Coulomb
from tetra_drake.laws.terrain import Incline
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.engine_kinds import Mujoco
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.scenario import Scenario

NO_BRISTLES = {"friction": Coulomb()}
pytestmark = pytest.mark.skipif(not engine.installed(), reason=engine.INSTALL)


@pytest.fixture
def short(scenario: Scenario) -> Scenario:
    """0.3 s on the engine `mujoco`, driven from between the samples at 0.10 and 0.11 s on."""
    times = {"simulation.duration": "0.3 s", "simulation.steady_from": "0.2 s"}
    return scenario.with_changes({"engine": "!Mujoco", "cpg.start_up": "0.105 s", **times})


def trajectory_of(scenario: Scenario) -> xarray.Dataset:
    """Of the seeded gait."""
    return simulate(scenario=scenario, gait=seeded_gait(scenario), record=True).trajectory


@pytest.mark.parametrize("name", ["thesis", "mast"])  # with weak and strong dampers
def test_dampers_between_bodies_do_not_slow_the_fall_of_a_robot(name):
    scenario = load_scenario(name)
    high = {"robot.offsets": [[0.0, 0.0, "2 m"]] * scenario.robot.body_count}
    falling = shortly(scenario, 0.6, engine="!Mujoco", **NO_BRISTLES | high)  # to 5.9 m/s
    trajectory = trajectory_of(falling)
    v_WN = trajectory["v_WN"].values
    velocity = Robot.of(falling).structure.node_shares @ v_WN
    fallen = np.outer(trajectory["time"], [0.0, 0.0, -falling.robot.gravity])
    np.testing.assert_allclose(velocity, fallen, atol=1e-7)
    assert np.ptp(v_WN - velocity[:, np.newaxis], axis=0).max() > 0.01, "its cables move bodies"


def test_steps_count_against_the_budget_of_evaluations(short):
    gait, steps = seeded_gait(short), 4800
    short = short.with_changes({"simulation.max_evaluations": steps})
    work = simulate(scenario=short, gait=gait).integrator
    assert (work.scheme, work.accuracy) == ("Euler", 0.3 / steps)
    assert work.steps == work.derivative_evaluations == steps
    short = short.with_changes({"simulation.max_evaluations": steps - 1})
    with pytest.raises(StepBudgetExceeded):
        simulate(scenario=short, gait=gait)


@pytest.mark.parametrize(
    ("name", "longest"), [("thesis", 0.26e-3), ("mast", 0.10e-3), ("prism", 2.7e-3)]
)
def test_steps_are_too_long_where_robots_are_thrown_about(name, longest):
    # Seen: the thesis's robot at 500 m/s in steps of 0.3 ms, the prism at 69 m/s in steps of 3 ms.
    robot = Robot.of(load_scenario(name))
    assert [engine.is_stable(robot, share * longest) for share in (0.9, 1.1)] == [True, False]
    unstable = robot.scenario.with_changes({"engine": Mujoco(step=1.1 * longest)} | NO_BRISTLES)
    with pytest.raises(Diverged, match="too long"):
        simulate(scenario=unstable, gait=seeded_gait(unstable))


def test_where_mujoco_starts_again_the_simulation_has_failed(short, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    thrown = short.with_changes({"cpg.gain": "4e9 N"})
    step = short.settings_of(Mujoco).step
    with pytest.raises(Diverged, match="warns of instability") as caught:
        simulate(scenario=thrown, gait=seeded_gait(thrown))
    assert caught.value.time == pytest.approx(short.cpg.start_up, abs=2.5 * step)
    assert list(tmp_path.iterdir()) == [], "no log file"


def test_many_gaits_walk_or_fail_as_each_alone(short, monkeypatch):
    monkeypatch.setattr(engine, "_STRETCH", 1000)
    short = short.with_changes({"simulation.max_speed": "0.07 m/s"})  # one of them exceeds it
    gaits = [seeded_gait(short, seed) for seed in range(3)]
    alone = [simulate_many(short, [gait], record=True)[0] for gait in gaits]
    assert {type(outcome) for outcome in alone} == {Diverged, SimulationResult}
    for workers in (1, 2):
        many = simulate_many(scenario=short, gaits=gaits, record=True, workers=workers)
        for found, expected in zip(many, alone, strict=True):
            assert_same(found, expected)


def test_forces_on_an_incline_are_along_its_tangents_and_normal(short, structure):
    angle, times = math.radians(3.0), {"simulation.duration": "1.2 s", "cpg.start_up": "1.25 s"}
    creeping = {"terrain": Incline(slope=angle), "friction": Coulomb(), **times}
    scenario = short.with_changes(creeping)
    end = trajectory_of(scenario).isel(time=-1)
    weight = Robot.of(scenario).weight
    normal, friction = end["normal_force"].values, end["friction_force"].values
    assert normal.sum() == pytest.approx(weight * math.cos(angle), rel=1e-4)
    np.testing.assert_array_equal(end["in_contact"], normal > 0.0)
    uphill = [weight * math.sin(angle), 0.0]
    np.testing.assert_allclose(friction.sum(axis=0), uphill, rtol=1e-3, atol=1e-9)
    # The law in stick, at each node: F = -c v.
    v_WN = end["v_WN"].values.reshape(-1, 3)[structure.contacts]
    t_1 = np.array([math.cos(angle), 0.0, math.sin(angle)])
    creep = np.where(normal > 0.0, v_WN @ t_1, 0.0)
    expected = -Coulomb().damping * creep
    np.testing.assert_allclose(friction[:, 0], expected, atol=5e-3 * expected.max())


def test_cables_that_go_slack_walk_as_tendons_while_they_are_taut(short):
    taut, gait = short.with_changes({"robot.cables.slack": True}), seeded_gait(short)
    ours, tendons = (simulate(scenario, gait).metrics for scenario in (taut, short))
    assert ours.distance == pytest.approx(tendons.distance, abs=1e-5)
    assert "slack" in loose_remark(Robot.of(taut)) and not loose_remark(Robot.of(short))
