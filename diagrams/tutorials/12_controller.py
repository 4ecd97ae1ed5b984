"""A controller of one's own on the diagram: Drake's PID pulls the cables to wanted lengths."""

# %% The robot, with one signal for each driven cable. A wave of lengths runs along it.
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from pydrake.systems.controllers import PidController
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import MatrixGain, Multiplexer, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

import tetra_drake as td
from tetra_drake.engines.drake import MakeSimulator
from tetra_drake.robot.command import controlled_robot
from tetra_drake.scenario.engine_kinds import Drake
from tetra_drake.systems.diagram import MakeTensegrityDiagram

robot, times = controlled_robot(td.load_scenario("coulomb")), np.linspace(0.0, 4.0, 201)
ones, phases = np.ones(robot.driven.size), np.arange(robot.driven.size)[:, np.newaxis]
wave = np.minimum(times, 1.0) * np.sin(2.0 * np.pi * 0.7 * times - phases)
wanted = robot.starting_cables().length[:, np.newaxis] * (1.0 + 0.1 * wave)

# %% A controller has ports of the same names as the cables and the ground: here lengths and rates.
builder, motion = DiagramBuilder(), PiecewisePolynomial.FirstOrderHold(times, wanted)
pid = builder.AddSystem(PidController(-600.0 * ones, -6000.0 * ones, -2.0 * ones))
source = builder.AddSystem(TrajectorySource(motion, output_derivative_order=1))
builder.Connect(source.get_output_port(), pid.get_input_port_desired_state())
measured = builder.AddSystem(Multiplexer([ones.size, ones.size]))
builder.Connect(measured.get_output_port(), pid.get_input_port_estimated_state())
for i, name in enumerate(("lengths", "rates")):
    driven = builder.AddSystem(MatrixGain(np.eye(len(robot.structure.cables))[robot.driven]))
    builder.Connect(driven.get_output_port(), measured.get_input_port(i))
    builder.ExportInput(driven.get_input_port(), name)
builder.ExportOutput(pid.get_output_port_control(), "signals")

# %% Four seconds, and the length of the first driven cable.
diagram = MakeTensegrityDiagram(robot, None, controller=builder.Build())
simulator, found = MakeSimulator(diagram, Drake()), []
for time in times:
    simulator.AdvanceTo(time)
    found.append(diagram.GetOutputPort("lengths").Eval(simulator.get_context())[robot.driven])
print(f"largest error: {1e3 * np.abs(np.array(found).T - wanted).max():.2f} mm")
figure = Figure(figsize=(7.0, 3.0), layout="constrained")
axes = figure.subplots()
axes.plot(times, 1e3 * np.array(found)[:, 0], label="length")
axes.plot(times, 1e3 * wanted[0], "--", label="wanted")
axes.set(xlabel="time (s)", ylabel="length of a cable (mm)")
axes.legend()
figure.savefig(f"{Path(__file__).stem}.png", dpi=120)
