"""Save and branch: all sequences of two actions, from states of a robot that are kept."""

# %% An action pulls with one half of the driven cables, or with the other, for 0.25 s.
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import tetra_drake as td

DEPTH, PERIOD = 6, 0.25
scenario = td.load_scenario("coulomb").with_changes({"engine": "!Compiled"})
simulation = td.Simulation(scenario, count=2**DEPTH, control_period=PERIOD)
half = np.arange(simulation.rest.shape[1]) % 4 < 2
choices = simulation.rest[0] + 3.0 * np.stack([half, ~half])
actions = choices[np.arange(simulation.count) % 2]
start = simulation.robot.structure.p_WN[:, 0].mean()
figure = Figure(figsize=(7.0, 3.0), layout="constrained")
axes = figure.subplots(subplot_kw={"xlabel": "time (s)", "ylabel": "way of the nodes (mm)"})

# %% From each state the robot goes on in two ways, and all robots of a depth side by side.
states, ways = simulation.save([0]), np.zeros(1)
for depth in range(1, DEPTH + 1):
    robots = np.arange(2**depth)
    simulation.restore(states[robots // 2], robots)
    readings = simulation.step(actions, indices=robots)
    states, before = simulation.save(robots), ways[robots // 2]
    ways = 1e3 * (readings.p_WN[robots, :, 0].mean(axis=1) - start)
    axes.plot([PERIOD * (depth - 1), PERIOD * depth], [before, ways], "C0", linewidth=0.8)
best = int(ways.argmax())
print(f"the best of {ways.size} sequences, {best:0{DEPTH}b}, goes {ways[best]:.1f} mm")
figure.savefig(f"{Path(__file__).stem}.png", dpi=120)
