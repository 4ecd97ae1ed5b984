"""Terrain and friction: one gait on other ground."""

# %% The best gait of a recorded run, evolved on a flat floor.
from pathlib import Path

from matplotlib.figure import Figure

import tetra_drake as td
from tetra_drake.robot.measures import distance_walked

run = td.load_run(Path(__file__).parents[2] / "runs" / "champion")
flat = run.scenario.with_changes({"robot.contacts": "all"})  # every node can touch the ground

# %% Kinds of terrain and friction, with their settings.
grounds: dict[str, dict[str, object]] = {
    "flat": {},
    "flat, slippery": {"friction": "!Coulomb {static: 0.15, kinetic: 0.15, stiffness: 300 N/m}"},
    "incline of 5 deg": {"terrain": "!Incline {slope: 5 deg}"},
    "steps of 0.25 in": {"terrain": "!Steps {height: 0.25 in, depth: 6 in, count: 4}"},
    "rough": {"terrain": "!Rough {amplitude: 0.25 in, wavelength: 6 in}"},
}
scenarios = [flat.with_changes({"name": name, **changes}) for name, changes in grounds.items()]
results = [td.simulate(scenario, run.best_gait(), record=True) for scenario in scenarios]

# %% Distance over time on each kind of ground.
figure = Figure(figsize=(7.0, 4.0), layout="constrained")
axes = figure.subplots()
for result in results:
    inches = distance_walked(result.trajectory, result.robot.structure) / 0.0254
    axes.plot(result.trajectory.time, inches, label=result.scenario.name)
axes.set(xlabel="time (s)", ylabel="distance (in)")
axes.legend()
figure.savefig(f"{Path(__file__).stem}.png", dpi=120)
results[-1].save_replay("out/rough.html")
