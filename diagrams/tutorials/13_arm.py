"""Tendons on an arm of Drake's: cables and actuators attach to bodies of any MultibodyPlant."""

# %% An arm of two links. Frames are the ends of cables, on its links or in the world.
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput, Sine

from tetra_drake.laws.cable import CableLaw
from tetra_drake.systems import AddCables, AddFrame, Cable

builder = DiagramBuilder()
plant, scene_graph = AddMultibodyPlantSceneGraph(builder, time_step=0.0)
Parser(plant).AddModelsFromUrl("package://drake/examples/acrobot/Acrobot.urdf")
wrist = AddFrame(plant, "wrist", plant.GetFrameByName("lower_link"), [0.0, 0.0, -1.5])
ends = [AddFrame(plant, f"x={x}", plant.world_frame(), [x, 0.0, -2.0]) for x in (-1.0, 1.0)]
plant.Finalize()

# %% Two tendons pull in turn. For a live view, call AddDefaultVisualization(builder) here.
law = CableLaw(stiffness=40.0, damping=6.0, free_length=0.7)
cables = [Cable(end.name(), end, wrist, law) for end in ends]
signals = {cable.name: [cable.name] for cable in cables}
tendons = AddCables(builder, plant, cables=cables, actuated=signals, scene_graph=scene_graph)
sine = builder.AddSystem(Sine([8.0, 8.0], [3.0, 3.0], [0.0, np.pi]))
builder.Connect(sine.get_output_port(0), tendons.GetInputPort("signals"))
log = LogVectorOutput(plant.get_state_output_port(), builder, 0.02)
simulator = Simulator(builder.Build())
simulator.AdvanceTo(8.0)

# %% The angles of the joints.
found, figure = log.FindLog(simulator.get_context()), Figure((7, 3), layout="constrained")
axes = figure.subplots(subplot_kw={"xlabel": "time (s)", "ylabel": "angle (degrees)"})
axes.plot(found.sample_times(), np.degrees(found.data()[:2].T), label=["shoulder", "elbow"])
axes.legend()
figure.savefig(f"{Path(__file__).stem}.png", dpi=120)
