"""Controllers: functions of time and readings in place of a gait, and systems on the diagram."""

import functools

import numpy as np
import pytest
from helpers.controllers import Springs
from helpers.converged import shortly

from tetra_drake.engines.drake import MakeSimulator
from tetra_drake.engines.simulate import simulate
from tetra_drake.errors import InputError
from tetra_drake.robot.command import controlled_robot
from tetra_drake.robot.readings import Readings
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.engine_kinds import Drake
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.settings.units import INCH
from tetra_drake.systems import SampledController
from tetra_drake.systems.diagram import MakeTensegrityDiagram

EXPLICIT = Drake(scheme="runge_kutta3", accuracy=1e-6)


@pytest.fixture
def walking() -> Scenario:
    """Six tenths of a second of three tetrahedra under a law of friction that all engines have."""
    settings = {"friction.stiffness": "0 N/m", "simulation.sample_period": "30 ms"}
    settings["robot.tetrahedra"] = 3
    return shortly(load_scenario("coulomb"), 0.6, **settings)


def follow_waves(robot: Robot, time: float, readings: Readings) -> np.ndarray:
    """Forces that pull the driven cables to lengths that change in a wave."""
    cables, phases = robot.driven, np.arange(robot.driven.size)
    wanted = robot.starting_cables().length * (
        1.0 + 0.2 * np.sin(2.0 * np.pi * 0.7 * time + phases)
    )
    return 40.0 * (readings.lengths[cables] - wanted) + 0.2 * readings.rates[cables]


@pytest.fixture
def controller(walking):
    return functools.partial(follow_waves, controlled_robot(walking))


@pytest.mark.parametrize("engine", ["!Drake", "!Mujoco"])
def test_a_controller_walks_alike_on_all_engines(walking, controller, engine):
    expected, found = (
        simulate(walking.with_changes({"engine": each}), controller=controller, record=True)
        for each in ("!Compiled", engine)
    )
    moved = found.trajectory.p_WN - expected.trajectory.p_WN
    assert abs(moved).max() < 0.01 * INCH
    between = slice(1, None, 2)  # samples in the middle of control periods
    ours, theirs = (each.trajectory.signal.to_numpy()[between] for each in (found, expected))
    assert np.ptp(theirs, axis=0).min() > 0.3, "it acts on every cable"
    np.testing.assert_allclose(ours, theirs, atol=0.01)
    assert found.gait is None and found.engine == engine[1:].lower()
    assert "<iframe" in found.show()._repr_html_()


@pytest.mark.parametrize("kind", [RuntimeError, InputError, KeyboardInterrupt])
def test_what_a_controller_raises_comes_through_as_it_is(walking, engine, kind):
    """And is no failure of the simulation, which a RuntimeError of Drake's is."""
    error = kind("f", "x", "mine") if kind is InputError else kind("mine")

    def fails(time: float, readings: Readings) -> np.ndarray:
        if time > 0.05:
            raise error
        return np.ones(4)

    with pytest.raises(kind) as caught:
        simulate(shortly(walking, 0.1, engine=engine), controller=fails)
    assert caught.value is error


def test_the_controller_of_a_diagram_is_that_of_simulate(walking, controller):
    """The function is called at the same times, and its forces are held."""
    accurate = Drake(accuracy=1e-5, max_step=1e-3)
    scenario = shortly(walking, 0.1, engine=accurate)
    times: list[float] = []

    def law(time: float, readings: Readings) -> np.ndarray:
        times.append(time)
        return controller(time, readings)

    robot = controlled_robot(scenario)
    system = SampledController(robot, law, period=0.02)
    diagram = MakeTensegrityDiagram(robot, controller=system)
    simulator = MakeSimulator(diagram, robot, accurate)
    simulator.AdvanceTo(0.1)
    state = diagram.GetOutputPort("state").Eval(simulator.get_context())
    result = simulate(scenario, controller=controller, record=True)
    p_WB = result.trajectory.p_WB[-1].to_numpy()
    np.testing.assert_allclose(state[:21].reshape(3, 7)[:, 4:], p_WB, atol=1e-7)
    np.testing.assert_allclose(times, 0.02 * np.arange(5), atol=1e-12)
    signals = diagram.GetOutputPort("signals").Eval(simulator.get_context())
    np.testing.assert_allclose(signals, result.trajectory.signal[-1], atol=1e-4)


def test_a_controller_makes_no_algebraic_loop_and_may_have_further_outputs(walking, refused):
    robot = controlled_robot(walking)
    springs = Springs(robot, {"lengths": 12, "rates": 12}, {"errors": 2, "signals": 4})
    diagram = MakeTensegrityDiagram(robot, controller=springs)
    found = diagram.GetOutputPort("signals").Eval(diagram.CreateDefaultContext())
    np.testing.assert_allclose(found, robot.starting_cables().length, rtol=1e-12)


def test_free_input_ports_of_a_controller_are_ports_of_the_diagram(walking):
    robot = controlled_robot(walking)
    controller = Springs(robot, {"lengths": 12, "wanted": 12}, {"signals": 4})
    diagram = MakeTensegrityDiagram(robot, controller=controller)
    context = diagram.CreateDefaultContext()
    assert [diagram.get_input_port(i).get_name() for i in range(diagram.num_input_ports())] == [
        "wanted"
    ]
    diagram.GetInputPort("wanted").FixValue(context, -robot.structure.initial_lengths)
    found = diagram.GetOutputPort("signals").Eval(context)
    np.testing.assert_allclose(found, np.zeros(4), atol=1e-15)


def test_signals_from_outside_drive_as_those_of_a_controller(walking):
    robot, held = controlled_robot(walking), np.linspace(0.5, 4.0, 4)
    diagram = MakeTensegrityDiagram(robot)
    simulator = MakeSimulator(diagram, robot, EXPLICIT)
    diagram.GetInputPort("signals").FixValue(simulator.get_mutable_context(), held)
    simulator.AdvanceTo(0.08)
    context = simulator.get_context()
    np.testing.assert_array_equal(diagram.GetOutputPort("signals").Eval(context), held)
    result = simulate(
        shortly(walking, 0.08, engine=EXPLICIT),
        controller=lambda time, readings: held,
        record=True,
    )
    state = diagram.GetOutputPort("state").Eval(context)
    p_WB = result.trajectory.p_WB[-1].to_numpy()
    np.testing.assert_allclose(state[:21].reshape(3, 7)[:, 4:], p_WB, atol=1e-7)


def test_a_robot_without_signals_needs_none():
    robot = Robot.of(load_scenario("prism").with_changes({"robot.actuated": {}}))
    diagram = MakeTensegrityDiagram(robot)
    assert diagram.num_input_ports() == 0
    assert diagram.GetOutputPort("signals").size() == 0
