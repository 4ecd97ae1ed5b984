"""Measures the speed and the accuracy of the engines.

    python runs/benchmark.py [TABLE ...]

Prints tables in Markdown for tetra_drake/engines/speed.md. The gaits are random gaits with seeds
0, 1 ... on the scenario `thesis`; what is measured is in benchmark.yaml. Without names, the tables
`engines`, `batches` and `controlled` are printed:

    engines        speed and error of the engines, on two grounds
    integrators    speed and error for settings of the diagram; takes longest
    schemes        all integrators of Drake on the diagrams of `thesis` and `six_bar`
    candidates     time for another robot: a diagram for each, or one diagram with parameters
    batches        speed of the compiled engine with many gaits at a time
    controlled     speed of robots that are controlled, on all cores
    sizes          CPU time of rows of tetrahedra, masts and lattices by the number of bodies, on
                   the compiled engine and Drake

Errors are differences of distances from converged simulations of the compiled engine. For MuJoCo,
with its different ground, they are from converged simulations of MuJoCo. Times are only meaningful
on an idle machine.
"""

from __future__ import annotations

import functools
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from timeit import timeit
from typing import Any

import jinja2
import numpy as np
import yaml
from pydrake.systems.analysis import GetIntegrationSchemes, ResetIntegratorFromFlags, Simulator
from script import chosen, read_settings, script

from tetra_drake.engines.drake import MakeSimulator
from tetra_drake.engines.mjcf import make_mjcf
from tetra_drake.engines.mujoco import installed
from tetra_drake.engines.simulate import simulate, simulate_many
from tetra_drake.errors import SimulationFailure
from tetra_drake.formatting import TextTable, fixed
from tetra_drake.lab.stepping.simulation import Simulation
from tetra_drake.machine import available_cores
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.command import Command, controlled_robot
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.signals import DrivenRobot
from tetra_drake.scenario.engine_kinds import Drake
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.robot_structure import StructureFile
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.systems.diagram import MakeTensegrityDiagram

GIVEN: dict[str, Any] = read_settings(Path(__file__).with_suffix(".yaml"))
"""What is measured, see the file."""
LANES = 8
"""Number of gaits that a processor with AVX-512 simulates in the time of one."""
ROLLOUT_PERIODS = 50
"""Number of control periods that MuJoCo simulates."""


def random_gaits(scenario: Scenario, count: int) -> list[Gait]:
    """Gaits with the seeds 0, 1, ..."""
    return [seeded_gait(scenario, seed) for seed in range(count)]


def walk(scenario: Scenario, count: int, *, cores: int = 1) -> list[SimulationResult]:
    """Results of random gaits that are simulated side by side."""
    results = []
    for outcome in simulate_many(scenario, random_gaits(scenario, count), workers=cores):
        if not isinstance(outcome, SimulationResult):
            raise outcome
        results.append(outcome)
    return results


def distances_in(results: Sequence[SimulationResult]) -> np.ndarray:
    """Distances of gaits (gaits,) in inches."""
    return np.array([result.metrics.distance_in for result in results])


@functools.cache
def exact_in(scenario: Scenario, engine: str) -> np.ndarray:
    """Distances (gaits,) in inches on a converged engine."""
    converged = scenario.with_changes({"engine": engine})
    return distances_in(walk(converged, GIVEN["gaits"], cores=available_cores()))


def engines_table(scenario: Scenario, table: str) -> TextTable:
    """Table of the speed and error of engines, by ground."""
    rows = []
    grounds = {name: scenario.with_changes(each) for name, each in GIVEN["grounds"].items()}
    for ground, engine in GIVEN[table]:
        is_mujoco = engine.startswith("!Mujoco")
        if is_mujoco and not installed():
            continue
        exact = exact_in(grounds[ground], GIVEN["converged_mujoco" if is_mujoco else "converged"])
        measured = grounds[ground].with_changes({"engine": engine})
        gaits = random_gaits(measured, GIVEN["gaits"])
        simulate(measured.with_changes(GIVEN["short"]), gaits[0])
        started = time.perf_counter()
        results = [simulate(measured, gait) for gait in gaits]
        speed = sum(each.duration for each in results) / (time.perf_counter() - started)
        errors = np.abs(distances_in(results) - exact)
        evaluations = np.mean([each.integrator.derivative_evaluations for each in results])
        row = [fixed(np.median(errors), 3), fixed(errors.max(), 3), f"{evaluations:,.0f}"]
        rows.append([f"`{engine}`", ground, f"{speed:.3g}", *row])
    headings = ["engine", "ground", "times real time per core", "median error, in"]
    return TextTable([*headings, "worst error, in", "evaluations per gait"], rows, (0, 1))


def median_times(*runs: Callable[[], object]) -> np.ndarray:
    """Median wall time (s) of each function (functions,). They take turns in several rounds, so
    that other load on the machine affects all of them equally; a first round compiles."""
    rounds = [[timeit(run, number=1) for run in runs] for _ in range(1 + GIVEN["rounds"])]
    return np.median(rounds[1:], axis=0)


def batches_table(scenario: Scenario) -> TextTable:
    """Table of the compiled engine's speed with many gaits at a time, on one core and on all, as
    multiples of real time."""
    compiled, sizes, rows = scenario.on_engine("compiled"), GIVEN["batches"], []
    for cores in sorted({1, available_cores()}):
        times = median_times(*(partial(walk, compiled, gaits, cores=cores) for gaits in sizes))
        speeds = compiled.simulation.duration * np.array(sizes) / times
        rows.append([str(cores), *(f"{speed:,.0f}" for speed in speeds)])
    return TextTable(["cores/gaits", *map(str, sizes)], rows)


def held_gait(scenario: Scenario, gait: Gait) -> Command:
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
    columns = []
    for robots in GIVEN["controlled"]:
        gaits = random_gaits(scenario, robots)
        commands = [held_gait(scenario, gait) for gait in gaits]
        actions = np.stack([command.samples for command in commands], axis=1)
        stepped, commanded, walked = median_times(
            partial(step_through, Simulation(scenario, count=robots), actions),
            partial(simulate_many, scenario, commands),
            partial(simulate_many, scenario, gaits),
        )
        periods = f"{robots * len(actions) / stepped:,.0f}"
        columns.append([periods, fixed(commanded / stepped), fixed(walked / stepped)])
    names = (f"`{scenario.name}`{name}" for name in ("", ", beside commands", ", beside gaits"))
    return [[name, *row] for name, *row in zip(names, *columns, strict=True)]


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
    steps = round(scenario.simulation.control_period / model.opt.timestep)

    def roll_out(robots: int) -> None:
        states, controls = np.tile(start, (robots, 1)), np.zeros((robots, steps, model.nu))
        with Rollout(nthread=len(data)) as rollout:
            for _ in range(ROLLOUT_PERIODS):
                states = rollout.rollout(model, data, states, controls)[0][:, -1]

    counts = GIVEN["controlled"]
    times = median_times(*(partial(roll_out, robots) for robots in counts))
    speeds = ROLLOUT_PERIODS * np.array(counts) / times
    return [f"`{scenario.name}`, MuJoCo's rollout", *(f"{speed:,.0f}" for speed in speeds)]


def controlled_table(scenario: Scenario) -> TextTable:
    """Table of the speed of robots in control periods."""
    compiled, coulomb = scenario.on_engine("compiled"), load_scenario("coulomb")
    changes = {"friction": coulomb.friction, "engine": coulomb.engine, "name": coulomb.name}
    second = compiled.with_sections(**changes)
    rows = [*controlled_rows(compiled), *controlled_rows(second)]
    if installed():
        rows.append(rollout_row(second.with_changes({"friction.stiffness": "0 N/m"})))
    return TextTable(["control periods per second", *map(str, GIVEN["controlled"])], rows)


def cpu_time(scenario: Scenario, gaits: int = 1) -> tuple[float, int]:
    """CPU time (s) of the simulations of some gaits side by side, and the number of their steps."""
    walk(scenario.with_changes(GIVEN["short"]), 1)
    started = time.process_time()
    results = walk(scenario, gaits)
    steps = sum(result.integrator.steps for result in results)
    return time.process_time() - started, steps


def sizes_table(scenario: Scenario) -> TextTable:
    """Table of the CPU time of large robots by their number of bodies. The oscillators of a row are
    coupled to their neighbours only; otherwise the network would need most of the time."""
    duration, table = {"simulation.duration": scenario.simulation.duration}, []
    for kind, size in [(kind, size) for kind, sizes in GIVEN["sizes"].items() for size in sizes]:
        if tile := GIVEN["tiles"].get(kind):
            text = jinja2.Template(tile["structure"]).render(side=size)
            robot = StructureFile.from_tree(yaml.safe_load(text), kind)
            one = load_scenario(tile["scenario"]).with_sections(robot=robot)
        else:
            one = scenario.with_changes({"robot.tetrahedra": size, "cpg.reach": 1})
        bodies, on_diagram = one.robot.body_count, ""
        compiled = one.with_numbers(duration).on_engine("compiled")
        costs = [cpu_time(compiled, gaits) for gaits in (1, LANES)]
        if bodies <= GIVEN["most_on_diagram"]:
            short = one.with_changes(GIVEN["on_diagram"]).on_engine("drake")
            on_diagram = f"{cpu_time(short)[0] / short.simulation.duration:.3g}"
        per_body = [f"{1e6 * seconds / steps / bodies:.2f}" for seconds, steps in costs]
        table.append([kind, str(bodies), *per_body, on_diagram])
    headings = ["robot", "bodies", "compiled: µs per step and body, one gait"]
    headings += [f"{LANES} gaits at a time", "drake: s per simulated second"]
    return TextTable(headings, table)


def schemes_table(thesis: Scenario) -> TextTable:
    """Table of all integrators of Drake on diagrams. Errors are of the bodies' positions at the
    end, from a converged simulation of the compiled engine. A scheme without error control gets the
    longest step with an error that is accepted."""
    given, rows = GIVEN["schemes"], []
    for scenario in (thesis, load_scenario("six_bar")):
        short = scenario.with_changes(given["moment"])
        robot, gait = Robot.of(short), seeded_gait(short)
        exact = simulate(short.with_changes({"engine": GIVEN["converged"]}), gait, record=True)
        p_WB = exact.trajectory.p_WB[-1].to_numpy()
        usual = MakeSimulator(MakeTensegrityDiagram(robot, gait), robot, Drake())
        accuracy = usual.get_integrator().get_target_accuracy()
        for scheme in GetIntegrationSchemes():
            is_fixed = scheme in given["fixed_steps"]
            target = None if is_fixed else accuracy
            for step in given["steps"] if is_fixed else given["steps"][:1]:
                cells = tried(robot, gait, scheme, p_WB, step=step, accuracy=target)
                if not cells[1]:
                    break
            rows.append([f"`{scenario.name}`", f"`{scheme}`", *cells])
            print(*rows[-1], file=sys.stderr, flush=True)
    headings = ["robot", "scheme", "set to", "failure", "error, mm", "evaluations", "CPU s"]
    return TextTable(headings, rows)


def tried(
    robot: Robot,
    gait: Gait,
    scheme: str,
    p_WB: np.ndarray,
    *,
    step: float,
    accuracy: float | None = None,
) -> list[str]:
    """Cells of the table of schemes. Simulates a diagram with an integrator of Drake, and compares
    the bodies' positions at the end with p_WB (bodies, 3) in m. `step` (s) is the longest step, or
    each step without an accuracy."""
    diagram = MakeTensegrityDiagram(robot, gait, scene_graph=scheme == "cenic")
    simulator = Simulator(diagram)
    integrator = ResetIntegratorFromFlags(simulator, scheme, step)
    setting = f"accuracy {accuracy:.2g}" if accuracy else f"step {1e3 * step:.3g} ms"
    if accuracy:
        integrator.set_target_accuracy(accuracy)
    started = time.process_time()
    try:
        simulator.AdvanceTo(robot.scenario.simulation.duration)
    except (SimulationFailure, RuntimeError) as error:
        return [setting, str(error).splitlines()[0], "", "", ""]
    seconds = time.process_time() - started
    state = diagram.GetOutputPort("state").Eval(simulator.get_context())
    found = state[: 7 * len(p_WB)].reshape(-1, 7)[:, 4:]
    error_mm = 1e3 * float(np.linalg.norm(found - p_WB, axis=1).max())
    is_good = accuracy or error_mm < GIVEN["schemes"]["accepted"]
    failure = "" if is_good else f"error of {error_mm:.3g} mm"
    counted = integrator.get_num_derivative_evaluations()
    evaluations = f"{counted:,.0f}" if counted else "not counted"
    return [setting, failure, f"{error_mm:.2g}", evaluations, f"{seconds:.2g}"]


def candidates_table(scenario: Scenario) -> TextTable:
    """Table of the time from a robot's numbers to the first derivatives of its diagram: a diagram
    for each robot, or one diagram whose parameters are set."""
    robot = Robot.of(scenario)
    signals = np.zeros(robot.structure.signals)
    softer = robot.model.cables.law._replace(stiffness=0.9 * robot.model.cables.law.stiffness)
    one = MakeTensegrityDiagram(robot, parameters=True)
    context = one.CreateDefaultContext()
    one.GetInputPort("signals").FixValue(context, signals)

    def make_another() -> None:
        diagram = MakeTensegrityDiagram(Robot.of(scenario))
        own = diagram.CreateDefaultContext()
        diagram.GetInputPort("signals").FixValue(own, signals)
        diagram.EvalTimeDerivatives(own)

    def set_parameters() -> None:
        cables, ground = (one.GetSubsystemByName(name) for name in ("cables", "ground"))
        cables.SetLaw(cables.GetMyMutableContextFromRoot(context), softer)
        ground.SetGround(ground.GetMyMutableContextFromRoot(context), robot.ground)
        one.EvalTimeDerivatives(context)

    rows, count = [], GIVEN["candidates"]
    for name, step in {"its own": make_another, "with parameters": set_parameters}.items():
        step()
        seconds = timeit(step, timer=time.process_time, number=count)
        rows.append([name, f"{1e3 * seconds / count:.3g}"])
    return TextTable(["diagram", "CPU ms per robot"], rows)


TABLES: dict[str, Callable[[Scenario], TextTable]] = {
    "engines": partial(engines_table, table="engines"),
    "batches": batches_table,
    "controlled": controlled_table,
    "integrators": partial(engines_table, table="integrators"),
    "sizes": sizes_table,
    "schemes": schemes_table,
    "candidates": candidates_table,
}
USUAL = [*TABLES][:3]
"""Tables that are printed without names."""


@script
def main(names: Sequence[str], scenario: Scenario | None = None) -> None:
    """Prints the tables of the given names, or the USUAL ones. Raises InputError."""
    for name in chosen(names or USUAL, TABLES, "TABLE"):
        print(f"{TABLES[name](scenario or load_scenario('thesis')).markdown()}\n", flush=True)
