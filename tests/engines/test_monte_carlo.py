"""Drake's Monte Carlo simulation draws the disturbances of a scenario."""

import functools

import pytest
from helpers.converged import shortly
from pydrake.common import RandomGenerator
from pydrake.systems.analysis import RandomSimulation

from tetra_drake.engines.drake import MakeDisturbedSimulator
from tetra_drake.engines.simulate import simulate
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.scenario.disturbances import disturbed, fresh_draws
from tetra_drake.scenario.experiment_sections import Disturbances
from tetra_drake.scenario.load import load_scenario

SPREADS = {"robot.cables.outer_stiffness": 0.2, "robot.density": 0.3}


def place(system, context):
    """Coordinate x of the first body in m."""
    return system.GetOutputPort("state").Eval(context)[4]


def test_a_random_simulation_ends_where_simulate_does():
    spread = Disturbances(draws=1, start=0.05, spreads=SPREADS)
    scenario = shortly(load_scenario("coulomb"), 0.3).with_sections(disturbances=spread)
    gait = seeded_gait(scenario, 2)
    make = functools.partial(MakeDisturbedSimulator, scenario, gait)
    [draw] = fresh_draws(scenario, RandomGenerator(11)(), 1)
    result = simulate(disturbed(scenario, draw).on_engine("drake"), gait, record=True)
    found = RandomSimulation(make, place, 0.3, RandomGenerator(11))
    assert found == pytest.approx(float(result.trajectory.p_WB[-1, 0, 0]), abs=1e-4)
