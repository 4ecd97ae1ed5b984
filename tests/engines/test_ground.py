"""The robot on ground that is not flat, and under both laws of friction."""

import numpy as np
import pytest
from helpers.anchored import scenario_of
from helpers.converged import CONVERGED, shortly
from helpers.hanging import HANGING, MASS
from helpers.hanging import STIFFNESS as CABLE_STIFFNESS
from helpers.laws import COULOMB, FIRM, RESET
from helpers.states import energy_and_momenta
from helpers.structures import poses_of, simulated
from pydrake.systems.analysis import Simulator
from scipy.integrate import solve_ivp
from xarray import DataArray

from tetra_drake.engines.drake import MakeSimulator
from tetra_drake.engines.simulate import simulate
from tetra_drake.laws.contact import GroundSection
from tetra_drake.laws.friction import ResetIntegrator
from tetra_drake.laws.terrain import Flat, Incline, Rough
from tetra_drake.robot.ground import ground_frames
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import node_positions
from tetra_drake.scenario.engine_kinds import Compiled, Drake
from tetra_drake.systems.diagram import MakeTensegrityDiagram

INCH, G = 0.0254, 9.80665


@pytest.mark.parametrize("friction", [RESET["reset"], FIRM])
def test_an_incline_is_flat_ground_under_a_rotated_gravity(scenario, friction):
    slope, gait = np.radians(8.0), seeded_gait(scenario, 2)
    short = shortly(scenario, 0.15, friction=friction, engine=CONVERGED["drake"])
    incline = {"terrain": Incline(slope=slope), "engine": CONVERGED["compiled"]}
    inclined = short.with_changes(incline)
    up_the_slope = simulate(inclined, gait, record=True).trajectory.p_WN.values[-1]

    robot = Robot.of(short)
    diagram = MakeTensegrityDiagram(robot, gait)
    g, s, c = short.robot.gravity, np.sin(slope), np.cos(slope)
    gravity = diagram.GetSubsystemByName("plant").mutable_gravity_field()
    gravity.set_gravity_vector([-g * s, 0.0, -g * c])
    simulator: Simulator = MakeSimulator(diagram, robot, CONVERGED["drake"])
    simulator.AdvanceTo(0.15)
    state = diagram.GetOutputPort("state").Eval(simulator.get_context())
    level = node_positions(Robot.of(short).structure, state)
    turned = level @ np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    np.testing.assert_allclose(up_the_slope, turned, atol=1e-6)


@pytest.mark.parametrize("friction", [RESET["reset"], COULOMB, FIRM])
def test_contact_never_gives_energy(scenario, friction):
    # Kinetic energy, weight, cables and the springs of contacts (k d^2 / 2); a bristle's spring
    # can only hold what it has taken.
    fall = {"robot__offsets": [[0.0, 0.0, "5 mm"]] * 5, "robot__contacts": "all", "cpg__gain": 0.0}
    fall["simulation__sample_period"] = "4 ms"
    rough = Rough(amplitude=0.25 * INCH, wavelength=4.0 * INCH, seed=5)
    falling = shortly(scenario, 0.4, terrain=rough, friction=friction, **fall)
    robot = Robot.of(falling.with_sections(engine=CONVERGED["compiled"]))
    states = simulated(robot, seed=2)[1].states
    energy = np.array([energy_and_momenta(robot, state)[0] for state in states])
    weights = robot.structure.mass * falling.robot.gravity
    energy += poses_of(states)[..., 6] @ weights
    p_WN = np.concatenate([node_positions(robot.structure, state) for state in states])
    gaps = ground_frames(p_WN, robot.ground)[:, 0].reshape(len(energy), -1)
    energy += 0.5 * falling.ground.stiffness * (np.minimum(gaps, 0.0) ** 2).sum(axis=1)
    lost = energy[0] - energy[-1]
    assert np.diff(energy).max() < 1e-4 * lost
    assert lost > 0.5 * weights.sum() * 0.005


PULLED = {
    "nodes": {"a": [0.0, 0.0, 0.002], "b": [0.2, 0.0, 0.002], "p": [0.1, 0.0, 0.0]},
    "contacts": ["p"],
}
"""HANGING, with its point mass on the ground. Its cables lift a third of its weight."""

FIRM_GROUND = {"stiffness": 4000.0, "damping": 1e5}

BRISTLE = {
    "stiction_range": 1e-4,
    "stiction_damping": 0.5,
    "stiction_switch": 0.7,
    "proportional_stiction": 2e4,
    "stiffness": 1000.0,
}
"""Constants of the reset integrator, in SI units."""


def pulled_over_the_ground(start: float, times: np.ndarray) -> np.ndarray:
    """Coordinate (m) over times (s) of a point mass that two cables pull to 0 against friction, by
    an integration of its deflection (m) that an event sets to 0 at the stiction range."""
    p0, *constants = BRISTLE.values()
    sigma_1, switch, sigma_0, k = constants

    def rates(_, y):
        x, v, bend = y
        friction = (k + sigma_0 * abs(v)) * (1.0 + switch) * bend + sigma_1 * v
        return [v, -(2.0 * CABLE_STIFFNESS * x + friction) / MASS, v]

    def breaks_free(_, y):
        return p0 - abs(y[2])

    breaks_free.terminal, breaks_free.direction = True, -1
    fine = {"rtol": 1e-10, "atol": 1e-13, "events": breaks_free, "dense_output": True}
    time, y, found = 0.0, [start, 0.0, 0.0], np.empty(len(times))
    while time < times[-1]:
        part = solve_ivp(rates, (time, times[-1]), y, **fine)
        later = times >= time
        found[later] = part.sol(times[later])[0]
        time, y = part.t[-1], [*part.y[:2, -1], 0.0]
    return found


def pulled(friction: ResetIntegrator, starts: np.ndarray, engine: Compiled | Drake) -> DataArray:
    """Coordinates p_WN (m) of that point mass over time on an engine, from two starts (m), along x
    and y at once."""
    weight, ground = MASS * G - 2.0 * CABLE_STIFFNESS * 0.002, GroundSection(**FIRM_GROUND)
    low = -weight / (ground.stiffness + 2.0 * CABLE_STIFFNESS)
    tree = HANGING | PULLED | {"offsets": [[0.0] * 3, [*starts, low]]}
    changes = {"terrain": Flat(), "friction": friction, "ground": ground, "engine": engine}
    scenario = scenario_of(tree, duration=0.12, **changes)
    found = simulate(scenario, seeded_gait(scenario), record=True).trajectory
    return found.p_WN.sel(node="p")


@pytest.mark.parametrize(("engine", "atol"), [(CONVERGED["compiled"], 1e-7), (Drake(), 2e-5)])
def test_a_mass_on_cables_breaks_free_as_an_integrator_with_resets_says(engine, atol):
    friction, starts = ResetIntegrator(reset="range", **BRISTLE), np.array([0.008, -0.005])
    p_WN = pulled(friction, starts, engine)
    for axis, start, middle in zip("xy", starts, (0.1, 0.0), strict=True):
        expected = pulled_over_the_ground(start, p_WN.time.values)
        assert np.ptp(expected) > 20.0 * friction.stiction_range
        np.testing.assert_allclose(p_WN.sel(axis=axis) - middle, expected, atol=atol)


@pytest.mark.parametrize("kind", ["compiled", "drake"])
def test_errors_are_of_order_2_but_for_resets_within_steps_which_are_of_order_1(kind):
    """A reset is a jump of the force. Within a step it costs an error of the velocity that is
    proportional to the step."""
    weak, starts = {"proportional_stiction": 100.0, "stiffness": 0.0}, np.array([0.008, -0.005])

    def with_step(step: float) -> Compiled | Drake:
        if kind == "compiled":
            return Compiled(tolerance=1e6, max_step=step)
        return Drake(scheme="radau3", accuracy=1e3, max_step=step, look_ahead=step)

    def errors(stiction_range: float) -> list[float]:
        """Errors (m) with steps of 1.6 and 0.1 ms."""
        changes = weak | {"stiction_range": stiction_range}
        friction = ResetIntegrator(reset="range", **BRISTLE | changes)
        exact = pulled(friction, starts, Compiled(tolerance=1e6, max_step=1e-5))
        walks = [pulled(friction, starts, with_step(step)) for step in (1.6e-3, 1e-4)]
        return [float(np.abs(walk - exact).sel(axis="y").max()) for walk in walks]

    coarse, fine = errors(0.05)  # as far as the mass never goes
    assert coarse < 1e-6 and coarse / fine > 150.0, "256 at order 2"
    coarse, fine = errors(1e-4)
    assert coarse < 5e-6 and 4.0 < coarse / fine < 64.0, "16 at order 1"
