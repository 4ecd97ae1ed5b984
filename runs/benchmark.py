"""Measures the speed and the accuracy of the engines.

    python runs/benchmark.py [TABLE ...]

Prints tables in Markdown for tetra_drake/engines/speed.md. The gaits are random gaits with seeds
0, 1 ... on the scenario `thesis`. Without names, the tables `engines`, `batches`, `grounds` and
`controlled` are printed:

    engines        speed and error of the engines
    integrators    speed and error for settings of the diagram; takes longest
    schemes        all integrators of Drake on the diagrams of `thesis` and `six_bar`
    candidates     time for another robot: a diagram for each, or one diagram with parameters
    batches        speed of the compiled engine with many gaits at a time
    grounds        speed by ground and network
    controlled     speed of robots that are controlled, on all cores
    sizes          CPU time of rows of tetrahedra, masts and lattices by the number of bodies, on
                   the compiled engine and Drake

Errors are differences of distances from converged simulations of the compiled engine. For MuJoCo,
with its different ground, they are from converged simulations of MuJoCo. Times are only meaningful
on an idle machine.
"""

from __future__ import annotations

import itertools
import statistics
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from pydrake.systems.analysis import GetIntegrationSchemes, ResetIntegratorFromFlags, Simulator

from tetra_drake.engines.drake import MakeSimulator
from tetra_drake.engines.mjcf import make_mjcf
from tetra_drake.engines.mujoco import installed
from tetra_drake.engines.simulate import simulate_many
from tetra_drake.engines.simulation import Simulation
from tetra_drake.errors import InputError, SimulationFailure
from tetra_drake.formatting import TextTable, fixed, listed
from tetra_drake.machine import available_cores
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.command import Command, controlled_robot
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.signals import DrivenRobot
from tetra_drake.robot.structure import node_positions
from tetra_drake.scenario.engine_kinds import Drake
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.robot_structure import StructureFile
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.scenario.structure_files import read_structure
from tetra_drake.systems.diagram import MakeTensegrityDiagram

GAITS = 12  # for each engine
BATCHES = (1, 2, 4, 8, 30, 240)  # gaits at a time
GROUND_BATCH = 30  # gaits at a time on each ground
CONTROLLED = (1, 8, 64, 512)  # robots at a time
ROLLOUT_PERIODS = 50  # control periods that MuJoCo simulates
SIZES = (5, 12, 24, 48, 96, 200)  # tetrahedra of a row, or vertebrae of a mast
SIDES = (1, 2, 3, 4, 6, 8)  # prisms along a side of a lattice
SPACING = 0.26  # m between the prisms of a lattice
SHORT = {"simulation.duration": 3.0, "simulation.steady_from": 1.0}  # s, on the diagram
LANES = 8  # gaits that a processor with AVX-512 simulates in the time of one
LARGEST_DIAGRAM = 50  # bodies
FIXED_STEPS = ("explicit_euler", "runge_kutta2", "semi_explicit_euler")  # without error control
LONGEST_STEP, SHORTEST_STEP = 1e-3, 7e-6  # s, of the schemes
ACCEPTED = 1.0  # mm, error of a scheme without error control
MOMENT = 3.0  # s that each scheme simulates
CANDIDATES = 100  # robots for which the time to a first evaluation is measured
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


def median_times(*runs: Callable[[], object]) -> np.ndarray:
    """Median wall time (s) of each function (functions,). They take turns in several rounds, so
    that other load on the machine affects all of them equally; a first round compiles."""
    rounds = []
    for _ in range(1 + ROUNDS):
        times = []
        for run in runs:
            started = time.perf_counter()
            run()
            times.append(time.perf_counter() - started)
        rounds.append(times)
    return np.median(rounds[1:], axis=0)


def speeds(*batches: tuple[Scenario, int], cores: int = 1) -> np.ndarray:
    """Speeds (batches,) of random gaits that are simulated together, as multiples of real time. A
    batch is a scenario and a number of gaits."""
    walks = [partial(walk, each, gaits, cores=cores, lanes=True) for each, gaits in batches]
    simulated = [gaits * each.simulation.duration for each, gaits in batches]
    return np.array(simulated) / median_times(*walks)


def batches_table(scenario: Scenario) -> str:
    """Table of the compiled engine's speed with many gaits at a time, on one core and on all."""
    compiled = scenario.with_changes({"engine": "!Compiled {}"})
    rows = []
    for cores in sorted({1, available_cores()}):
        batches = [(compiled, gaits) for gaits in BATCHES if gaits >= cores]
        too_few = [""] * (len(BATCHES) - len(batches))
        rows.append([str(cores), *too_few, *(f"{x:,.0f}" for x in speeds(*batches, cores=cores))])
    return TextTable(["cores/gaits", *map(str, BATCHES)], rows).markdown()


def grounds_table(scenario: Scenario) -> str:
    """Table of the speed on one core by ground and network."""
    rough, senses = load_scenario("rough"), load_scenario("feedback").cpg.feedback
    grounds: dict[str, dict[str, object]] = {
        "the scenario's": {},
        "live network": {"cpg.signals": "live"},
        "feedback": {"cpg.signals": "live", "cpg.feedback": senses},
        "rough": {"terrain": rough.terrain, "robot.contacts": rough.values()["robot.contacts"]},
    }
    batches = []
    for changes in grounds.values():
        compiled, drake = (
            scenario.with_changes({**changes, "engine": engine})
            for engine in ("!Compiled {}", "!Drake {}")
        )
        batches += [(compiled, 1), (compiled, GROUND_BATCH), (drake, 1)]
    rows = [
        [name, f"{alone:,.0f}", f"{many:,.0f}", fixed(drake)]
        for name, (alone, many, drake) in zip(grounds, speeds(*batches).reshape(-1, 3), strict=True)
    ]
    headings = ["ground", "compiled, one gait", f"compiled, {GROUND_BATCH} gaits", "drake"]
    return TextTable(headings, rows).markdown()


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


def controlled_table(scenario: Scenario) -> str:
    """Table of the speed of robots in control periods."""
    compiled, coulomb = scenario.with_changes({"engine": "!Compiled {}"}), load_scenario("coulomb")
    changes = {"friction": coulomb.friction, "engine": coulomb.engine, "name": coulomb.name}
    second = compiled.with_sections(**changes)
    rows = [*controlled_rows(compiled), *controlled_rows(second)]
    if installed():
        rows.append(rollout_row(second.with_changes({"friction.stiffness": "0 N/m"})))
    return TextTable(["control periods per second", *map(str, CONTROLLED)], rows).markdown()


def cpu_time(scenario: Scenario, gaits: int = 1) -> tuple[float, int]:
    """CPU time (s) of the simulations of some gaits side by side, and the number of their steps."""
    walk(brief(scenario), 1, cores=1, lanes=True)
    started = time.process_time()
    results = walk(scenario, gaits, cores=1, lanes=True)
    steps = sum(result.integrator.steps for result in results)
    return time.process_time() - started, steps


def sizes_table(scenario: Scenario) -> str:
    """Table of the CPU time of large robots by their number of bodies. The oscillators of a row are
    coupled to their neighbours only; otherwise the network would need most of the time."""
    rows = [scenario.with_changes({"robot.tetrahedra": size, "cpg.reach": 1}) for size in SIZES]
    masts = [load_scenario("mast").with_sections(robot=mast(size)) for size in SIZES]
    lattices = [load_scenario("prism").with_sections(robot=lattice(side)) for side in SIDES]
    kinds = {"row": rows, "mast": masts, "lattice": lattices}
    duration = {"simulation.duration": scenario.simulation.duration}
    table = []
    for kind, each in [(kind, one) for kind, robots in kinds.items() for one in robots]:
        one, bodies = each.with_numbers(duration), each.robot.body_count
        compiled, on_diagram = one.with_changes({"engine": "!Compiled {}"}), ""
        costs = [cpu_time(compiled, gaits) for gaits in (1, LANES)]
        if bodies <= LARGEST_DIAGRAM:
            short = one.with_numbers(SHORT).with_changes({"engine": "!Drake {}"})
            on_diagram = f"{cpu_time(short)[0] / short.simulation.duration:.3g}"
        per_body = [f"{1e6 * seconds / steps / bodies:.2f}" for seconds, steps in costs]
        table.append([kind, str(bodies), *per_body, on_diagram])
    headings = ["robot", "bodies", "compiled: µs per step and body, one gait"]
    headings += [f"{LANES} gaits at a time", "drake: s per simulated second"]
    return TextTable(headings, table).markdown()


def mast(vertebrae: int) -> StructureFile:
    """The shipped mast with another number of vertebrae."""
    tree, numbers = read_structure("mast").model_dump(), range(1, vertebrae + 1)
    pitch = tree["nodes"]["v2_centre"][0] - tree["nodes"]["v1_centre"][0]
    first = {name[3:]: place for name, place in tree["nodes"].items() if name.startswith("v1_")}

    def moved(pairs: list[list[str]], by: int) -> list[list[str]]:
        return [[f"v{int(node[1]) + by}_{node[3:]}" for node in pair] for pair in pairs]

    bar = tree["struts"]["v1"]
    for group in tree["cables"].values():
        pairs = [pair for pair in group["pairs"] if pair[0].startswith("v1_")]
        group["pairs"] = [pair for i in numbers[:-1] for pair in moved(pairs, i - 1)]
    driven = {name: group for name, group in tree["actuated"].items() if name.endswith("_1")}
    places = {
        f"v{i}_{n}": [x + (i - 1) * pitch, y, z] for i in numbers for n, (x, y, z) in first.items()
    }
    struts = {f"v{i}": bar | {"pairs": moved(bar["pairs"], i - 1)} for i in numbers}
    return StructureFile.model_validate(
        tree | {"nodes": places, "struts": struts, "actuated": driven}
    )


def lattice(side: int) -> StructureFile:
    """Square lattice of prisms. Cables join each to its neighbours, by the two nearest pairs of
    nodes below and above."""
    robot, tree = Robot.of(load_scenario("prism")), read_structure("prism").model_dump()
    p_WN = node_positions(robot.structure, robot.structure.initial_state)
    places = dict(zip(robot.structure.node_names, p_WN, strict=True))
    prisms, links = [*itertools.product(range(side), repeat=2)], []
    for way in ((1, 0), (0, 1)):
        step = SPACING * np.array([*way, 0.0])
        for level in (("n0", "n1", "n2"), ("n3", "n4", "n5")):
            near = sorted(
                itertools.product(level, repeat=2),
                key=lambda ab: float(np.linalg.norm(places[ab[1]] + step - places[ab[0]])),
            )
            for i, j in prisms:
                x, y = i + way[0], j + way[1]
                if max(x, y) < side:
                    links += [[f"{a}-{i}-{j}", f"{b}-{x}-{y}"] for a, b in near[:2]]
    for group in (*tree["struts"].values(), *tree["cables"].values()):
        of_one = group["pairs"]
        group["pairs"] = [[f"{a}-{i}-{j}", f"{b}-{i}-{j}"] for i, j in prisms for a, b in of_one]
    if links:
        loose = {"free_length": None, "tension": 0.1, "pairs": links}
        tree["cables"]["link"] = tree["cables"]["side"] | loose
    tree["actuated"] = {"side_1": ["side n0-0-0 n3-0-0"], "side_2": ["side n1-0-0 n4-0-0"]}
    tree["nodes"] = {
        f"{node}-{i}-{j}": (place + SPACING * np.array([i, j, 0.0])).tolist()
        for i, j in prisms
        for node, place in places.items()
    }
    return StructureFile.model_validate(tree)


def schemes_table(thesis: Scenario) -> str:
    """Table of all integrators of Drake on diagrams. Errors are of the bodies' positions at the
    end, from a converged simulation of the compiled engine.

    A scheme without error control gets the longest step with an error below ACCEPTED, of halves of
    LONGEST_STEP.
    """
    moment = {"simulation.duration": MOMENT, "simulation.steady_from": MOMENT / 2.0}
    rows = []
    for scenario in (thesis, load_scenario("six_bar")):
        short = scenario.with_numbers(moment)
        robot, gait = Robot.of(short), seeded_gait(short, 0)
        converged = short.with_changes({"engine": CONVERGED})
        [exact] = simulate_many(converged, [gait], record=True)
        if not isinstance(exact, SimulationResult):
            raise exact
        p_WB = exact.trajectory.p_WB[-1].to_numpy()
        accuracy = default_accuracy(robot, gait)
        for scheme in GetIntegrationSchemes():
            tried = Tried(f"accuracy {accuracy:.2g}", "found no step")
            if scheme not in FIXED_STEPS:
                tried = try_scheme(robot, gait, scheme, p_WB, accuracy=accuracy)
            step = LONGEST_STEP
            while scheme in FIXED_STEPS and step >= SHORTEST_STEP and tried.failure:
                tried = try_scheme(robot, gait, scheme, p_WB, step=step)
                step /= 2.0
            rows.append([f"`{scenario.name}`", f"`{scheme}`", *tried])
            print(*rows[-1], file=sys.stderr, flush=True)
    headings = ["robot", "scheme", "set to", "failure", "error, mm", "evaluations", "CPU s"]
    return TextTable(headings, rows).markdown()


class Tried(NamedTuple):
    """A try of an integrator, as cells of a table."""

    setting: str
    failure: str
    error_mm: str = ""
    evaluations: str = ""
    seconds: str = ""


def default_accuracy(robot: Robot, gait: Gait) -> float:
    """Target accuracy of the engine `drake` for a robot."""
    simulator = MakeSimulator(MakeTensegrityDiagram(robot, gait), robot, Drake())
    return float(simulator.get_integrator().get_target_accuracy())


def try_scheme(
    robot: Robot,
    gait: Gait,
    scheme: str,
    p_WB: np.ndarray,
    *,
    step: float = LONGEST_STEP,
    accuracy: float | None = None,
) -> Tried:
    """Simulates a diagram with an integrator of Drake, and compares the bodies' positions at the
    end with p_WB (bodies, 3) in m. `step` (s) is the longest step, or each step without an
    accuracy."""
    diagram = MakeTensegrityDiagram(robot, gait, scene_graph=scheme == "cenic")
    simulator = Simulator(diagram)
    integrator = ResetIntegratorFromFlags(simulator, scheme, step)
    setting = f"step {1e3 * step:.3g} ms"
    if accuracy is not None:
        integrator.set_target_accuracy(accuracy)
        setting = f"accuracy {accuracy:.2g}"
    started = time.process_time()
    try:
        simulator.AdvanceTo(robot.scenario.simulation.duration)
    except (SimulationFailure, RuntimeError) as error:
        return Tried(setting, str(error).splitlines()[0])
    seconds = time.process_time() - started
    state = diagram.GetOutputPort("state").Eval(simulator.get_context())
    found = state[: 7 * len(p_WB)].reshape(-1, 7)[:, 4:]
    error_mm = 1e3 * float(np.linalg.norm(found - p_WB, axis=1).max())
    failure = "" if accuracy or error_mm < ACCEPTED else f"error of {error_mm:.3g} mm"
    counted = integrator.get_num_derivative_evaluations()
    evaluations = f"{counted:,.0f}" if counted else "not counted"
    return Tried(setting, failure, f"{error_mm:.2g}", evaluations, f"{seconds:.2g}")


def candidates_table(scenario: Scenario) -> str:
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

    rows = []
    for name, step in {"its own": make_another, "with parameters": set_parameters}.items():
        step()
        started = time.process_time()
        for _ in range(CANDIDATES):
            step()
        rows.append([name, f"{1e3 * (time.process_time() - started) / CANDIDATES:.3g}"])
    return TextTable(["diagram", "CPU ms per robot"], rows).markdown()


TABLES = {"batches": batches_table, "grounds": grounds_table, "controlled": controlled_table}
MORE_TABLES = {"sizes": sizes_table, "schemes": schemes_table, "candidates": candidates_table}


def main(names: Sequence[str], scenario: Scenario) -> None:
    """Prints the tables of the given names, or `engines` and all of TABLES.

    Raises InputError."""
    tables = [*ENGINES, *TABLES, *MORE_TABLES]
    if unknown := {*names} - {*tables}:
        raise InputError("TABLE", "", f"found {listed([*unknown])}, expected {listed(tables)}")
    for name in names or ["engines", *TABLES]:
        if name in ENGINES:
            table = engines_table(scenario, ENGINES[name])
        else:
            table = (TABLES | MORE_TABLES)[name](scenario)
        print(f"{table}\n", flush=True)


if __name__ == "__main__":
    try:
        main(sys.argv[1:], load_scenario("thesis"))
    except InputError as error:
        sys.exit(f"benchmark.py: {error}")
