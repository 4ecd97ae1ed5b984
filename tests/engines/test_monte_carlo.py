"""Drake's Monte Carlo simulation draws the disturbances of a scenario."""

import functools

import numpy as np
import pytest
from helpers.converged import shortly
from pydrake.common import RandomGenerator
from pydrake.systems.analysis import MonteCarloSimulation, RandomSimulation, Simulator

from tetra_drake.engines.drake import MakeDisturbedSimulator
from tetra_drake.engines.simulate import simulate
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.disturbances import disturbed, fresh_draws
from tetra_drake.scenario.load import load_scenario

VARIED = {
    "disturbances": {
        "draws": 1,
        "start": 0.05,
        "spreads": {"robot.cables.outer_stiffness": 0.2, "robot.density": 0.3},
    }
}


@pytest.fixture(scope="module")
def scenario():
    return shortly(load_scenario("coulomb"), 0.3).with_changes(VARIED)


@pytest.fixture(scope="module")
def gait(scenario):
    return seeded_gait(scenario, 2)


def place(system, context):
    """Coordinate x of the first body in m."""
    return system.GetOutputPort("state").Eval(context)[4]


def monte_carlo(scenario, gait, seed, *, samples=4, until=0.0):
    results = MonteCarloSimulation(
        make_simulator=functools.partial(MakeDisturbedSimulator, scenario, gait),
        output=place,
        final_time=until,
        num_samples=samples,
        generator=RandomGenerator(seed),
    )
    return [result.output for result in results]


def test_draws_differ_and_the_same_seed_gives_the_same_draws(scenario, gait):
    first, again, other = (monte_carlo(scenario, gait, seed) for seed in (1, 1, 2))
    assert len({*first, *other}) == 8
    assert first == again


def test_a_draw_is_one_of_robustness(scenario, gait):
    """Masses, stiffness and start; so the draws have the same distribution, too."""
    for seed in (5, 6):
        [draw] = fresh_draws(scenario, RandomGenerator(seed)(), 1)
        robot = Robot.of(disturbed(scenario, draw))
        expected = robot.structure
        simulator = MakeDisturbedSimulator(scenario, gait, RandomGenerator(seed))
        diagram = simulator.get_system()
        diagram.SetRandomContext(simulator.get_mutable_context(), RandomGenerator(99))
        context = simulator.get_context()
        np.testing.assert_allclose(
            diagram.GetOutputPort("state").Eval(context), expected.initial_state, atol=1e-15
        )
        plant = diagram.GetSubsystemByName("plant")
        mass = plant.CalcTotalMass(plant.GetMyContextFromRoot(context))
        assert mass == pytest.approx(expected.mass.sum(), rel=1e-12)
        stretch = expected.initial_lengths - expected.cables["free_length"]
        tensions = expected.cables["stiffness"] * np.maximum(stretch, 0.0)
        found = diagram.GetOutputPort("tensions").Eval(context)
        passive = np.delete(np.arange(tensions.size), robot.driven)
        assert tensions[passive].any()
        np.testing.assert_allclose(found[passive], tensions[passive], rtol=1e-9, atol=1e-12)


def test_a_random_simulation_ends_where_simulate_does(scenario, gait):
    seed = 11
    [draw] = fresh_draws(scenario, RandomGenerator(seed)(), 1)
    result = simulate(disturbed(scenario, draw).on_engine("drake"), gait, record=True)
    found = RandomSimulation(
        make_simulator=functools.partial(MakeDisturbedSimulator, scenario, gait),
        output=place,
        final_time=0.3,
        generator=RandomGenerator(seed),
    )
    assert found == pytest.approx(float(result.trajectory.p_WB[-1, 0, 0]), abs=1e-4)


CUTS = {"disturbances": {"draws": 1, "cuts": {"at": "0.1 s", "count": 1}}}
EVENTS = {"events": [{"at": "0.1 s", "cut": ["T1-T2 outer top"]}]}


def test_what_a_simulator_cannot_draw_is_refused(scenario, gait, refused):
    generator = RandomGenerator(1)
    for changes in (CUTS, EVENTS):
        with refused(scenario.name, "events", "td.simulate"):
            MakeDisturbedSimulator(scenario.with_changes(changes), gait, generator)
    with refused("thesis", "disturbances", "missing"):
        MakeDisturbedSimulator("thesis", gait, generator)
    with refused("MakeDisturbedSimulator", "generator", "RandomGenerator"):
        MakeDisturbedSimulator(scenario, gait, 7)
    with refused("nothing", "", "scenario"):
        MakeDisturbedSimulator("nothing", gait, generator)
    with refused("gait", "", "None"):
        MakeDisturbedSimulator(scenario, None, generator)
    assert isinstance(MakeDisturbedSimulator(scenario, gait, generator), Simulator)
