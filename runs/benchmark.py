"""Measures the speed and the accuracy of the engines.

    python runs/benchmark.py [TABLE ...]

Prints tables in Markdown for tetra_drake/engines/README.md. The gaits are random gaits with seeds
0, 1 ... on the scenario `thesis`. Without names, all tables except `integrators` are printed:

    engines        speed and error of the engines
    integrators    speed and error for settings of the diagram; takes longest
    batches        speed of the compiled engine with many gaits at a time
    grounds        speed by ground and network
    controlled     speed of robots that are controlled, on all cores

Errors are differences of distances from converged simulations of the compiled engine. For MuJoCo,
with its different ground, they are from converged simulations of MuJoCo. Times are only meaningful
on an idle machine.
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from tetra_drake.engines.mjcf import make_mjcf
from tetra_drake.engines.mujoco import installed
from tetra_drake.engines.simulate import simulate_many
from tetra_drake.engines.simulation import Simulation
from tetra_drake.errors import InputError
from tetra_drake.formatting import TextTable, fixed, listed
from tetra_drake.machine import available_cores
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.command import Command, controlled_robot
from tetra_drake.robot.gait import AnyGait, seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.signals import DrivenRobot
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.scenario import Scenario

GAITS = 12  # for each engine
BATCHES = (1, 2, 4, 8, 30, 240)  # gaits at a time
GROUND_BATCH = 30  # gaits at a time on each ground
CONTROLLED = (1, 8, 64, 512)  # robots at a time
ROLLOUT_PERIODS = 50  # control periods that MuJoCo simulates
ROUNDS = 3  # measurements; their medians count

ENGINES = {
    "engines": ["!Drake {}", "!Compiled {}", "!Mujoco {}", "!Mujoco {step: 0.2 ms}"],
    "integrators": [
        "!Drake {}",
        "!Drake {look_ahead: 0 s}",
        "!Drake {mode_changes: witness}",
        "!Drake {accuracy: 0.001}",
        "!Drake {scheme: runge_kutta3, accuracy: 0.001, max_step: 2 ms, look_ahead: 0 s}",
        "!Drake {scheme: runge_kutta3, accuracy: 0.001, max_step: 2 ms, mode_changes: witness}",
    ],
}
"""Engines of a table, written as in a scenario."""

CONVERGED = "!Compiled {tolerance: 0.001 mm/s, max_step: 0.5 ms}"
CONVERGED_MUJOCO = "!Mujoco {step: 0.0125 ms}"


def brief(scenario: Scenario) -> Scenario:
    """The scenario for a moment, to load and compile the code before measurements."""
    return scenario.with_changes(
        {"simulation.duration": "0.02 s", "simulation.steady_from": "0.01 s"}
    )


def walk(scenario: Scenario, gaits: int, *, cores: int, lanes: bool) -> list[SimulationResult]:
    """Results of random gaits, simulated side by side in lanes, or else one after the other."""
    drawn = [seeded_gait(scenario, seed) for seed in range(gaits)]
    groups = [drawn] if lanes else [[gait] for gait in drawn]
    results = []
    for group in groups:
        for outcome in simulate_many(scenario=scenario, gaits=group, workers=cores):
            if not isinstance(outcome, SimulationResult):
                raise outcome
            results.append(outcome)
    return results


def distances_in(results: Sequence[SimulationResult]) -> np.ndarray:
    """Distances of gaits (gaits,) in inches."""
    return np.array([result.metrics.distance_in for result in results])


def engines_table(scenario: Scenario, engines: Sequence[str]) -> str:
    """Table of the speed and error of engines."""
    exact_in: dict[str, np.ndarray] = {}
    rows = []
    for engine in engines:
        reference = CONVERGED_MUJOCO if engine.startswith("!Mujoco") else CONVERGED
        if reference == CONVERGED_MUJOCO and not installed():
            continue
        if reference not in exact_in:
            converged = scenario.with_changes({"engine": reference})
            results = walk(converged, GAITS, cores=available_cores(), lanes=True)
            exact_in[reference] = distances_in(results)
        measured = scenario.with_changes({"engine": engine})
        walk(brief(measured), 1, cores=1, lanes=False)
        started = time.perf_counter()
        results = walk(measured, GAITS, cores=1, lanes=False)
        seconds = time.perf_counter() - started
        speed = sum(result.duration for result in results) / seconds
        errors_in = np.abs(distances_in(results) - exact_in[reference])
        errors = [fixed(np.median(errors_in), 3), fixed(errors_in.max(), 3)]
        evaluations = statistics.mean(r.integrator.derivative_evaluations for r in results)
        rows.append([f"`{engine}`", f"{speed:.3g}", *errors, f"{evaluations:,.0f}"])
    headings = ["engine", "times real time per core", "median error, in", "worst error, in"]
    return TextTable([*headings, "evaluations per gait"], rows).markdown()


class Batch(NamedTuple):
    """A batch of random gaits, with seeds 0, 1 ..., that are simulated at the same time."""

    scenario: Scenario
    gaits: int
    cores: int = 1

    def speed(self) -> float:
        """Speed of all gaits together, as a multiple of real time."""
        started = time.perf_counter()
        results = walk(self.scenario, self.gaits, cores=self.cores, lanes=True)
        return sum(result.duration for result in results) / (time.perf_counter() - started)


def median_speeds(batches: Sequence[Batch]) -> np.ndarray:
    """Median speed of each batch (batches,). Batches take turns in several rounds, so that other
    load on the machine affects all of them equally."""
    for batch in batches:
        batch._replace(scenario=brief(batch.scenario)).speed()
    return np.median([[batch.speed() for batch in batches] for _ in range(ROUNDS)], axis=0)


def batches_table(scenario: Scenario) -> str:
    """Table of the compiled engine's speed with many gaits at a time, on one core and on all."""
    compiled = scenario.with_changes({"engine": "!Compiled {}"})
    rows = []
    for cores in sorted({1, available_cores()}):
        batches = [Batch(compiled, gaits, cores) for gaits in BATCHES if gaits >= cores]
        speeds = [f"{speed:,.0f}" for speed in median_speeds(batches)]
        too_few = [""] * (len(BATCHES) - len(batches))
        rows.append([str(cores), *too_few, *speeds])
    return TextTable(["cores/gaits", *map(str, BATCHES)], rows).markdown()


def grounds_table(scenario: Scenario) -> str:
    """Table of the speed on one core by ground and network."""
    rough, senses = load_scenario("rough"), load_scenario("feedback").cpg.feedback
    grounds: dict[str, dict[str, object]] = {
        "the scenario's": {},
        "live network": {"cpg.signals": "live"},
        "feedback": {"cpg.signals": "live", "cpg.feedback": senses},
        "rough": {"terrain": rough.terrain, "robot.contacts": rough.robot.contacts},
    }
    batches = []
    for changes in grounds.values():
        ground = scenario.with_changes(changes)
        compiled, diagram = (
            ground.with_changes({"engine": "!Compiled {}"}),
            ground.with_changes({"engine": "!Drake {}"}),
        )
        batches += [Batch(compiled, 1), Batch(compiled, GROUND_BATCH), Batch(diagram, 1)]
    speeds = median_speeds(batches).reshape(len(grounds), 3)
    rows = [
        [name, f"{alone:,.0f}", f"{many:,.0f}", fixed(drake)]
        for name, (alone, many, drake) in zip(grounds, speeds, strict=True)
    ]
    headings = ["ground", "compiled, one gait", f"compiled, {GROUND_BATCH} gaits", "drake"]
    return TextTable(headings, rows).markdown()


def held_gait(scenario: Scenario, gait: AnyGait) -> Command:
    """A gait as a command: its signals, constant during each control period."""
    robot, period = Robot.of(scenario), scenario.simulation.control_period
    times = np.arange(0.0, scenario.simulation.duration, period)
    of_cable = robot.structure.cables["signal"][robot.driven]
    return Command(gait.name, period, DrivenRobot.of(robot, gait).signals_at(times)[:, of_cable])


def step_through(simulation: Simulation, actions: np.ndarray) -> None:
    """Simulates robots that get actions (periods, robots, actions) in each control period."""
    simulation.reset()
    for some in actions:
        simulation.step(some)


def controlled_rows(scenario: Scenario) -> list[list[str]]:
    """Rows about robots in control periods, whose actions are the signals of gaits.

    They are: control periods per second; this speed relative to simulations of the same signals as
    commands; and relative to simulations of the gaits.
    """
    rows: list[list[str]] = [[], [], []]
    for robots in CONTROLLED:
        gaits = [seeded_gait(scenario, seed) for seed in range(robots)]
        commands = [held_gait(scenario, gait) for gait in gaits]
        actions = np.stack([command.samples for command in commands], axis=1)
        stepped, commanded, walked = median_times(
            partial(step_through, Simulation(scenario, count=robots), actions),
            partial(simulate_many, scenario, commands),
            partial(simulate_many, scenario, gaits),
        )
        rows[0].append(f"{robots * len(actions) / stepped:,.0f}")
        rows[1].append(fixed(commanded / stepped))
        rows[2].append(fixed(walked / stepped))
    names = "", ", beside commands", ", beside gaits"
    return [[f"`{scenario.name}`{name}", *row] for name, row in zip(names, rows, strict=True)]


def rollout_row(scenario: Scenario) -> list[str]:
    """Row with the control periods per second of robots in MuJoCo's rollout, on all cores."""
    import mujoco
    from mujoco.rollout import Rollout

    robot = controlled_robot(scenario.with_changes({"engine": "!Mujoco {step: 0.2 ms}"}))
    model = mujoco.MjModel.from_xml_string(make_mjcf(robot))
    data = [mujoco.MjData(model) for _ in range(available_cores())]
    kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
    start = np.empty(mujoco.mj_stateSize(model, kind))
    mujoco.mj_getState(model, data[0], start, kind)

    def roll_out(robots: int) -> None:
        steps = round(scenario.simulation.control_period / model.opt.timestep)
        states, controls = np.tile(start, (robots, 1)), np.zeros((robots, steps, model.nu))
        with Rollout(nthread=len(data)) as rollout:
            for _ in range(ROLLOUT_PERIODS):
                states = rollout.rollout(model, data, states, controls)[0][:, -1]

    times = median_times(*(partial(roll_out, robots) for robots in CONTROLLED))
    speeds = ROLLOUT_PERIODS * np.array(CONTROLLED) / times
    return [f"`{scenario.name}`, MuJoCo's rollout", *(f"{speed:,.0f}" for speed in speeds)]


def median_times(*runs: Callable[[], object]) -> np.ndarray:
    """Median wall time (s) of each function (functions,). They take turns in several rounds."""
    rounds = []
    for _ in range(1 + ROUNDS):
        times = []
        for run in runs:
            started = time.perf_counter()
            run()
            times.append(time.perf_counter() - started)
        rounds.append(times)
    return np.median(rounds[1:], axis=0)  # the first round compiles


def controlled_table(scenario: Scenario) -> str:
    """Table of the speed of robots in control periods."""
    compiled, coulomb = scenario.with_changes({"engine": "!Compiled {}"}), load_scenario("coulomb")
    changes = {"friction": coulomb.friction, "engine": coulomb.engine, "name": coulomb.name}
    second = compiled.with_sections(**changes)
    rows = [*controlled_rows(compiled), *controlled_rows(second)]
    if installed():
        rows.append(rollout_row(second.with_changes({"friction.stiffness": "0 N/m"})))
    return TextTable(["control periods per second", *map(str, CONTROLLED)], rows).markdown()


TABLES = {"batches": batches_table, "grounds": grounds_table, "controlled": controlled_table}


def main(names: Sequence[str], scenario: Scenario) -> None:
    """Prints the tables of the given names, or all but `integrators`. Raises InputError."""
    tables = [*ENGINES, *TABLES]
    if unknown := {*names} - {*tables}:
        raise InputError("TABLE", "", f"found {listed([*unknown])}, expected {listed(tables)}")
    for name in names or ["engines", *TABLES]:
        if name in ENGINES:
            table = engines_table(scenario, ENGINES[name])
        else:
            table = TABLES[name](scenario)
        print(f"{table}\n", flush=True)


if __name__ == "__main__":
    try:
        main(sys.argv[1:], load_scenario("thesis"))
    except InputError as error:
        sys.exit(f"benchmark.py: {error}")
