"""The robot live in Meshcat, with a controller in place of the network: forces by its loads."""

# %% Each driven cable pulls in its part of a period, and harder where the ground bears more.
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from pydrake.geometry import Meshcat

import tetra_drake as td
from tetra_drake.engines.drake import MakeSimulator
from tetra_drake.robot.command import controlled_robot
from tetra_drake.robot.readings import Readings
from tetra_drake.scenario.engine_kinds import Drake
from tetra_drake.systems import SampledController
from tetra_drake.systems.diagram import MakeTensegrityDiagram

robot = controlled_robot(td.load_scenario("coulomb"))
phases = np.arange(robot.driven.size) // 2 * np.pi / 2.0


def law(time: float, readings: Readings) -> np.ndarray:
    share = readings.normal_forces[: phases.size] / robot.weight
    return (1.0 + 4.0 * share) * np.sin(2.0 * np.pi * 0.7 * time - phases)


# %% The diagram, whose SceneGraph shows bodies and cables at the address that Drake prints.
# With Drake 1.58, hold Ctrl and drag a body with the left mouse button to pull the robot.
controller, meshcat = SampledController(robot, law, period=0.01), Meshcat()
centre = robot.structure.p_WB.mean(axis=0)
meshcat.SetCameraPose(centre + np.array([0.1, -0.35, 0.15]), centre)
diagram = MakeTensegrityDiagram(robot, controller=controller, meshcat=meshcat)
simulator, ways, times = MakeSimulator(diagram, robot, Drake()), [], np.arange(0.0, 4.0, 0.02)
simulator.set_target_realtime_rate(1.0)
for time in times:
    simulator.AdvanceTo(time)
    state = diagram.GetOutputPort("state").Eval(simulator.get_context())
    ways.append(1e3 * (state[:35].reshape(5, 7)[:, 4] - robot.structure.p_WB[:, 0]).mean())

figure = Figure(figsize=(7.0, 3.0), layout="constrained")
axes = figure.subplots(subplot_kw={"xlabel": "time (s)", "ylabel": "way of the centre (mm)"})
axes.plot(times, ways)
figure.savefig(f"{Path(__file__).stem}.png", dpi=120)
