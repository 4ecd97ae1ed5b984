"""Damage: a robot walks, and loses a cable on the way."""

# %% Robots side by side that all play the recorded walk of the robot with motors.
import tempfile
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import tetra_drake as td

scenario = td.load_scenario("runs/motors/scenario.yaml")
with tempfile.TemporaryDirectory() as folder:
    td.export(scenario, "runs/motors", rate=50.0, out=Path(folder) / "lab")
    command = td.load_command(Path(folder) / "lab" / "command.csv", scenario)
cables = scenario.whole_cables
robots = td.Simulation(scenario, count=len(cables) + 1, control_period=command.period)
to_centre = robots.robot.structure.node_shares

# %% After 6 s each robot but the last one loses another cable. None of them knows, and all go on.
way: list[np.ndarray] = []
while not robots.ended.all():
    step = len(way)
    if step == round(6.0 / command.period):
        for place, cable in enumerate(cables):
            robots.damage(place, cables=[cable])
    actions = command.samples[min(step, len(command.samples) - 1)]
    readings = robots.step(np.tile(actions, (robots.count, 1)))
    way.append((readings.p_WN[..., 0] @ to_centre).copy())
centimetres = 100.0 * (np.array(way) - way[0])

# %% The ways of all robots, and the cables that count least and most.
figure = Figure(figsize=(7.0, 3.4), layout="constrained")
axes = figure.subplots()
times, order = command.period * np.arange(1, len(way) + 1), centimetres[-1, :-1].argsort()
axes.plot(times, centimetres[:, order], color="0.75", linewidth=0.8)
for place in (order[-1], order[0]):
    axes.plot(times, centimetres[:, place], label=f"without {cables[place]}")
axes.plot(times, centimetres[:, -1], color="black", label="whole")
axes.set(xlabel="time (s)", ylabel="way (cm)")
axes.legend()
figure.savefig(f"{Path(__file__).stem}.png", dpi=120)
