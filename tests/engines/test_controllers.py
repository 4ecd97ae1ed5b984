"""Controllers: functions of time and readings in place of a gait, and systems on the diagram."""

import numpy as np
import pytest
from helpers.controllers import Springs, follow_waves
from helpers.converged import shortly
from pydrake.systems.analysis import Simulator

from tetra_drake.engines.drake import MakeSimulator
from tetra_drake.engines.simulate import simulate
from tetra_drake.errors import InputError
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.command import Controller, controlled_robot
from tetra_drake.robot.readings import Readings
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


def moved_as_simulate_does(
    walking: Scenario, simulator: Simulator, law: Controller
) -> SimulationResult:
    """The result of simulate() with a law for a tenth of a second, which ends where the simulator
    of a diagram does."""
    result = simulate(shortly(walking, 0.1, engine=EXPLICIT), controller=law, record=True)
    end, diagram = result.trajectory.isel(time=-1), simulator.get_system()
    simulator.AdvanceTo(0.1)
    state, signals = (
        diagram.GetOutputPort(name).Eval(simulator.get_context()) for name in ("state", "signals")
    )
    np.testing.assert_allclose(state[:21].reshape(3, 7)[:, 4:], end.p_WB, atol=1e-7)
    np.testing.assert_allclose(signals, end.signal, atol=1e-4)
    return result


def test_the_controller_of_a_diagram_is_that_of_simulate(walking):
    """The function is called at the same times, and its forces are held."""
    robot, times = controlled_robot(walking), list[float]()

    def law(time: float, readings: Readings) -> np.ndarray:
        times.append(time)
        return follow_waves(robot, time, readings)

    system = SampledController(robot, law, period=0.02)
    diagram = MakeTensegrityDiagram(robot, controller=system)
    result = moved_as_simulate_does(walking, MakeSimulator(diagram, robot, EXPLICIT), law)
    np.testing.assert_allclose(times, np.tile(0.02 * np.arange(5), 2), atol=1e-12)
    assert result.gait is None and "<iframe" in result.show()._repr_html_()


def test_signals_from_outside_drive_as_those_of_a_controller(walking):
    robot, held = controlled_robot(walking), np.linspace(0.5, 4.0, 4)
    diagram = MakeTensegrityDiagram(robot)
    simulator = MakeSimulator(diagram, robot, EXPLICIT)
    diagram.GetInputPort("signals").FixValue(simulator.get_mutable_context(), held)
    moved_as_simulate_does(walking, simulator, lambda time, readings: held)


def test_a_controller_may_have_further_ports_and_makes_no_algebraic_loop(walking):
    robot = controlled_robot(walking)
    ports = {"lengths": 12, "rates": 12, "wanted": 12}, {"errors": 2, "signals": 4}
    diagram = MakeTensegrityDiagram(robot, controller=Springs(robot, *ports))
    assert diagram.num_input_ports() == 1
    context, structure = diagram.CreateDefaultContext(), robot.structure
    diagram.GetInputPort("wanted").FixValue(context, -0.25 * structure.initial_lengths)
    found = diagram.GetOutputPort("signals").Eval(context)
    np.testing.assert_allclose(found, 0.75 * robot.starting_cables().length, rtol=1e-12)
