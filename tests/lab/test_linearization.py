"""Small motions about rest against analysis, statics and the engines; LQR."""

import copy
import math

import numpy as np
import pytest
from helpers.anchored import HUNG, LINE, TREES, floating_prism, scenario_of, supported_prism
from helpers.converged import CONVERGED
from pydrake.autodiffutils import ExtractGradient, InitializeAutoDiff
from pydrake.planning import DirectCollocation
from pydrake.systems.primitives import Linearize, LinearSystem
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from tetra_drake.errors import InputError
from tetra_drake.lab.linearization.linearization import linearize
from tetra_drake.lab.stepping.simulation import Simulation
from tetra_drake.laws.contact import MODE_COLUMNS
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.load import load_scenario
from tetra_drake.systems.diagram import MakeTensegrityDiagram


def test_a_weight_on_a_damped_cable_bounces_as_a_damped_oscillator():
    tree = HUNG | {"cables": {"line": LINE | {"damping": 4.0}}}
    linear = linearize(Robot.of(scenario_of(tree)))
    mass, modes = linear.robot.structure.mass.sum(), linear.modes()
    natural, ratio = math.sqrt(200.0 / mass), 4.0 / (2.0 * math.sqrt(200.0 * mass))
    bounces = np.abs(modes.shapes[:, 1, 2]).argmax()  # node a goes up and down
    damped = natural * math.sqrt(1.0 - ratio**2) / (2.0 * math.pi)
    assert modes.frequencies[bounces] == pytest.approx(damped, rel=1e-6)
    assert modes.damping_ratios[bounces] == pytest.approx(ratio, rel=1e-6)
    assert abs(modes.shapes[bounces, 1, 2].real) == pytest.approx(1.0), "in phase, the farthest"


# On the ground the loaded nodes stick, and touch it all the time.
PUSHED = {"on supports": (supported_prism(), 0.01), "on ground": (load_scenario("prism"), 2e-4)}


@pytest.mark.parametrize(("scenario", "speed"), PUSHED.values(), ids=PUSHED)
def test_a_small_push_moves_the_robot_as_the_linear_system(scenario, speed):
    # The displacements stay below a thousandth of the size.
    scenario = scenario.with_sections(engine=CONVERGED["compiled"])
    linear = linearize(scenario)
    robots = Simulation(scenario, control_period=0.005)
    rest = robots.step(robots.rest).rows(0)
    spin = np.array([3.0, -2.0, 1.0])
    moving = slice(0, robots.robot.structure.first_node[-1])
    pushed, body_of = rest.copied(), robots.robot.structure.carriers[moving]
    pushed.w_WB[0] += speed * spin
    centre = robots.robot.structure.p_WB[0]
    of_nodes = speed * (np.cross(spin, rest.p_WN[moving] - centre) + np.array([1.0, 0.5, 0.2]))
    pushed.v_WN[moving] += np.where(body_of[:, np.newaxis] == 0, of_nodes, 0.0)
    start = linear.deviation(pushed)
    robots.assume(pushed)
    farthest = 0.0
    for step in range(1, 31):
        found = robots.step(robots.rest).rows(0)
        x = expm(0.005 * step * linear.system.A()) @ start
        expected = linear.system.C() @ x
        seen = "p_WN", "lengths", "tensions"
        moved = [getattr(found, key) - getattr(rest, key) for key in seen]
        sizes = np.cumsum([each.size for each in moved])[:-1]
        for ours, theirs in zip(moved, np.split(expected, sizes), strict=True):
            assert ours.ravel() == pytest.approx(theirs, abs=0.02 * np.abs(theirs).max() + 1e-7)
        farthest = max(farthest, np.abs(moved[0]).max())
        assert linear.deviation(found) == pytest.approx(x, abs=0.03 * np.abs(x).max())
    assert 1e-6 < farthest < 2e-4


@pytest.mark.parametrize("actuation", ["!Force", "!Winch {max_force: 200 N, max_speed: 2 m/s}"])
def test_drake_finds_the_same_matrices_in_its_coordinates(actuation):
    # Small changes of Drake's states are T x, with N(q) for the displacements in T. So its
    # derivatives are those of T x' = T A x + T B u.
    linear = linearize(supported_prism(actuation=actuation))
    diagram = MakeTensegrityDiagram(linear.robot)
    context, plant = diagram.CreateDefaultContext(), diagram.GetSubsystemByName("plant")
    converted, (rates, inputs) = diagram.ToAutoDiffXd(), linear.system.B().shape
    given = converted.CreateDefaultContext()
    given.SetTimeStateAndParametersFrom(context)
    state = context.get_continuous_state_vector().CopyToVector()
    numbers = InitializeAutoDiff(np.concatenate([state, linear.signals])).ravel()
    given.SetContinuousState(numbers[: state.size])
    converted.get_input_port().FixValue(given, numbers[state.size :])
    theirs = ExtractGradient(converted.EvalTimeDerivatives(given).CopyToVector())
    own, count = plant.GetMyContextFromRoot(context), plant.num_velocities()
    to_drake = np.zeros((state.size, rates))
    for column, unit in enumerate(np.eye(count)):
        to_drake[: plant.num_positions(), column] = plant.MapVelocityToQDot(own, unit)
    to_drake[plant.num_positions() :, count:] = np.eye(rates - count)
    found = to_drake @ np.hstack([linear.system.A(), linear.system.B()])
    expected = np.hstack([theirs[:, : state.size] @ to_drake, theirs[:, state.size :]])
    scale = np.abs(found[:, :rates]).max(), np.abs(found[:, rates:]).max()
    assert found[:, :rates] == pytest.approx(expected[:, :rates], abs=1e-7 * scale[0])
    assert inputs == 3
    assert found[:, rates:] == pytest.approx(expected[:, rates:], abs=3e-6 * scale[1])


def test_drakes_own_tools_take_a_robot_whose_contacts_keep_their_modes():
    linear = linearize("prism")
    diagram = MakeTensegrityDiagram(linear.robot, modes=linear.robot.starting_modes)
    context, signals = diagram.CreateDefaultContext(), diagram.GetInputPort("signals")
    signals.FixValue(context, np.zeros(len(linear.inputs)))
    ports = signals.get_index(), diagram.GetOutputPort("lengths").get_index()
    roots = np.linalg.eigvals(Linearize(diagram, context, *ports, 1e-3).A())
    swings = np.sort(roots.imag[roots.imag > 1.0]) / math.tau
    np.testing.assert_allclose(swings, linear.modes().frequencies, rtol=1e-6)
    plan = DirectCollocation(diagram, context, 3, 0.01, 0.05, signals.get_index())
    assert len(plan.state(0)) == linear.state.size
    assert not diagram.CreateDefaultContext().num_discrete_state_groups()


def test_states_inputs_and_outputs_have_names_and_drake_takes_the_system():
    linear = linearize("prism", outputs=["normal_forces", "v_WN"])
    assert isinstance(linear.system, LinearSystem)
    first = [f"n0 n4 {name}" for name in ("theta_x", "theta_y", "theta_z", "x", "y", "z")]
    assert [*linear.states[:6]] == first
    assert linear.states[18] == "n0 n4 w_x" and linear.inputs[0] == "side n0 n3"
    assert {*linear.outputs[:6]} == {f"load n{i}" for i in range(6)}
    at = linear.outputs.index("n4 v_z"), linear.states.index("n0 n4 v_z")
    assert linear.system.C()[at] == pytest.approx(1.0)
    assert linear.system.get_output_port().size() == 6 + 18


def test_a_regulator_holds_a_mast_that_topples_without_it():
    scenario = scenario_of(TREES["mast"], 2.0)
    linear = linearize(scenario)
    cost = np.diag([float(name.endswith(("theta_x", "theta_y"))) for name in linear.states])
    gain = linear.lqr(cost, 1e-3 * np.eye(4))
    closed = np.linalg.eigvals(linear.system.A() - linear.system.B() @ gain)
    assert closed[np.abs(closed) > 0.3].real.max() < -1.0
    hold, top = linear.controller(gain), linear.robot.structure.node_names.index("top")
    push = np.array([2.0, 1.4, 0.0])  # rad/s

    def way(control: bool) -> np.ndarray:
        robots = Simulation(scenario, control_period=0.02)
        rest = robots.step(robots.rest).rows(0)
        moving = rest.p_WN[: robots.robot.structure.first_node[-1]]
        rest.w_WB[:], rest.v_WN[: len(moving)] = push, np.cross(push, moving)
        robots.assume(rest)
        tops = []
        while not robots.ended[0]:
            readings = robots.state.rows(0)
            tops.append(readings.p_WN[top].copy())
            robots.step(hold(0.0, readings) if control else robots.rest)
        return np.array(tops)

    held, fallen = way(True), way(False)
    assert np.abs(held[:, :2]).max() > 0.1 and held[-1, 2] > 0.99
    assert fallen[:, 2].min() < 0.0


def test_a_regulator_damps_a_floating_robot_and_lets_it_drift():
    linear = linearize(floating_prism())
    gain = linear.lqr(np.diag(np.repeat([1.0, 0.01], 18)), 1e-4 * np.eye(6))
    A, B = linear.system.A(), linear.system.B()
    alone, together = (np.linalg.eigvals(matrix) for matrix in (A, A - B @ gain))
    assert np.count_nonzero(np.abs(together) < 0.3) == 18, "twice 6 motions and 3 spins"
    slowest = [roots[np.abs(roots) > 0.3].real.max() for roots in (alone, together)]
    assert slowest[1] < 2.0 * slowest[0] < 0.0
    drift = np.tile(np.concatenate([np.zeros(3), [1.0, 0.0, 0.0]]), 3)
    assert gain @ np.concatenate([drift, 0.0 * drift]) == pytest.approx(np.zeros(6), abs=1e-4)


def test_a_regulator_damps_the_slow_swing_of_a_load_on_a_long_rope():
    # m x'' = -s x + f with the costs 1 of x and its rate, and r of f. Riccati's equation gives the
    # gains k = sqrt(s² + 1 / r) - s and c = sqrt(2 m k + 1 / r).
    long, mass, cost = 150.0, 500.0, 1e-4
    tree = copy.deepcopy(TREES["load"])
    tree["nodes"]["hook"], tree["masses"]["load"] = [0, 0, long], mass
    tree["cables"]["rope"]["tension"] = mass * 9.80665
    tree["cables"]["guy"]["tension"] = 1e-3  # hardly any, beside the weight
    linear = linearize(scenario_of(tree))

    gain = linear.lqr(np.eye(12), cost * np.eye(2))
    spring = mass * -linear.system.A()[9, 3]  # with the guys, which are soft
    assert spring == pytest.approx(mass * 9.80665 / long + 1.0, rel=0.01)
    k = math.sqrt(spring**2 + 1.0 / cost) - spring
    c = math.sqrt(2.0 * mass * k + 1.0 / cost)
    assert gain[0, [3, 9]] == pytest.approx([k, c], rel=0.01)
    swing = math.sqrt(spring / mass) / math.tau
    assert linear.modes().frequencies[:2] == pytest.approx([swing, swing], rel=0.01)
    # One guy cannot hold the swing across it.
    del tree["nodes"]["y"], tree["anchors"]["y"], tree["actuated"]["y"]
    tree["cables"]["guy"]["pairs"].pop()
    with pytest.raises(InputError, match="lqr"):
        linearize(scenario_of(tree)).lqr(np.eye(12), [[cost]])


def test_the_gain_of_a_mast_is_found_at_the_highest_cost():
    # With a high cost Q = q 1 the slowest motion has the rate -1 /s: x and x' cost the same.
    linear = linearize("mast")
    gain = linear.lqr(1e10 * np.eye(48), np.eye(12))
    roots = np.linalg.eigvals(linear.system.A() - linear.system.B() @ gain)
    assert roots.real.max() == pytest.approx(-1.0, abs=0.01)


def test_bristles_hold_the_nodes_that_stick_and_none_in_the_air():
    # Three nodes bear the prism, each with a bristle of 300 N/m. All bodies move along x.
    for modes, stiffness in ((None, 900.0), (np.zeros((6, MODE_COLUMNS)), 0.0)):
        linear = linearize("prism", Robot.of(load_scenario("prism")).equilibrium.state, modes=modes)
        along = [name.endswith(" x") for name in linear.states]
        pushed = [name.endswith(" v_x") for name in linear.states]
        acceleration = (linear.system.A() @ np.array(along, dtype=float))[pushed]
        force = linear.robot.structure.mass @ acceleration
        assert force == pytest.approx(-stiffness, rel=1e-6, abs=1e-4)


def test_the_turn_of_a_spinning_body_from_another_is_carried_along():
    # Both spin with w: exp(w t) exp(theta) = exp(exp(w t) theta) exp(w t).
    robot, w = Robot.of(floating_prism()), np.array([0.3, -0.8, 0.5])
    state = robot.structure.initial_state
    state[21:24] = w
    turning, turn = linearize(robot, state).system.A()[:3, :3], np.array([0.1, 0.2, 0.3])
    expected = Rotation.from_rotvec(2.0 * w).apply(turn)
    assert expm(2.0 * turning) @ turn == pytest.approx(expected, abs=1e-8)
