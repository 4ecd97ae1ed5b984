"""Drake's tools on a plant with cables: two cables swing an acrobot up and hold it."""

# %% Drake's acrobot. Two cables, 20 N/m, pull its elbow; its own motor is off.
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.planning import DirectCollocation
from pydrake.solvers import SnoptSolver, SolverOptions
from pydrake.systems.analysis import Simulator
from pydrake.systems.controllers import (
    FiniteHorizonLinearQuadraticRegulatorOptions,
    LinearQuadraticRegulator,
    MakeFiniteHorizonLinearQuadraticRegulator,
)
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import Linearize, LogVectorOutput
from pydrake.trajectories import PiecewisePolynomial

from tetra_drake.laws.cable import CableLaw
from tetra_drake.systems import AddCables, AddFrame, Cable

builder = DiagramBuilder()
plant = builder.AddSystem(MultibodyPlant(time_step=0.0))
Parser(plant).AddModelsFromUrl("package://drake/examples/acrobot/Acrobot.urdf")
elbow = AddFrame(plant, "elbow", plant.GetFrameByName("upper_link"), [0.0, 0.15, -1.0])
ends = [AddFrame(plant, f"x={x}", plant.world_frame(), [x, 0.15, 0.0]) for x in (-2.0, 2.0)]
plant.Finalize()
law = CableLaw(stiffness=20.0, damping=1.0, free_length=0.5)
cables = [Cable(end.name(), end, elbow, law) for end in ends]
tendons = AddCables(
    builder, plant, cables=cables, actuated={one.name: [one.name] for one in cables}
)
builder.ExportInput(tendons.GetInputPort("signals"), "signals")
builder.ExportOutput(plant.get_state_output_port(), "state")
acrobot = builder.Build()

# %% A linear model at the upright position, and a regulator of it.
context, upright = acrobot.CreateDefaultContext(), np.array([np.pi, 0.0, 0.0, 0.0])
context.SetContinuousState(upright)
acrobot.get_input_port().FixValue(context, np.zeros(2))
linear = Linearize(acrobot, context)
Q, R = np.diag([10.0, 10.0, 1.0, 1.0]), 0.01 * np.eye(2)
gain, cost_to_go = LinearQuadraticRegulator(linear.A(), linear.B(), Q, R)
held = linear.A() - linear.B() @ gain
for name, matrix in {"free": linear.A(), "held": held}.items():
    print(f"{name}: eigenvalues {np.linalg.eigvals(matrix).round(2)} 1/s")

# %% A trajectory from hanging to upright. Signals above -10 N keep the cables stretched.
collocation = DirectCollocation(
    acrobot, context, num_time_samples=16, minimum_time_step=0.1, maximum_time_step=0.3
)
collocation.AddEqualTimeIntervalsConstraints()
program, signals = collocation.prog(), collocation.input()
for signal in signals:
    collocation.AddConstraintToAllKnotPoints(signal >= -10.0)
    collocation.AddConstraintToAllKnotPoints(signal <= 60.0)
for state, place in (
    (collocation.initial_state(), 0.0 * upright),
    (collocation.final_state(), upright),
):
    program.AddBoundingBoxConstraint(place, place, state)
collocation.AddRunningCost(0.01 * signals @ signals)
line = PiecewisePolynomial.FirstOrderHold([0.0, 3.0], np.column_stack([0.0 * upright, upright]))
collocation.SetInitialTrajectory(PiecewisePolynomial(), line)
settings = SolverOptions()  # the regulator corrects what is left after these iterations
settings.SetOption(SnoptSolver.id(), "Major iterations limit", 150)
settings.SetOption(SnoptSolver.id(), "Major optimality tolerance", 1e-3)
found = SnoptSolver().Solve(program, None, settings)
states = collocation.ReconstructStateTrajectory(found)
inputs = collocation.ReconstructInputTrajectory(found)
print(f"swing-up in {states.end_time():.2f} s: {found.get_solution_result()}")

# %% A regulator along the trajectory, whose last gain holds the acrobot upright.
options = FiniteHorizonLinearQuadraticRegulatorOptions()
options.x0, options.u0, options.Qf = states, inputs, cost_to_go
regulator = MakeFiniteHorizonLinearQuadraticRegulator(
    acrobot, context, 0.0, states.end_time(), Q, R, options
)
builder = DiagramBuilder()
for part in (acrobot, regulator):
    builder.AddSystem(part)
builder.Connect(acrobot.get_output_port(), regulator.get_input_port())
builder.Connect(regulator.get_output_port(), acrobot.get_input_port())
log = LogVectorOutput(acrobot.get_output_port(), builder, 0.02)
simulator = Simulator(builder.Build())
simulator.get_mutable_context().SetContinuousState([0.05, 0.0, 0.0, 0.0])  # not at the start
simulator.AdvanceTo(states.end_time() + 4.0)

# %% The planned and the simulated angles.
moved, figure = log.FindLog(simulator.get_context()), Figure((7, 3), layout="constrained")
axes = figure.subplots(subplot_kw={"xlabel": "time (s)", "ylabel": "angle (degrees)"})
times = np.linspace(0.0, states.end_time(), 100)
axes.plot(times, np.degrees(states.vector_values(times)[:2].T), "k--", linewidth=0.8)
axes.plot(moved.sample_times(), np.degrees(moved.data()[:2].T), label=["shoulder", "elbow"])
axes.legend()
figure.savefig(f"{Path(__file__).stem}.png", dpi=120)
print(f"at the end {np.degrees(moved.data()[:2, -1]).round(2)} degrees")
assert np.allclose(moved.data()[:, -1], upright, atol=0.05)  # whatever the solver has left
