"""A controller of one's own on the diagram: Drake's PID pulls the cables to wanted lengths."""

# %% The robot, with one signal for each driven cable. A wave of lengths runs along it.
import sys
from pathlib import Path

import numpy as np
import pydrake.all as drake
from matplotlib.figure import Figure

import tetra_drake as td
from tetra_drake.engines.drake import MakeSimulator
from tetra_drake.engines.sampler import frame_of
from tetra_drake.robot.command import controlled_robot
from tetra_drake.scenario.engine_kinds import Drake
from tetra_drake.systems.diagram import MakeTensegrityDiagram
from tetra_drake.visualization.live import open_view

robot, times = controlled_robot(td.load_scenario("coulomb")), np.linspace(0.0, 4.0, 201)
ones, phases = np.ones(robot.driven.size), np.arange(robot.driven.size)[:, np.newaxis]
wave = np.minimum(times, 1.0) * np.sin(2.0 * np.pi * 0.7 * times - phases)
wanted = robot.starting_cables().length[:, np.newaxis] * (1.0 + 0.1 * wave)

# %% A controller has ports of the same names as the cables and the ground: here lengths and rates.
builder, motion = drake.DiagramBuilder(), drake.PiecewisePolynomial.FirstOrderHold(times, wanted)
pid = builder.AddSystem(drake.PidController(-600.0 * ones, -6000.0 * ones, -2.0 * ones))
source = builder.AddSystem(drake.TrajectorySource(motion, output_derivative_order=1))
builder.Connect(source.get_output_port(), pid.get_input_port_desired_state())
measured = builder.AddSystem(drake.Multiplexer([ones.size, ones.size]))
builder.Connect(measured.get_output_port(), pid.get_input_port_estimated_state())
for i, name in enumerate(("lengths", "rates")):
    driven = builder.AddSystem(drake.MatrixGain(np.eye(len(robot.structure.cables))[robot.driven]))
    builder.Connect(driven.get_output_port(), measured.get_input_port(i))
    builder.ExportInput(driven.get_input_port(), name)
builder.ExportOutput(pid.get_output_port_control(), "signals")

# %% Four seconds. With the option --watch, a browser shows the robot in Meshcat as it moves.
diagram = MakeTensegrityDiagram(robot, controller=builder.Build())
simulator, found = MakeSimulator(diagram, robot, Drake()), []
view = open_view(robot.scenario, say=print) if "--watch" in sys.argv else None
for time in times:
    simulator.AdvanceTo(time)
    context = simulator.get_context()
    found.append(diagram.GetOutputPort("lengths").Eval(context)[robot.driven])
    if view is not None:
        view.show(frame_of(robot, diagram, context))
print(f"largest error: {1e3 * np.abs(np.array(found).T - wanted).max():.2f} mm")
figure = Figure(figsize=(7.0, 3.0), layout="constrained")
axes = figure.subplots()
axes.plot(times, 1e3 * np.transpose([np.array(found)[:, 0], wanted[0]]), label=["is", "wanted"])
axes.set(xlabel="time (s)", ylabel="length of a cable (mm)")
axes.legend()
figure.savefig(f"{Path(__file__).stem}.png", dpi=120)
