"""What the rows of refused_calls.yaml call, by its name here."""
# ruff: noqa: F401

import copy
import dataclasses
import functools
import math
import pickle
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from pydrake.common import RandomGenerator
from pydrake.geometry import SceneGraph
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.framework import DiagramBuilder

import tetra_drake as td
from helpers.actuations import WINCH
from helpers.anchored import BAR, HUNG, SWINGING, TREES, scenario_of
from helpers.bars import ACROSS, loose_bars
from helpers.brief import BRIEF
from helpers.controllers import OwnGround, Springs
from helpers.converged import shortly
from helpers.made_up_walk import make_walk
from helpers.policies import Given
from helpers.rod import LAW, rod_with_tendons
from tetra_drake.engines.drake import MakeDisturbedSimulator
from tetra_drake.engines.simulate import check_scenario, simulate, simulate_many
from tetra_drake.figures.style import Look, figure_function, page_of
from tetra_drake.gym import TensegrityEnv, TensegrityVectorEnv
from tetra_drake.lab.bridges.sdf import make_sdf
from tetra_drake.lab.fit.fit import fit
from tetra_drake.lab.fit.measurements import Rest
from tetra_drake.lab.linearization.linearization import linearize
from tetra_drake.lab.planner import Planner
from tetra_drake.lab.stepping.simulation import Simulation
from tetra_drake.lab.study.equilibrium import save_structure_page, study_equilibrium
from tetra_drake.lab.study.sweep import sweep
from tetra_drake.laws.actuator import Winch
from tetra_drake.laws.cable import CableLaw
from tetra_drake.laws.contact import MODE_COLUMNS, GroundSection, NormalForce
from tetra_drake.laws.friction import Coulomb
from tetra_drake.laws.terrain import Flat, Grid, Relief
from tetra_drake.robot.command import Command, controlled_robot, driven_robot
from tetra_drake.robot.ground import make_surface
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.signals import save_signals
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.structure_files import read_structure
from tetra_drake.systems import AddCables, AddGroundContact, Cable
from tetra_drake.systems.diagram import MakeTensegrityDiagram

LIFTED = HUNG | {"actuated": {"lift": ["line top a"]}}


def scenario(name: str, changes: Any = None):
    return load_scenario(name).with_changes(changes or {})


def robot(name: str, changes: Any = None):
    return Robot.of(scenario(name, changes))


def gait(name: str, changes: Any = None):
    return td.seeded_gait(scenario(name, changes))


def simulated(name: str, changes: Any = None, **drive: Any):
    """A simulation, by a seeded gait unless something else drives it."""
    chosen = scenario(name, changes)
    simulate(chosen, **drive or {"gait": td.seeded_gait(chosen)})


def brief(name: str, changes: Any):
    return scenario(name, BRIEF | changes)


def answered(answer: Any = None, bounds: tuple[float, float] = (0.0, 1.0)):
    """A simulation by a policy with this answer, within these bounds of its parameter."""
    Given.answer, Given.bounds = answer, bounds
    chosen = brief("prism", {}).with_sections(policy=Given())
    simulate(chosen, td.seeded_gait(chosen))


def gridded(heights: Any, cell: tuple[float, float] = (1.0, 1.0)):
    """A robot on a terrain of a plug-in that has these heights."""

    class Odd(Relief):
        def grid(self, **_: Any) -> Grid:
            return Grid(heights, (-1.0, -1.0), cell)

    Robot.of(scenario("prism").with_sections(terrain=Odd()))


def steered(steering: Any):
    simulate(brief("turning", {}), gait("turning"), steering=steering)


def controlled(engine: str, actions: Any):
    """A simulation by a controller whose actions are wrong from 0.05 s on."""
    walk = {"robot.tetrahedra": 3, "friction.stiffness": "0 N/m", "cpg.start_up": 0.0}
    walk |= {"simulation.duration": "0.1 s", "simulation.steady_from": "0.05 s", "engine": engine}
    held = np.ones(4)
    simulated("coulomb", walk, controller=lambda time, _: actions if time > 0.05 else held)


@functools.cache
def prism():
    return linearize("prism")


@functools.cache
def hung(**changes):
    return scenario_of(HUNG | changes)


def started(name: str, **start: Any):
    return Robot.of(scenario_of(TREES[name] | {"start": {"rest": False} | start}))


def tolerant():
    return scenario_of(HUNG | {"tolerances": {"masses": "2 % each"}})


def planner(cost: Any = (("p_WN", [0.0, 0.0, -1.0]),), scenario=None, **options):
    """A planner of a lifted mass."""
    lifted = scenario or scenario_of(LIFTED, 0.1)
    small = {"samples": 32, "horizon": 0.1, "knots": 4, "control_period": 0.01, "workers": 1}
    given = dict(cost) if isinstance(cost, tuple) else cost
    return Planner(lifted, given, **small | {"limits": [[-1.0], [1.0]]} | options)


def fitted(parameters=None, **changes):
    given = parameters or {"robot.cables.line.stiffness": (100.0, 400.0)}
    case = {"measurements": [Rest(positions={"a z": 0.5})]}
    fit(hung(), (case | changes)["measurements"], given, out=Path("fit"), source="fit.yaml")


def swept(changes):
    short = shortly(td.load_scenario("thesis"), 0.4, engine="!Compiled")
    sweep(short, td.seeded_gait(short), changes)


@functools.cache
def one():
    env = TensegrityEnv("walk", grouped=True)
    env.reset(seed=0)
    return env


@functools.cache
def many():
    envs = TensegrityVectorEnv(2, "walk")
    envs.reset(seed=0)
    return envs


@functools.cache
def quick():
    """0.2 s on the compiled engine, with disturbances: ten control periods."""
    short = shortly(load_scenario("quick"), 0.2, engine="!Compiled")
    return short.with_changes({"disturbances": {"draws": 1}})


@functools.cache
def two():
    return Simulation(quick(), count=2, workers=1)


@functools.cache
def ended():
    """Two robots, of which only the second has ended."""
    robots = Simulation(quick(), count=2, workers=1)
    for _ in range(10):
        robots.step(robots.rest)
    robots.reset(indices=[0])
    return robots


@functools.cache
def restored(periods: int):
    """Three robots after some periods, whose history was not restored; one has a cut cable."""
    robots = Simulation(quick(), count=3)
    robots.step(robots.rest)
    robots.restore(robots.save())
    robots.damage(0, cables=["T1-T2 outer top"])
    for _ in range(periods - 1):
        robots.step(robots.rest)
    return robots


def restore(**changes: Any):
    """States with other fields, and with other tables that are numbers."""
    robots = Simulation(quick())
    states = robots.save()
    tables = {name: np.array([x]) for name, x in changes.pop("tables", {}).items()}
    robots.restore(dataclasses.replace(states, tables={**states.tables, **tables}, **changes))


def drawn(changes: Any = None, generator: Any = None):
    """A simulator of a disturbed scenario."""
    given = {"disturbances": {"draws": 1, "start": 0.05}} | (changes or {})
    disturbed = scenario("coulomb", given)
    MakeDisturbedSimulator(disturbed, gait("coulomb"), generator or RandomGenerator(1))


@functools.cache
def rods():
    """Two rods, each in a plant of its own."""
    return [rod_with_tendons() for _ in range(2)]


def tip(number: int = 0):
    """The free end of a rod."""
    return rods()[number][2]


def left():
    """The first tendon of the first rod."""
    return rods()[0][3][0]


def cable(frame_a: Any, frame_b: Any, **law: Any):
    return [Cable("a", frame_a, frame_b, LAW._replace(**law))]


def attach(**given: Any):
    builder, plant, _, cables = rods()[0]
    AddCables(builder, **{"plant": plant, "cables": cables} | given)


def attach_to_ghost(*, finalized: bool):
    builder = DiagramBuilder()
    plant = builder.AddSystem(MultibodyPlant(0.0))
    plant.AddRigidBody("ghost", SpatialInertia.Zero())
    if finalized:
        plant.Finalize()
    AddCables(builder, plant, cables=[])


def surface(damping: float = 0.0):
    ground = make_surface(GroundSection(stiffness=1e3, damping=0.0), Coulomb(), Flat())
    return ground._replace(normal=np.array(NormalForce(1e3, damping)))


def on_ground(**given: Any):
    builder, plant, end, _ = rods()[0]
    AddGroundContact(builder, plant, **{"frames": [end], "ground": surface()} | given)


@functools.cache
def diagram(parameters: bool):
    return MakeTensegrityDiagram(robot("coulomb"), gait("coulomb"), parameters=parameters)


def put(name: str, constants: Any, *, into: str = "", parameters: bool = True):
    """Gives a system constants, in its context or in that of another system; "root" and "none"."""
    own = diagram(parameters)
    root = own.CreateDefaultContext()
    parts: dict[str, Any] = {"none": None, "root": root}
    cables, ground = (own.GetSubsystemByName(part) for part in ("cables", "ground"))
    parts |= {part.get_name(): part.GetMyMutableContextFromRoot(root) for part in (cables, ground)}
    (cables.SetLaw if name == "cables" else ground.SetGround)(parts[into or name], constants)


def with_controller(inputs: dict[str, int], outputs: dict[str, int]):
    """A diagram of three tetrahedra whose controller has these ports."""
    driven = controlled_robot(scenario("coulomb", {"robot.tetrahedra": 3}))
    MakeTensegrityDiagram(driven, controller=Springs(driven, inputs, outputs))


def with_ground(ground: OwnGround, changes: Any = None, **options: Any):
    """A diagram of the thesis's robot on a ground of one's own."""
    given = robot("thesis", changes), gait("thesis", changes)
    MakeTensegrityDiagram(*given, ground=ground, **options)


def walk():
    """A recorded walk of two tetrahedra."""
    return make_walk(bodies=2, duration=0.1)
