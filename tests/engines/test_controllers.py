"""Controllers: functions of time and readings in place of a gait, and systems on the diagram."""

import functools

import numpy as np
import pytest
from helpers.controllers import Springs, follow_waves
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
from tetra_drake.systems import SampledController
from tetra_drake.systems.diagram import MakeTensegrityDiagram

EXPLICIT = Drake(scheme="runge_kutta3", accuracy=1e-6)


@pytest.fixture
def walking() -> Scenario:
    """Six tenths of a second of three tetrahedra under a law of friction that all engines have."""
    settings = {"friction.stiffness": "0 N/m", "simulation.sample_period": "30 ms"}
    settings["robot.tetrahedra"] = 3
    return shortly(load_scenario("coulomb"), 0.6, **settings)


@pytest.fixture
def controller(walking):
    return functools.partial(follow_waves, controlled_robot(walking))


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


def bodies_at(time: float, robot: Robot, engine: Drake, held: np.ndarray | None = None, **options):
    """Positions of the bodies, and the signals, after a time on the diagram; `held` signals come
    from outside."""
    diagram = MakeTensegrityDiagram(robot, **options)
    simulator = MakeSimulator(diagram, robot, engine)
    context = simulator.get_mutable_context()
    if held is not None:
        diagram.GetInputPort("signals").FixValue(context, held)
    simulator.AdvanceTo(time)
    state, signals = (diagram.GetOutputPort(name).Eval(context) for name in ("state", "signals"))
    return state[:21].reshape(3, 7)[:, 4:], signals


def test_the_controller_of_a_diagram_is_that_of_simulate(walking, controller):
    """The function is called at the same times, and its forces are held."""
    accurate, times = Drake(accuracy=1e-5, max_step=1e-3), list[float]()

    def law(time: float, readings: Readings) -> np.ndarray:
        times.append(time)
        return controller(time, readings)

    robot = controlled_robot(walking)
    system = SampledController(robot, law, period=0.02)
    p_WB, signals = bodies_at(0.1, robot, accurate, controller=system)
    np.testing.assert_allclose(times, 0.02 * np.arange(5), atol=1e-12)
    short = shortly(walking, 0.1, engine=accurate)
    result = simulate(short, controller=controller, record=True)
    np.testing.assert_allclose(p_WB, result.trajectory.p_WB[-1], atol=1e-7)
    np.testing.assert_allclose(signals, result.trajectory.signal[-1], atol=1e-4)
    assert result.gait is None and "<iframe" in result.show()._repr_html_()


def test_a_controller_may_have_further_ports_and_makes_no_algebraic_loop(walking):
    robot = controlled_robot(walking)
    ports = {"lengths": 12, "rates": 12, "wanted": 12}, {"errors": 2, "signals": 4}
    diagram = MakeTensegrityDiagram(robot, controller=Springs(robot, *ports))
    assert diagram.num_input_ports() == 1
    context, structure = diagram.CreateDefaultContext(), robot.structure
    diagram.GetInputPort("wanted").FixValue(context, -0.25 * structure.initial_lengths)
    found = diagram.GetOutputPort("signals").Eval(context)
    np.testing.assert_allclose(found, 0.75 * robot.starting_cables().length, rtol=1e-12)


def test_signals_from_outside_drive_as_those_of_a_controller(walking):
    held = np.linspace(0.5, 4.0, 4)
    p_WB, signals = bodies_at(0.08, controlled_robot(walking), EXPLICIT, held)
    np.testing.assert_array_equal(signals, held)
    short = shortly(walking, 0.08, engine=EXPLICIT)
    result = simulate(short, controller=lambda time, readings: held, record=True)
    np.testing.assert_allclose(p_WB, result.trajectory.p_WB[-1], atol=1e-7)


def test_a_robot_without_signals_needs_none():
    robot = Robot.of(load_scenario("prism").with_changes({"robot.actuated": {}}))
    diagram = MakeTensegrityDiagram(robot)
    assert diagram.num_input_ports() == 0
    assert diagram.GetOutputPort("signals").size() == 0
