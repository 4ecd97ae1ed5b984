"""Preparation: after it, nothing that the package ships waits for a compiler."""

from collections.abc import Iterator

import numpy as np
import pytest
from helpers.converged import shortly
from numba.core import event

from tetra_drake.engines.engine import engine_of
from tetra_drake.engines.simulate import simulate, simulate_many
from tetra_drake.gym import TensegrityEnv
from tetra_drake.lab.stepping.simulation import Simulation
from tetra_drake.laws.terrain import Incline
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.shipped import shipped_scenarios, shipped_structures


@pytest.fixture
def compiled(prepared: None) -> Iterator[list[str]]:
    """Names of the kernels of this package that are compiled during a test."""
    recorder = event.RecordingListener()
    names: list[str] = []
    with event.install_listener("numba:compile", recorder):
        yield names
        functions = [record.data["dispatcher"].py_func for _, record in recorder.buffer]
        names += [f.__qualname__ for f in functions if f.__module__.startswith("tetra_drake")]
    assert not names


@pytest.mark.usefixtures("compiled")
@pytest.mark.parametrize("name", [one for one in shipped_scenarios() if one != "phases"])
def test_no_shipped_scenario_compiles_anything(name):
    for engine in ("!Compiled", "!Drake"):
        scenario = shortly(load_scenario(name), 0.01, engine=engine)
        result = simulate(scenario, seeded_gait(scenario), record=True)
        assert result.trajectory.tension.size > 0
    if name in shipped_structures():
        assert np.isfinite(Robot.of(scenario).equilibrium.state).all()


@pytest.mark.usefixtures("compiled")
@pytest.mark.parametrize("count", [2, 5, 64])
def test_no_number_of_robots_compiles_anything(count):
    scenario = shortly(load_scenario("coulomb"), 0.05, engine="!Compiled")
    assert len(simulate_many(scenario, [seeded_gait(scenario, i) for i in range(count)])) == count
    robots = Simulation("rover", count=count)
    assert (robots.step(robots.rest).time > 0.0).all()


@pytest.mark.usefixtures("compiled")
def test_no_environment_and_no_other_engine_compiles_anything():
    environment = TensegrityEnv("rover")
    environment.reset(seed=0)
    environment.step(environment.action_space.sample())
    level = {"friction.stiffness": "0 N/m", "terrain": Incline(slope=0.0)}
    scenario = shortly(load_scenario("motors"), 0.05, engine="!Mujoco", **level)
    assert simulate(scenario, seeded_gait(scenario)).metrics.distance_in != 0.0


def test_a_scenario_whose_draws_cut_cables_later_is_prepared():
    late = {"draws": 1, "cuts": {"at": "1 s"}}
    scenario = load_scenario("prism").with_changes({"disturbances": late})
    engine_of(scenario).prepare(scenario)
