"""Agreement of the engines: a table of walks, and one of sets of random gaits.

A row has a scenario, what drives the robot, two engines, and how far each compared quantity may be
apart: a variable of the trajectory at all times, or a metric.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
import pytest
from helpers.actuations import LIMITED, MOTOR, WINCH
from helpers.anchored import HUNG, floating_prism, scenario_of, slung_prism, supported_prism
from helpers.controllers import follow_waves
from helpers.converged import shortly
from helpers.gaits import with_values
from helpers.joined import with_arm
from helpers.laws import COULOMB, FRICTIONS, RESET, UNEVEN

from tetra_drake.engines.mujoco import INSTALL, installed
from tetra_drake.engines.simulate import simulate, simulate_many
from tetra_drake.laws.feedback import PATHWAYS
from tetra_drake.laws.terrain import Flat
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.command import Command, controlled_robot
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.parameter_space import WALKING_SEED, seeded_gait
from tetra_drake.scenario.engine_kinds import Compiled, Drake, Mujoco
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.metrics import METRICS
from tetra_drake.scenario.scenario import Scenario

Changes = Mapping[str, Any]
Engine = Compiled | Drake | Mujoco


@dataclasses.dataclass(frozen=True)
class Limit:
    """MuJoCo with ever shorter steps: its error is of first order, so two steps tell."""

    step: float
    """The longer step (s)."""


FINE = (
    Compiled(tolerance=1e-6, max_step=5e-4),
    Drake(scheme="radau3", accuracy=1e-5, max_step=1e-3, look_ahead=1e-6),
)
CONVERGE = (
    Compiled(tolerance=1e-7, max_step=1e-4),
    Drake(scheme="runge_kutta3", accuracy=1e-5, max_step=5e-4, mode_changes="witness"),
)
EXPLICIT = (
    FINE[0],
    Drake(scheme="runge_kutta3", accuracy=1e-4, max_step=2e-3, mode_changes="witness"),
)
ACCURATE = (Compiled(), Drake(accuracy=1e-3))
"""The diagram's error of 0.002 in; by default it is 0.016 in with motors."""
DEFAULT = (Compiled(), Drake())
NO_BRISTLES = {"friction.stiffness": "0 N/m"}
"""Coulomb friction as in MuJoCo."""


def gait(seed: int = WALKING_SEED, **changes: Any) -> Callable[[Scenario], Changes]:
    """A seeded gait that drives the robot, with some parameters changed."""
    return lambda scenario: {"gait": with_values(seeded_gait(scenario, seed), **changes)}


def steered(scenario: Scenario) -> Changes:
    """A gait that turns from 0.05 s on, ever more."""
    return gait()(scenario) | {"steering": lambda time: max(0.0, 5.0 * (time - 0.05))}


def pulled_in_waves(scenario: Scenario) -> Changes:
    """A controller that knows the lengths of the cables."""
    return {"controller": functools.partial(follow_waves, controlled_robot(scenario))}


def waves(mean: float, amplitude: float) -> Callable[[Scenario], Changes]:
    """Sines of 1 Hz that run along the robot, left and right alike, ever larger for half a
    second."""
    times = np.arange(0.0, 3.0, 0.01)[:, np.newaxis]
    phases = 2.0 * np.pi * (times - 0.2 * (np.arange(8) // 2))
    samples = mean + amplitude * np.clip(2.0 * times, 0.0, 1.0) * np.sin(phases)
    return lambda scenario: {"command": Command("waves", 0.01, samples)}


@dataclasses.dataclass(frozen=True)
class Row:
    """A walk on two engines."""

    scenario: str | Scenario
    """A shipped one, by its name, or one of structures without ground."""
    duration: float
    changes: Changes
    engines: tuple[Engine, Engine | Limit]
    within: Mapping[str, float]
    """Largest difference by the name of a quantity, in SI units; distance_in in inches. A metric
    that has the name of a variable is metrics.NAME."""
    drive: Callable[[Scenario], Changes]
    moves: float = 0.0
    """Least size of the first quantity's change in the walk."""
    relative: float = 0.0
    """Part of a quantity by which it may differ, too."""


def rows() -> Iterable[Any]:
    """The table."""

    def row(name: str, *cells: Any, slow: bool = False, **more: Any) -> Any:
        walk = Row(*cells, **more)
        needs = [pytest.mark.slow] if slow else []
        if isinstance(walk.engines[1], Mujoco | Limit):
            needs.append(pytest.mark.skipif(not installed(), reason=INSTALL))
        return pytest.param(walk, id=name, marks=needs)

    # Each engine places a mode change to 1e-7 s. There friction jumps by up to sigma_1 v, that is
    # 70 N s/m * 0.05 m/s = 3.5 N on a body of 0.02 kg: a velocity error of 1.75e-5 m/s, and
    # 4e-6 m after 0.25 s. Some such changes add up. Coulomb friction hardly jumps.
    counts = [(5, "thesis", 2, 0.25), (2, "thesis-reversal", 3, 0.2), (8, "thesis", 1, 0.1)]
    for count, scenario, seed, duration in counts:
        changes = {"robot.tetrahedra": count}
        name = f"{count} tetrahedra"
        yield row(name, scenario, duration, changes, CONVERGE, {"p_WN": 5e-6}, gait(seed), 1e-3)
    laws = [("incline", "reset")] + [("rough", law) for law in FRICTIONS]
    laws += [(terrain, "firm") for terrain in UNEVEN if terrain not in ("incline", "rough")]
    for terrain, law in laws:
        changes = {"robot.tetrahedra": 3, "robot.contacts": "all", "terrain": UNEVEN[terrain]}
        changes["friction"] = FRICTIONS[law]
        within = {"p_WN": 1e-5 if law in RESET else 1e-6}  # some forty mode changes
        cells = "thesis", 0.04, changes, CONVERGE, within, gait(2), 5e-4
        yield row(f"{terrain}, {law}", *cells)
    # The reset integrator's modes change 1e5 times while a robot with feedback lands.
    changes = {"cpg.signals": "live", "cpg.feedback": list(PATHWAYS), "friction": COULOMB}
    drive = gait(**{f"gain {pathway}": 1.0 for pathway in PATHWAYS})
    within = {"p_WN": 1e-6, "signal": 2e-5}
    yield row("feedback", "thesis", 0.1, changes, CONVERGE, within, drive)
    changes = {"cpg": "!Phase {gain: 2 N, start_up: 0 s}", "friction": COULOMB}
    changes["cpg.feedback"] = list(PATHWAYS)
    within = {"p_WN": 1e-6, "signal": 2e-5}
    cells = "thesis", 0.15, changes, CONVERGE, within, drive, 1e-4
    yield row("phase oscillators", *cells, slow=True)  # compiles the stepping kernel
    for signals in ("listing", "live"):
        changes = {"cpg.signals": signals, "cpg.listing_step": "1e-4 s", "gait_bounds.turn": 0.0}
        name = f"steering, {signals}"
        yield row(name, "turning", 0.15, changes, CONVERGE, {"signal": 2e-4}, steered)

    begin = {"cpg.start_up": "0.25 s", "simulation.steady_from": "1 s"}
    within = {"distance_in": 1e-4}  # seen: 1e-5
    yield row("six_bar", "six_bar", 1.5, begin, FINE, within, gait(2), 0.01, slow=True)
    cases = [("prism", kind, 12.0) for kind in LIMITED] + [("six_bar", "winch", 6.0)]
    cases += [("coulomb", kind, 4.0) for kind in LIMITED]
    for scenario, kind, force in cases:  # forces that hold the robot up
        changes = begin | {"actuation": LIMITED[kind].model_copy(update={"max_force": force})}
        within = {"distance_in": 1e-3}  # seen: 1e-5; 6e-4 where software damping shakes the prism
        cells = scenario, 2.5, changes, FINE, within, gait(2), 0.02
        yield row(f"{scenario}, {kind}", *cells, slow=True)
    begin = {"cpg.start_up": "0.1 s", "simulation.steady_from": "0.2 s"}
    yield row("prism", "prism", 0.6, begin, EXPLICIT, {"distance_in": 1e-4}, gait(8), 0.05)
    round_feet = begin | {"robot.struts.bar.contact_radius": "8 mm", "robot.masses": {"n4": "50 g"}}
    yield row("payload", "prism", 0.3, round_feet, EXPLICIT, {"p_WN": 1e-5}, gait(3), 5e-3)
    # Structures on supports, with loads, and floating.
    bounces = scenario_of(HUNG | {"offsets": [[0.01, 0.0, -0.01]]})
    for name, scenario, engines, apart in (
        ("supported", supported_prism(), CONVERGE, 1e-6),
        ("supported", supported_prism(), DEFAULT, 1e-4),
        ("hung", bounces, DEFAULT, 1e-4),
        ("supported", supported_prism(), (CONVERGE[0], Mujoco()), 1e-4),
        ("hung", bounces, (CONVERGE[0], Mujoco()), 1e-4),
        ("floating", floating_prism(), (CONVERGE[0], Mujoco()), 1e-4),
        ("joint and ring", with_arm(), CONVERGE, 1e-6),
        ("joint and ring", with_arm(), (CONVERGE[0], Mujoco()), 1e-4),
        ("over fixed rings", slung_prism("west n3 east"), CONVERGE, 1e-6),
        ("over fixed rings", slung_prism("west n3 east"), (CONVERGE[0], Mujoco()), 1e-4),
        ("from node to node", slung_prism("n0 west n3 east n4"), CONVERGE, 1e-6),
        ("from node to node", slung_prism("n0 west n3 east n4"), (CONVERGE[0], Mujoco()), 1e-4),
    ):
        yield row(name, scenario, 0.15, NO_BRISTLES, engines, {"p_WN": apart}, gait(3), 1e-3)
    for scenario, force in (("motors", 0.04), ("winch", 0.5)):
        changes = {"cpg.start_up": "0.25 s", "simulation.steady_from": "0.6 s"}
        within = {"distance_in": 5e-3, "peak_actuator_force": force, "actuator_limited": 0.01}
        yield row(scenario, scenario, 1.2, changes, DEFAULT, within, gait(3), 0.05)

    begin = {"simulation.steady_from": "0.2 s"}
    commands = {"force": ({}, waves(0.0, 1.5))}
    commands |= {"motor": (MOTOR, waves(2.6, 1.2)), "winch": (WINCH, waves(0.085, 0.01))}
    for kind, (actuation, command) in commands.items():
        changes, name = begin | actuation, f"command, {kind}"
        yield row(name, "coulomb", 0.3, changes, DEFAULT, {"distance_in": 2e-3}, command, 0.05)

    changes, engines = begin | NO_BRISTLES, (Compiled(), Limit(2e-4))
    command = commands["force"][1]
    yield row("command, MuJoCo", "coulomb", 0.3, changes, engines, {"distance_in": 5e-4}, command)
    begin |= {"cpg.start_up": "0.1 s"}
    for scenario, duration, seed in (("prism", 0.6, 8), ("six_bar", 1.5, 2), ("coulomb", 0.6, 2)):
        changes, engines = begin | NO_BRISTLES, (FINE[0], Limit(2e-4))
        name, within, slow = f"{scenario}, MuJoCo", {"distance_in": 2e-3}, scenario == "six_bar"
        yield row(name, scenario, duration, changes, engines, within, gait(seed), 0.05, slow=slow)
    begin = {"cpg.start_up": "0.25 s", "simulation.steady_from": "0.6 s"}
    for kind in LIMITED:
        actuation = LIMITED[kind].model_copy(update={"max_force": 12.0})
        changes = begin | NO_BRISTLES | {"actuation": actuation}
        # The motor's software damping shakes the prism: its first order shows in short steps only.
        engines, name = (FINE[0], Limit(5e-5)), f"prism, {kind}, MuJoCo"
        within = {"distance_in": 2e-3, "metrics.actuator_limited": 2e-4}
        yield row(name, "prism", 1.5, changes, engines, within, gait(2), slow=True)
    # Samples are in the middle of control periods.
    changes = {"robot.tetrahedra": 3, "simulation.sample_period": "0.122 s"} | NO_BRISTLES
    for other in (Drake(), Mujoco()):
        engines, within = (Compiled(), other), {"p_WN": 3e-4, "signal": 0.01}
        cells = "coulomb", 0.61, changes, engines, within, pulled_in_waves, 5e-3
        yield row(f"controller, {other.tag}", *cells)
    changes = {"policy": "!Network {hidden: 3, readings: [clock, lengths, w_WB]}"}
    changes |= {"events": [{"at": "0.153 s", "cut": ["side n2 n5"]}], "cpg.gain": "2.7 N"}
    yield row("policy", "prism", 0.21, changes, CONVERGE, {"p_WN": 2e-5}, gait(3), 1e-3)
    # A fifth of a second after events, two of them at once.
    events = [{"at": "0.1 s", "cut": ["T1-T2 outer bottom_left"], "lose": ["T2"]}]
    events += [{"at": "0.1 s", "change": {"friction.static": 0.2, "friction.kinetic": 0.1}}]
    changes = {"robot.tetrahedra": 2, "robot.payload": ["0 g", "9 g"], "events": events}
    yield row("events", "coulomb", 0.3, changes, CONVERGE, {"p_WN": 4e-6}, gait(2), 1e-3)
    loss = [{"at": "0.1 s", "cut": ["side n3 n0"]}, {"at": "0.1503 s", "lose": ["n1"]}]
    changes = {"robot.masses": {"n1": "50 g"}, "events": loss} | NO_BRISTLES
    prism = floating_prism(duration=0.3)
    for name, other, apart in (
        ("cut and loss", CONVERGE[1], 2e-6),
        ("cut and loss, MuJoCo", Limit(1e-4), 1e-5),
    ):
        engines, within = (CONVERGE[0], other), {"p_WN": apart, "p_WB": apart}
        yield row(name, prism, 0.3, changes, engines, within, gait(2), 1e-3)
    # All metrics, on Coulomb friction, where small errors stay small.
    changes = {"robot.tetrahedra": 3, "cpg.start_up": "0.2 s", "cpg.gain": "3 lbf"} | NO_BRISTLES
    changes |= {"simulation.steady_from": "0.5 s", "simulation.sample_period": "1e-3 s"}
    lacking, absolute = load_scenario("coulomb").lacking, {"m": 2e-6, "1/m": 2e-4}
    metrics = {name: one for name, one in METRICS.items() if one.needs not in lacking}
    within = {f"metrics.{name}": absolute.get(one.unit, 1e-6) for name, one in metrics.items()}
    coarse = {"rolled": 5e-4, "signal_rate": 0.02, "clearance": 5e-5, "peak_actuator_power": 5e-3}
    within |= {f"metrics.{name}": most for name, most in coarse.items()}  # by steps and samples
    cells = "coulomb", 2.0, changes
    yield row("all metrics", *cells, ACCURATE, within, gait(3), relative=1e-3)
    # On MuJoCo's ground with constant damping, the robot settles and slides a little otherwise. Its
    # feet chatter: they leave the ground for a step every few.
    chatters = ("metrics.lifted", "metrics.path_curvature")
    within = {name: 10.0 * value for name, value in within.items() if name not in chatters}
    within["metrics.peak_actuator_speed"] = 5e-3
    cells, engines = ("coulomb", 1.2, changes), (Compiled(), Mujoco())
    yield row("all metrics, MuJoCo", *cells, engines, within, gait(3), relative=5e-3)
    # Bodies, cables and motors are the same; only the ground differs.
    within = {"p_WN": 3e-8, "v_WN": 6e-6, "p_WB": 3e-8, "q_WB": 2e-7}
    within |= {"length": 6e-8, "tension": 6e-5, "signal": 1e-9}
    network = {"cpg.signals": "listing", "cpg.start_up": "0.105 s"}
    phases = {"cpg": "!Phase {gain: 2 lbf, start_up: 0.105 s, signals: listing}"}
    cut = network | {"events": [{"at": "0.15 s", "cut": ["T1-T2 outer bottom_left"]}]}  # driven
    for count, cpg, other, step in (
        (2, network, FINE[0], 4e-5),
        (5, network, FINE[0], 4e-5),
        (8, network, FINE[0], 4e-5),
        (3, phases, CONVERGE[1], 4e-5),
        (4, cut, CONVERGE[0], 1e-5),
    ):
        changes = {"robot.tetrahedra": count, "robot.gravity": 0.0}
        changes |= {"robot.offsets": [[0.0, 0.0, "1 m"]] * count}
        engines, name = (other, Limit(step)), f"{count} tetrahedra in the air, MuJoCo"
        yield row(name, "thesis", 0.2, changes | cpg, engines, within, gait(), 1e-3)
    # The damping of the normal force differs, so that the robot lands a little differently.
    changes = {"terrain": UNEVEN["incline"], "friction": COULOMB, "cpg.start_up": "0.105 s"}
    engines = Compiled(), Mujoco()
    yield row("incline, MuJoCo", "thesis", 1.0, changes, engines, {"p_WN": 5e-5}, gait(), 3e-3)


def quantities(
    scenario: Scenario, engine: Engine | Limit, row: Row, names: Iterable[str]
) -> dict[str, np.ndarray]:
    """The compared quantities of a walk, by their names. The first sample of a trajectory is left
    out: the listing's first signal is not zero, which is kept as zero."""
    if isinstance(engine, Limit):
        steps = (engine.step, 0.5 * engine.step)
        coarse, fine = (quantities(scenario, Mujoco(step=h), row, names) for h in steps)
        return {name: 2.0 * fine[name] - coarse[name] for name in names}
    on_engine = scenario.with_changes({"engine": engine})
    result = simulate(on_engine, record=True, **row.drive(on_engine))
    trajectory, metrics = result.trajectory, result.metrics
    return {
        name: trajectory[name].values[1:]
        if name in trajectory
        else np.array(getattr(metrics, name.removeprefix("metrics.")))
        for name in names
    }


@pytest.mark.parametrize("row", list(rows()))
def test_a_robot_walks_alike_on_two_engines(row):
    whole = load_scenario(row.scenario) if isinstance(row.scenario, str) else row.scenario
    scenario = shortly(whole, row.duration).with_changes(row.changes)
    ours, theirs = (quantities(scenario, engine, row, row.within) for engine in row.engines)
    for name, tolerance in row.within.items():
        allowed = tolerance + row.relative * np.abs(ours[name]).max()
        assert np.abs(ours[name] - theirs[name]).max() <= allowed, name
    first = ours[next(iter(row.within))]
    motion = np.ptp(first, axis=0).max() if first.ndim else abs(first)
    assert motion > row.moves


@dataclasses.dataclass(frozen=True)
class Set:
    """Random gaits on two engines."""

    scenario: str
    changes: Changes
    engines: tuple[Engine, Engine]
    median: float
    """Largest median of the difference, in."""
    nine_of_ten: float
    """Largest difference of nine gaits of ten, in."""
    seeds: Iterable[int] = range(20)


def sets() -> Iterable[Any]:
    """The table."""
    # On Coulomb friction, where errors are below 0.001 in. Under the reset integrator, distances
    # hang on whether a foot just slips.
    diagram = Drake(accuracy=1e-4, max_step=2e-3)
    for terrain, surface in {"flat": Flat(), **UNEVEN}.items():
        changes = {"terrain": surface, "simulation.max_evaluations": 10**8, "friction": COULOMB}
        changes |= {"robot.contacts": "all"} if terrain != "flat" else {}
        yield pytest.param(Set("thesis", changes, (FINE[0], diagram), 0.05, 0.2), id=terrain)
    live = {"cpg.signals": "live", "cpg.feedback": list(PATHWAYS)}
    # Within 0.03 in of converged distances.
    witnessed = Drake(scheme="runge_kutta3", accuracy=1e-3, max_step=2e-3, mode_changes="witness")
    engines = Compiled(tolerance=1e-6, max_step=3e-4), witnessed
    yield pytest.param(Set("thesis-reversal", live, engines, 0.05, 0.2), id="feedback")
    yield pytest.param(Set("prism", {}, FINE, 1e-4, 1e-3), id="prism")
    # The default settings. A late mode change costs these gaits 0.1 in or more on the diagram.
    late = (7, 10, 14, 22, 24, 26, 30, 31)
    walks = Set("thesis-reversal", {}, (FINE[0], Drake()), 0.05, np.inf, late)
    yield pytest.param(walks, id="the diagram's defaults where nodes slip")
    walks = Set("thesis", {}, (FINE[0], Drake()), 0.01, 0.1, range(1000, 1012))
    yield pytest.param(walks, id="the diagram's defaults")


def distances(scenario: Scenario, engine: Engine, gaits: list[Gait]) -> np.ndarray:
    """How far (in) gaits walk."""
    results = simulate_many(scenario.with_changes({"engine": engine}), gaits)
    assert all(isinstance(result, SimulationResult) for result in results)
    return np.array([result.metrics.distance_in for result in results])


@pytest.mark.slow
@pytest.mark.parametrize("row", list(sets()))
def test_random_gaits_walk_as_far_on_two_engines(row):
    scenario = load_scenario(row.scenario).with_changes(row.changes)
    gaits = [seeded_gait(scenario, seed) for seed in row.seeds]
    ours, theirs = (distances(scenario, engine, gaits) for engine in row.engines)
    apart = np.abs(ours - theirs)
    assert np.median(apart) < row.median
    assert np.quantile(apart, 0.9, method="lower") < row.nine_of_ten
