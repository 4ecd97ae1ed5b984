"""Policies: their motion on the engines, and what evolution makes of their parameters."""

import math

import numpy as np
import pytest
from helpers.brief import BRIEF
from helpers.policies import own

import tetra_drake as td
from tetra_drake.engines.mujoco import installed
from tetra_drake.engines.simulate import simulate
from tetra_drake.robot.command import Command, controlled_robot
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.gait_file import load_gait
from tetra_drake.robot.parameter_space import ParameterSpace
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.policies import driven_names
from tetra_drake.scenario.policy_kinds import imported_function

DRAKE = "!Drake {scheme: runge_kutta3, accuracy: 1e-4, max_step: 2 ms}"
ENGINES = ["!Compiled", DRAKE, "!Mujoco"] if installed() else ["!Compiled", DRAKE]
COEFFICIENTS = (0.2, -0.4, 0.7, -0.6, 0.3, 0.5, -0.2, 0.4)


def brief(name="prism", policy="!Linear {}", **changes):
    changes = {key.replace("__", "."): value for key, value in changes.items()}
    return load_scenario(name).with_changes(BRIEF | {"policy": policy} | changes)


def test_the_rolling_policy_moves_the_rover_as_a_controller_of_its_formula_does():
    scenario = brief("rover", "!Rolling {}", simulation__duration="1.5 s")
    plain = scenario.with_changes({"policy": None})
    robot = controlled_robot(plain)
    structure, rest = robot.structure, plain.actuation.commands(robot.starting_cables())
    cables = structure.cables[robot.driven]
    rod = structure.p_WN[structure.struts[0]]
    half = 0.5 * float(np.linalg.norm(rod[1] - rod[0]))

    def roll(time, readings):
        middles = 0.5 * (readings.p_WN[cables["node_a"]] + readings.p_WN[cables["node_b"]])
        x, _, z = ((middles - readings.p_WN.mean(axis=0)) / half).T
        s = math.sin(math.pi * time)
        terms = np.stack([np.ones_like(x), x, z, x * x, x * z, z * z, s * x, s * z], axis=-1)
        return rest * (1.0 - np.clip((terms * COEFFICIENTS).sum(axis=-1), -0.5, 0.5))

    expected = simulate(plain, controller=roll)
    rolled = simulate(
        scenario, Gait("rolling", dict(zip(scenario.parameters, COEFFICIENTS, strict=True)))
    )
    assert rolled.metrics.to_json() == expected.metrics.to_json()
    assert abs(rolled.metrics.distance) > 0.001


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("name", ["prism", "rover", "motors"])
def test_a_linear_policy_without_weights_is_a_command_of_its_biases(name, engine):
    """With forces, free lengths and tensions, also after a driven cable was cut."""
    if (name, engine) in {("rover", DRAKE), ("motors", "!Mujoco")}:
        pytest.skip("slow, and the others show it")
    scenario = brief(name, engine=engine, friction="!Coulomb {stiffness: 0 N/m}")
    cut = driven_names(scenario.robot.blueprint())[0]
    events = [{"at": "0.11 s", "cut": [cut]}]
    scenario = scenario.with_changes({"events": events, "simulation.duration": "0.16 s"})
    robot = controlled_robot(scenario)
    biases = np.linspace(-0.3, 0.6, robot.driven.size)
    values = {key: 0.0 for key in scenario.parameters}
    values |= dict(zip([key for key in values if key.startswith("bias")], biases, strict=True))
    driven = simulate(scenario, Gait("biases", values), record=True)

    cables = Robot.of(scenario).starting_cables()
    signals = scenario.cpg.usual_amplitude * biases
    setpoints = scenario.actuation.commands(cables._replace(signal=signals))
    command = Command("biases", 1.0, setpoints[np.newaxis])
    played = simulate(scenario, command=command, record=True)
    limit = 2e-4 if engine == DRAKE else 2e-5
    for key, error in {"signal": 1e-9, "p_WN": limit}.items():
        found, expected = driven.trajectory[key].values, played.trajectory[key].values
        np.testing.assert_allclose(found, expected, rtol=0, atol=error)
    assert np.ptp(driven.trajectory.p_WN.values, axis=0).max() > 1e-4


SOFT_OR_STIFF = {"robot.cables.side.stiffness": ["150 N/m", "250 N/m"]}


@pytest.mark.parametrize(
    ("optimizer", "body"),
    [("!SteadyState {population: 4}", {}), ("!CmaEs {population: 4, sample: 2}", SOFT_OR_STIFF)],
)
def test_the_best_of_an_evolved_policy_is_replayed(tmp_path, optimizer, body):
    scenario = brief(evolve=body, optimizer=optimizer)
    run = td.evolve(scenario, tmp_path, report=False, reevaluate=False)
    best, file = run.best_gait(), tmp_path / "trial_00" / "best_gait.json"
    assert load_gait(file, scenario) == best
    assert simulate(scenario, best).fitness == run.fittest()["fitness"]
    assert dict(best.body).keys() == body.keys()
    assert not body or file.with_name("best.yaml").exists()
    vector = ParameterSpace.of(scenario).vector(best)
    assert vector == pytest.approx(run.vector(0, int(run.fittest()["index"])))


def test_a_policy_of_ones_own_is_found_by_its_import_path():
    scenario = brief(policy="!Python {function: helpers.policies:own, count: 1}")
    result = simulate(scenario, td.seeded_gait(scenario))
    assert result.metrics.to_json() != simulate(scenario, Gait("", {"parameter 1": 0.0})).metrics
    assert imported_function("helpers.policies:own") is own
