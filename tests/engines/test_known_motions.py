"""Robots whose motion is known: analytic answers, what is conserved, Drake's own contact."""

import dataclasses
import functools
from collections.abc import Callable

import numpy as np
import pytest
from helpers import joined
from helpers.anchored import HUNG, SWINGING, TREES, scenario_of, supported_prism
from helpers.bars import ACROSS, CROSSED, RADIUS, STIFFNESS, loose_bars
from helpers.converged import CONVERGED, shortly
from helpers.hanging import HANGING, MASS
from helpers.hanging import STIFFNESS as CABLE_STIFFNESS
from helpers.states import energy_and_momenta
from helpers.structures import (
    driven_as_recorded,
    end_on_diagram,
    motion_of,
    poses_of,
    simulated,
    thrown,
    unit_inertias,
)
from pydrake.geometry import AddContactMaterial, Capsule, ProximityProperties
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import DiagramBuilder

from tetra_drake.engines.drake import MakeSimulator
from tetra_drake.engines.simulate import simulate
from tetra_drake.kernels.packed import Packed
from tetra_drake.laws.forces import Forces, compute_state_forces
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import AddBodies, moved_nodes
from tetra_drake.scenario.engine_kinds import Compiled, Drake, Mujoco
from tetra_drake.scenario.load import load_scenario
from tetra_drake.systems.diagram import MakeTensegrityDiagram

G = 9.80665
ACCURATE = {
    "!Compiled": CONVERGED["compiled"],
    "!Drake": Drake(scheme="radau3", accuracy=1e-6, max_step=1e-3),
    "!Mujoco": Mujoco(),
}


def trajectory_of(robot: Robot, engine: str):
    """The trajectory of a robot from its start, on an engine, accurate if it has no settings."""
    changes = {"engine": ACCURATE.get(engine, engine), "friction.stiffness": "0 N/m"}
    robot = dataclasses.replace(robot, scenario=robot.scenario.with_changes(changes))
    return motion_of(robot, seed=3)


def on_a_spring(robot: Robot, times: np.ndarray) -> np.ndarray:
    """A bar that was let go below its rest bounces up and down."""
    k, mass = HUNG["cables"]["line"]["stiffness"], robot.structure.mass.sum()
    low = robot.scenario.robot.offsets[-1][2]
    z = 1.0 - 0.4 - mass * G / k + low * np.cos(np.sqrt(k / mass) * times)
    upright = np.stack([z, z - 0.2, 1.0 + 0.0 * z], axis=1)
    return upright[:, :, None] * [0.0, 0.0, 1.0]


def between_two_cables(robot: Robot, times: np.ndarray) -> np.ndarray:
    """A point mass between cables without free length, each of which pulls by k times its way."""
    rest = 1.0 - MASS * G / (2.0 * CABLE_STIFFNESS)
    z = rest - 0.01 * np.cos(np.sqrt(2.0 * CABLE_STIFFNESS / MASS) * times)
    held = np.tile([[0.0, 0.0, 1.0], [0.2, 0.0, 1.0]], (len(times), 1, 1))
    return np.concatenate([held, np.stack([0.1 + 0 * z, 0 * z, z], axis=1)[:, None]], axis=1)


ANGLE = 0.5
CROSSING = [((-0.1, y, 0.0), (0.1, y, 0.0)) for y in (-0.05, 0.05)]
CROSSING += [((0.0, -0.1, 2.0 * RADIUS), (0.0, 0.1, 2.0 * RADIUS))]
"""Ends of two bars, and of one across them."""


def leaning() -> Robot:
    """A bar whose upper end is held, turned about it."""
    robot = Robot.of(scenario_of(SWINGING, duration=0.6))
    return joined.turned(robot, {0: ANGLE}, {0: np.zeros((2, 3))})


def as_a_pendulum(robot: Robot, times: np.ndarray) -> np.ndarray:
    structure, lever = robot.structure, np.linalg.norm(robot.structure.p_BN[0])
    square = G * lever / (structure.unit_inertia[0, 0] + lever**2)
    angle = joined.swing(square, times, angle=ANGLE)
    place = 0.4 * np.stack([-np.sin(angle), 0.0 * angle, -np.cos(angle)], axis=1)
    return np.stack([0.0 * place, place], axis=1)


def lowered(tree: dict, duration: float, low: float = -0.01) -> Robot:
    """A robot whose last body starts below its place of rest, by default by 1 cm."""
    bodies = 2 if tree is HANGING else 1
    offsets = [[0.0, 0.0, 0.0]] * (bodies - 1) + [[0.0, 0.0, low]]
    return Robot.of(scenario_of(tree | {"offsets": offsets}, duration=duration))


KNOWN = {
    "a bar on a cable": (lambda: lowered(HUNG, 0.6), on_a_spring, 1e-6),
    # 12 g at 100 N are as fast as 64 m/s.
    "a light bar": (lambda: lowered(HUNG | {"masses": {}}, 0.012, -0.5), on_a_spring, 3e-3),
    "a point mass": (lambda: lowered(HANGING, 0.3), between_two_cables, 1e-6),
    # The anchor gives way by m g / k, 0.7 um, and by some more as the bar speeds up.
    "a pendulum": (leaning, as_a_pendulum, 1e-5),
    "Atwood's machine": (joined.released, joined.as_atwood, 1e-6),
    "a bead on a string": (joined.plucked, joined.as_a_string, 1e-5),
    "a double pendulum": (joined.folded, joined.as_a_double_pendulum, 1e-4),
    "a hinge": (joined.ajar, joined.as_a_flap, 1e-5),
}


@pytest.mark.parametrize(("make", "expected", "atol"), KNOWN.values(), ids=KNOWN)
def test_what_hangs_swings_as_analysis_says(make, expected, atol, engine):
    robot = make()
    trajectory = trajectory_of(robot, engine)
    atol = max(2e-4, atol) if engine == "!Mujoco" else atol
    p_WN = expected(robot, trajectory.time.values)
    np.testing.assert_allclose(trajectory.p_WN, p_WN, atol=atol)
    assert np.ptp(p_WN, axis=0).max() > 0.015


@pytest.mark.parametrize(("engine", "atol"), [("!Compiled {}", 2e-4), ("!Drake {}", 1e-3)])
def test_by_default_two_bars_on_joints_swing_for_two_seconds_as_analysis_says(engine, atol):
    robot = joined.folded(2.0)
    trajectory = trajectory_of(robot, engine)
    expected = joined.as_a_double_pendulum(robot, trajectory.time.values)
    np.testing.assert_allclose(trajectory.p_WN, expected, atol=atol)


def bent_body_and_bar() -> Robot:
    """Two bodies, one of three different moments, and a cable that hangs loose between them."""
    fine = "!Compiled {tolerance: 1e-7 m/s, max_step: 1 ms}"
    v_WB = [[3.0, 7.0, -5.0, 0.1, 0.0, 0.2], [4.0, -9.0, 6.0, 0.0, -0.3, 0.1]]
    return thrown(Robot.of(scenario_of(TREES["bent"], 0.5, engine=fine)), np.array(v_WB))


def test_thrown_bodies_turn_as_drakes_rigid_bodies():
    robot = bent_body_and_bar()
    moments = np.linalg.eigvalsh(unit_inertias(robot.structure)[0])
    assert (np.diff(moments) > 0.1 * moments[0]).all(), "three different moments"
    poses = poses_of(simulated(robot)[1].states)[-1]
    np.testing.assert_allclose(poses, end_on_diagram(robot), atol=1e-6)


def flying(name: str, **changes: object) -> Robot:
    """A shipped structure without weight or ground, whose bodies move and turn at random."""
    scenario = load_scenario(name)
    still = {"robot.gravity": 0.0, "terrain": "!Nothing", "cpg.gain": 0.0}
    still |= {f"robot.cables.{group}.damping": 0.0 for group in scenario.robot.cables}
    fine = {"engine": "!Compiled", "engine.tolerance": "1e-7 m/s"}
    robot = Robot.of(shortly(scenario, 0.5, **still | fine | changes))
    v_WB = np.random.default_rng(0).normal(size=(scenario.robot.body_count, 6))
    return thrown(robot, v_WB * [2.0, 2.0, 2.0, 0.2, 0.2, 0.2])  # rad/s, m/s


def tumbling(dissipation: float) -> Robot:
    """Two bars that tumble towards each other and touch several times."""
    v_WB = [[3.0, 2.0, -1.0, 0.1, 0.0, 0.1], [-2.0, 4.0, 3.0, 0.0, 0.05, -0.1]]
    return thrown(loose_bars(ACROSS, dissipation=dissipation, duration=0.5), np.array(v_WB))


def nearly_parallel(angle: float) -> Robot:
    """Two bars at an angle, of which one falls on the other, half beyond its end."""
    x, y = 0.1 * np.cos(angle), 0.1 * np.sin(angle)
    ends = ((-0.1, 0.0, 0.0), (0.1, 0.0, 0.0)), ((0.1 - x, -y, 0.012), (0.1 + x, y, 0.012))
    robot = loose_bars(ends, dissipation=0.0, duration=0.2)
    return thrown(robot, np.array([[0.0] * 6, [0.0, 0.0, 0.0, 0.0, 0.0, -0.5]]))


DAMPED = {f"robot.cables.{group}.damping": "1 N*s/m" for group in ("bottom", "side", "top")}
FLYING: dict[str, tuple[Callable[[], Robot], float]] = {
    "six-bar": (lambda: flying("six_bar"), 1e-8),
    "prism whose cables are damped": (lambda: flying("prism", **DAMPED), np.inf),
    "bars that touch": (lambda: tumbling(0.0), 1e-4),
}
for angle in (0.0, 1e-4, 1e-3, 3e-3, 1e-2, 0.1):
    FLYING[f"bars at {angle} rad"] = functools.partial(nearly_parallel, angle), 1e-4


@pytest.mark.parametrize(("make", "rtol"), FLYING.values(), ids=FLYING)
def test_what_flies_keeps_its_momenta_and_without_dissipation_its_energy(make, rtol):
    robot = make()
    states = simulated(robot)[1].states
    found = np.array([energy_and_momenta(robot, state) for state in states])
    energy, momenta = found[:, 0], found[:, 1:]
    assert np.abs(poses_of(states)[-1] - poses_of(states)[0]).max() > 0.05, "it moves"
    largest = np.abs(momenta).max()
    np.testing.assert_allclose(momenta - momenta[0], 0.0, atol=1e-6 * largest)
    if rtol < np.inf:
        assert energy[-1] == pytest.approx(energy[0], rel=rtol)
    else:
        assert energy[-1] < 0.999 * energy[0]


@pytest.mark.parametrize("dissipation", [0.5, 3.0])
def test_two_bars_rebound_as_hunt_and_crossley_say(dissipation):
    # m v dv/dd = -k d (1 + c v) has the integral v / c - ln(1 + c v) / c² + k d² / (2 m): it is the
    # same at both ends of the impact, where d = 0.
    speed, c = 0.3, dissipation
    robot = loose_bars(ACROSS, dissipation=dissipation, duration=0.2)
    robot = thrown(robot, np.array([[0.0] * 6, [0.0, 0.0, 0.0, 0.0, 0.0, -speed]]))
    v_WB = simulated(robot)[1].states[-1, 14:].reshape(2, 6)
    np.testing.assert_allclose(v_WB[:, :5], 0.0, atol=1e-6)
    ends = np.array([speed, v_WB[0, 5] - v_WB[1, 5]])
    before, after = ends / c - np.log(1.0 + c * ends) / c**2
    assert after == pytest.approx(before, rel=2e-3) and ends[1] < -0.05
    assert v_WB[:, 5].sum() == pytest.approx(-speed, abs=1e-6), "momentum"


def with_drakes_contact(robot: Robot, dissipation: float, duration: float) -> np.ndarray:
    """Poses of bars after a duration (s) with Drake's own point contact of capsules."""
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, time_step=0.0)
    for body, (a, b) in zip(AddBodies(plant, robot.structure), robot.structure.struts, strict=True):
        start, end = robot.structure.p_BN[a], robot.structure.p_BN[b]
        pose = RigidTransform(RotationMatrix.MakeFromOneVector(end - start, 2), (start + end) / 2)
        properties = ProximityProperties()
        # Two equal springs in series.
        AddContactMaterial(dissipation, 2.0 * STIFFNESS, CoulombFriction(0.0, 0.0), properties)
        shape = Capsule(RADIUS, float(np.linalg.norm(end - start)))
        plant.RegisterCollisionGeometry(body, pose, shape, body.name(), properties)
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, 0.0])
    plant.Finalize()
    simulator = Simulator(builder.Build())
    ResetIntegratorFromFlags(simulator, "runge_kutta3", 1e-4).set_target_accuracy(1e-9)
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    plant.SetPositionsAndVelocities(context, robot.structure.initial_state)
    simulator.AdvanceTo(duration)
    return plant.GetPositions(context).reshape(-1, 7)


def test_bars_that_tumble_move_as_drakes_capsules():
    robot = tumbling(1.0)
    poses = poses_of(simulated(robot)[1].states)[-1]
    np.testing.assert_allclose(poses, with_drakes_contact(robot, 1.0, 0.5), atol=1e-4)
    np.testing.assert_allclose(poses, end_on_diagram(robot), atol=1e-5)


def test_a_bar_rests_across_two_others_where_the_contact_bears_its_weight(engine):
    given = {"dissipation": 1.0, "gravity": G, "anchors": CROSSED, "duration": 0.3}
    robot = loose_bars(CROSSING, **given)
    heights = moved_nodes(robot.structure, robot.structure.initial_state)[:, 5]
    depth = 2.0 * RADIUS - (heights[-1] - heights[0])
    assert 2.0 * STIFFNESS * depth == pytest.approx(robot.weight / 3.0, rel=1e-6)
    p_WB = trajectory_of(robot, engine).p_WB[-1]
    atol = 2e-5 if engine == "!Mujoco" else 1e-6
    np.testing.assert_allclose(p_WB, robot.structure.p_WB, atol=atol)


@pytest.mark.parametrize(("drop", "dissipation", "expected"), [(0.05, 0.5, 0.75), (0.8, 5.0, 0.05)])
def test_a_bar_that_is_dropped_on_two_others_rebounds(engine, drop, dissipation, expected):
    # Hunt and Crossley's restitution on rigid supports. At 4 m/s, the bar would be beyond the
    # others within a step.
    fall = float(np.sqrt(2.0 * drop / G))
    held = CROSSED | {"a0": "xyz", "b0": "yz", "a1": "xyz", "b1": "yz"}
    given = {"dissipation": dissipation, "gravity": G, "anchors": held}
    resting = loose_bars(CROSSING, **given, duration=round(fall + 0.05, 3))
    offsets = [["0 m", "0 m", f"{z} m"] for z in (0.0, 0.0, drop)]
    robot = Robot.of(resting.scenario.with_changes({"robot.offsets": offsets}))
    found = trajectory_of(robot, engine)
    rebound = float(found.v_WN.sel(node="a2", axis="z").max())
    assert rebound / (G * fall) == pytest.approx(expected, abs=0.05)
    assert found.p_WB[-1, -1, 2] > found.p_WB[-1, 0, 2] + RADIUS


def test_forces_do_not_depend_on_when_near_struts_were_searched():
    robot = tumbling(0.0)
    states = simulated(robot)[1].states

    def forces_at(state: np.ndarray, memory: Forces) -> np.ndarray:
        force = np.empty(12)
        compute_state_forces(Packed((robot.model, memory)), state, force)
        return force

    kept = Forces.of(robot.model)
    forces = np.array([forces_at(state, kept) for state in states])
    anew = np.array([forces_at(state, Forces.of(robot.model)) for state in states])
    assert 3 < np.count_nonzero(anew.any(axis=1)) < len(states)
    np.testing.assert_array_equal(forces, anew)


def test_the_spin_of_a_bar_about_its_axis_hardly_shortens_steps():
    # It exerts no torque. It turns with the axis, so it does add to the error of a long step.
    times = {"simulation.duration": "2 s", "simulation.steady_from": "1 s", "cpg.start_up": "0.5 s"}
    prism = load_scenario("prism").with_sections(robot=driven_as_recorded("prism"))
    robot = Robot.of(prism.with_changes(times))
    a, b = robot.structure.struts.T
    axes = robot.structure.p_BN[b] - robot.structure.p_BN[a]
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    (still, motion), (spinning, spun) = (
        simulated(thrown(robot, np.hstack([spin * axes, np.zeros((3, 3))])))
        for spin in (0.0, 10.0)  # rad/s
    )
    assert spinning.integrator.steps < 1.25 * still.integrator.steps
    poses, others = poses_of(motion.states), poses_of(spun.states)
    np.testing.assert_allclose(others[..., 4:], poses[..., 4:], atol=5e-4)
    assert np.ptp(poses[..., 4:], axis=0).max() > 5e-3, "it moves"


def test_a_stiff_anchor_takes_no_shorter_steps():
    def steps(stiffness: float) -> int:
        scenario = supported_prism(**{"robot.anchor_stiffness": f"{stiffness} N/m"})
        return simulate(scenario, seeded_gait(scenario, 3)).integrator.steps

    assert steps(1e9) < 2.0 * steps(1e5)


def test_an_offset_moves_a_body_only_along_its_free_axes():
    offsets = [["0.01 m", "0.02 m", "0.03 m"]] * 3
    structure = Robot.of(supported_prism()).structure
    moved = Robot.of(supported_prism(**{"robot.offsets": offsets})).structure
    by_bar = {"n0": [0.0, 0.0, 0.0], "n1": [0.01, 0.0, 0.0], "n2": [0.01, 0.02, 0.0]}
    for node, expected in by_bar.items():
        bar = structure.carriers[structure.node_names.index(node)]
        np.testing.assert_allclose(moved.p_WB[bar] - structure.p_WB[bar], expected, atol=1e-15)


def test_the_diagram_hardly_damps_what_has_no_dampers():
    robot = flying("six_bar", strut_contact="!Nothing")
    diagram = MakeTensegrityDiagram(robot, seeded_gait(robot.scenario))
    simulator, start = MakeSimulator(diagram, robot, Drake()), robot.structure.initial_state
    context = simulator.get_mutable_context()
    context.SetContinuousState(start)
    simulator.AdvanceTo(0.2)
    end, still = diagram.GetOutputPort("state").Eval(context), start.copy()
    still[7 * len(robot.structure.bodies) :] = 0.0
    energy, kept, least = (energy_and_momenta(robot, state)[0] for state in (start, end, still))
    assert kept == pytest.approx(energy, abs=2e-4 * (energy - least))


@pytest.mark.parametrize("engine", ["!Compiled {}", "!Drake {}"])
@pytest.mark.parametrize(
    ("frequency", "ratio", "size"), [(46.0, 1.4e-3, 1e-5), (5.0, 5e-4, 1e-6), (300.0, 0.02, 1e-7)]
)
def test_the_smallest_vibrations_keep_their_damping(frequency, ratio, size, engine):
    # A ball between six springs of 0.5 m, whose tension holds it sideways as well.
    mass, tension, rate = 0.05, 0.2, 2.0 * np.pi * frequency
    stiffness = 0.5 * (mass * rate**2 - 8.0 * tension)
    springs = {"stiffness": stiffness, "damping": ratio * mass * rate, "tension": tension}
    cables = {"springs": TREES["vibrating"]["cables"]["springs"] | springs}
    tree = TREES["vibrating"] | {"cables": cables, "offsets": [[size, 0.0, 0.0]]}
    scenario = scenario_of(tree, 10.0 / frequency, engine=engine)
    robot = Robot.of(scenario)
    end = simulate(scenario, seeded_gait(scenario), record=True).trajectory.isel(time=-1)
    x, v = float(end.p_WN.sel(node="ball", axis="x")), float(end.v_WN.sel(node="ball", axis="x"))
    # Of one spring: two act at once.
    assert robot.longest_step == pytest.approx(np.cbrt(ratio / np.sqrt(2.0)) / rate, rel=0.05)
    left = np.log(np.hypot(x, v / rate) / size) / (-rate * float(end.time))
    assert left == pytest.approx(ratio, rel=0.05)


def test_a_longest_step_that_is_given_is_kept_beside_light_damping():
    assert Compiled(max_step=3e-3).longest_step(light=1e-4) == 3e-3
    assert Compiled().longest_step(light=1e-4) == 1e-4


def test_robots_with_well_damped_cables_take_steps_of_any_length():
    for name in ("thesis", "prism", "six_bar", "mast", "winch", "rolling"):
        assert Robot.of(load_scenario(name)).longest_step == np.inf
