"""The Matsuoka oscillator in a diagram of one's own: it pumps up a pendulum of Drake's."""

# %% Two neurons that inhibit each other; the pendulum's angle calms one and excites the other.
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from pydrake.examples import PendulumPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput, MatrixGain

from tetra_drake.laws.matsuoka import Network
from tetra_drake.systems import MatsuokaCpg

network = Network.of([[0.0, 2.0], [2.0, 0.0]], tau_a=0.25, tau_b=0.5, self_inhibition_weight=2.5)
neurons = MatsuokaCpg(network, tonic=0.5, initial_state=[0.3, 0.3, 0.1, 0.5], gain=1.0)

# %% Connects the signal to the torque and the angle to the feedback.
builder = DiagramBuilder()
oscillator = builder.AddNamedSystem("oscillator", neurons)
pendulum = builder.AddNamedSystem("pendulum", PendulumPlant())
sense = builder.AddNamedSystem("sense", MatrixGain(np.array([[-1.0, 0.0], [1.0, 0.0]])))
builder.Connect(oscillator.GetOutputPort("signals"), pendulum.get_input_port())
builder.Connect(pendulum.get_state_output_port(), sense.get_input_port())
builder.Connect(sense.get_output_port(), oscillator.GetInputPort("feedback"))
torque = LogVectorOutput(oscillator.GetOutputPort("signals"), builder, publish_period=0.01)
motion = LogVectorOutput(pendulum.get_state_output_port(), builder, publish_period=0.01)
simulator = Simulator(builder.Build())
simulator.AdvanceTo(20.0)

# %% The oscillator adopts the rhythm of the pendulum, which is faster than its own.
figure = Figure(figsize=(7.0, 3.0), layout="constrained")
axes = figure.subplots()
for name, sink, unit in (("torque", torque, "N m"), ("angle", motion, "rad")):
    log = sink.FindLog(simulator.get_context())
    axes.plot(log.sample_times(), log.data()[0], label=f"{name} ({unit})")
axes.set(xlabel="time (s)")
axes.legend()
figure.savefig(f"{Path(__file__).stem}.png", dpi=120)
