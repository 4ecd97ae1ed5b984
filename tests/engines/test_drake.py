"""The Drake diagram: against the independent simulation, and with live signals."""

from unittest.mock import Mock

import numpy as np
import pytest
from helpers.converged import shortly
from pydrake.systems.framework import Context

from tetra_drake.engines.drake import MakeSimulator, default_scheme
from tetra_drake.engines.sampler import Sampler
from tetra_drake.engines.simulate import simulate
from tetra_drake.laws.terrain import Rough
from tetra_drake.results.trajectory import make_dataset
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.engine_kinds import Drake
from tetra_drake.scenario.load import load_scenario
from tetra_drake.systems.diagram import MakeTensegrityDiagram

PORTS = {"signal": "signals", "tension": "tensions", "length": "lengths"}
PORTS |= {"normal_force": "normal_forces", "friction_force": "friction_forces"}
"""Output ports of the diagram, by the variables of a trajectory."""


def test_the_work_counts_all_steps_from_the_start(scenario):
    # New Jacobians after mode changes clear the integrator's own counts.
    short = shortly(scenario, 1.0)
    viewer = Mock(wants=Mock(return_value=False))
    work = simulate(short, seeded_gait(short), viewer=viewer).integrator
    ends = {call.args for call in viewer.wants.call_args_list}
    assert work.steps == len(ends)  # AdvanceTo(0) counts as a step, of no length
    assert work.derivative_evaluations > work.jacobian_evaluations > 0
    assert work.derivative_evaluations > 3 * work.steps
    viewer.show.assert_not_called()


def test_where_friction_is_viscous_steps_after_mode_changes_are_explicit():
    times = {"cpg.start_up": "0.1 s", "simulation.duration": "2 s", "simulation.steady_from": "1 s"}
    short, walks = load_scenario("thesis").with_changes(times), []
    for engine in (Drake(), Drake(scheme="radau3")):
        chosen = short.with_changes({"engine": engine})
        walks.append(simulate(chosen, seeded_gait(chosen, 3)))
    ours, implicit = (walk.integrator for walk in walks)
    assert ours.steps > 1.5 * implicit.steps  # seen: 2.1
    assert ours.derivative_evaluations < 0.85 * implicit.derivative_evaluations  # seen: 0.75
    assert walks[0].metrics.distance_in == pytest.approx(walks[1].metrics.distance_in, abs=0.015)


@pytest.mark.parametrize("changes", [{}, {"terrain": Rough(amplitude=2e-3, wavelength=0.1)}])
def test_recorded_lengths_and_forces_are_those_at_the_ports_of_the_diagram(scenario, changes):
    changes = {"robot.tetrahedra": 3, "cpg.start_up": "0 s"} | changes
    robot = Robot.of(scenario.with_changes(changes))
    diagram = MakeTensegrityDiagram(robot, seeded_gait(robot.scenario))
    engine, there = Drake(max_step=8e-3), []
    simulator = MakeSimulator(diagram, robot, engine)
    sampler = Sampler(diagram, np.array([0.05, 0.1]), max_step=engine.max_step)

    def after_step(context: Context) -> None:
        sampler.after_step(context)
        there.append({port: diagram.GetOutputPort(port).Eval(context) for port in PORTS.values()})

    simulator.set_monitor(after_step)
    for end in (0.05, 0.1):  # where a step ends, and with it those modes
        simulator.AdvanceTo(end)
        walk = make_dataset(robot, sampler.motion()).isel(time=-1)
        for name, port in PORTS.items():
            np.testing.assert_array_equal(walk[name].values.ravel(), there[-1][port])
    assert np.abs(there[-1]["friction_forces"]).max() > 0.0
    assert there[-1]["signals"].any()


SCHEMES = [(5, 0.05, "radau3"), (24, 0.05, "radau3"), (48, 0.05, "runge_kutta3")]
SCHEMES += [(48, 0.5, "radau3"), (13, 0.0, "runge_kutta3")]


@pytest.mark.parametrize(("tetrahedra", "damping", "scheme"), SCHEMES)
def test_large_robots_are_integrated_explicitly_unless_dampers_are_fast(
    scenario, tetrahedra, damping, scheme
):
    changes = {"robot.tetrahedra": tetrahedra, "robot.cables.damping": f"{damping} lbf*s/in"}
    robot = Robot.of(scenario.with_changes(changes))
    assert default_scheme(robot) == scheme
