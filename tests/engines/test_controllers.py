"""Controllers: functions of time and readings in place of a gait, and systems on the diagram."""

import functools

import numpy as np
import pytest
from helpers.converged import shortly
from pydrake.systems.framework import BasicVector, Context, LeafSystem

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


@pytest.mark.parametrize(
    ("actions", "key", "facts"),
    [
        (np.ones(3), "actions", ("the shape (3,)", "(4,)")),
        ("fast", "actions", ("'fast'",)),
        ([1.0, 1.0, np.nan, 1.0], "actions[2]", ("nan",)),
    ],
)
def test_wrong_actions_of_a_controller_are_told_in_a_line(
    walking, engine, actions, key, facts, refused
):
    short = shortly(walking, 0.1, engine=engine)
    with refused("controller", key, *facts):
        simulate(short, controller=lambda time, _: actions if time > 0.05 else np.ones(4))


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


class Springs(LeafSystem):
    """A controller of ports of these names and sizes. It has no state, so its signals depend on
    its inputs at the same time: they are the sum of these for the driven cables."""

    def __init__(self, robot: Robot, inputs: dict[str, int], outputs: dict[str, int]) -> None:
        super().__init__()
        self._driven = robot.driven
        self._ports = [self.DeclareVectorInputPort(name, size) for name, size in inputs.items()]
        for name, size in outputs.items():
            self.DeclareVectorOutputPort(name, size, self._calc)

    def _calc(self, context: Context, output: BasicVector) -> None:
        sums = sum(port.Eval(context) for port in self._ports)[self._driven]
        output.SetFromVector(sums[: output.size()])


def test_a_controller_makes_no_algebraic_loop_and_may_have_further_outputs(walking, refused):
    robot = controlled_robot(walking)
    springs = Springs(robot, {"lengths": 12, "rates": 12}, {"errors": 2, "signals": 4})
    diagram = MakeTensegrityDiagram(robot, controller=springs)
    found = diagram.GetOutputPort("signals").Eval(diagram.CreateDefaultContext())
    np.testing.assert_allclose(found, robot.starting_cables().length, rtol=1e-12)


OTHER_PORTS = [
    ({}, {}, ("no output ports", "'signals'", "4")),
    ({}, {"y": 4}, ("found y", "'signals'", "4")),
    ({}, {"signals": 3}, ("'signals'", "size 3", "4")),
    ({"lengths": 11}, {"signals": 4}, ("'lengths'", "size 11", "12")),
    ({"state": 12}, {"signals": 4}, ("'state'", "size 12", "39")),
]


@pytest.mark.parametrize(("inputs", "outputs", "facts"), OTHER_PORTS)
def test_a_controller_of_other_ports_is_refused(walking, refused, inputs, outputs, facts):
    robot = controlled_robot(walking)
    with refused("MakeTensegrityDiagram", "controller", *facts):
        MakeTensegrityDiagram(robot, controller=Springs(robot, inputs, outputs))


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


def test_a_scene_graph_without_meshcat_has_struts_and_cables(walking):
    robot = Robot.of(walking)
    plain, diagram = MakeTensegrityDiagram(robot), MakeTensegrityDiagram(robot, scene_graph=True)
    assert not plain.HasSubsystemNamed("scene_graph")
    context = diagram.CreateDefaultContext()
    query = diagram.GetOutputPort("query_object").Eval(context)
    inspector = query.inspector()
    sources = [inspector.GetName(one) for one in inspector.GetAllSourceIds()]
    assert {"plant", "cables"} <= set(sources)
    names = [inspector.GetName(one) for one in inspector.GetAllFrameIds()]
    assert {f"{cable} 0" for cable in robot.structure.cable_names} <= set(names)


@pytest.mark.parametrize("key", ["robot", "gait", "controller", "scene_graph", "meshcat"])
def test_an_argument_of_another_type_is_refused(walking, refused, key):
    given = {"robot": Robot.of(walking)} | {key: "word"}
    with refused("MakeTensegrityDiagram", key, "'word'"):
        MakeTensegrityDiagram(**given)
