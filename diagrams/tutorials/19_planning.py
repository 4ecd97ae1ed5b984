"""Planning: a rover rolls to a goal, steered by the planner with a cost of one's own."""

# %% Every half second the planner simulates 64 motions of 2 s. Those that end near the goal count.
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import tetra_drake as td
from tetra_drake.robot.readings import Readings

engine = "!Compiled {tolerance: 10 mm/s, max_step: 10 ms}"
rover = td.load_scenario("rover").with_changes({"engine": engine, "simulation.duration": "8 s"})
goal = np.array([2.0, 0.5])


def distance(readings: Readings) -> np.ndarray:
    centre = readings.p_WN[-1, :, :, :2].mean(axis=1)  # of all nodes, at the end of the horizon
    return np.asarray(np.linalg.norm(centre - goal, axis=1))


# %% The robot could as well be on another engine, or be disturbed. A plan acts half a second late.
planner = td.Planner(
    rover,
    distance,
    samples=64,
    knots=6,
    noise=1.0,
    temperature=0.1,
    control_period=0.1,
    decision_period=0.5,
    delayed=True,
)
result = td.simulate(rover, controller=planner, control_period=0.1)
path = result.path.centre[:, :2]
print(f"{planner}; {np.linalg.norm(path[-1] - goal):.2f} m from the goal")

figure = Figure(figsize=(7.0, 3.0), layout="constrained")
axes = figure.subplots(subplot_kw={"xlabel": "x (m)", "ylabel": "y (m)", "aspect": "equal"})
axes.plot(*path.T, label="centre of the rover")
axes.plot(*goal, "o", label="goal")
axes.legend(loc="lower right")
figure.savefig(f"{Path(__file__).stem}.png", dpi=120)
