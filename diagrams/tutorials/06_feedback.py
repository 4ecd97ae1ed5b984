"""Feedback: oscillators that sense the stretch of their cables, on rough ground."""

# %% With `cpg.feedback`, a gait has a gain for each sense. Evolution finds the gains.
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import tetra_drake as td

changes = {
    "require": {"clearance": "0.125 in", "tension": "0 lbf"},  # else feedback may shake the robot
    "optimizer": "!CmaEs",
    "evolution.trials": 1,
    "evolution.evaluations": 200,
}
with_feedback = td.load_scenario("feedback").with_changes(changes)
without = with_feedback.with_changes({"cpg.feedback": []})

# %% Two searches of equal size on the same ground.
gaits = {}
for name, scenario in {"with feedback": with_feedback, "without": without}.items():
    out = f"out/{name.replace(' ', '_')}"
    run = td.evolve(scenario, out, overwrite=True, reevaluate=False, report=False)
    gaits[name] = scenario, run.best_gait()
print(gaits["with feedback"][1])

# %% Both gaits on new ground. One trial of each is too few to conclude: see runs/.
figure = Figure(figsize=(7.0, 4.0), layout="constrained")
axes = figure.subplots()
for name, (scenario, gait) in gaits.items():
    walks = td.sweep(scenario, gait, {"terrain.seed": list(range(1, 21))})
    inches = np.sort(walks.distance.squeeze() / 0.0254)
    axes.plot(np.arange(1, 21), inches, "o-", label=f"{name}: mean {inches.mean():.1f} in")
axes.set(xlabel="terrain, sorted by distance", ylabel="distance in 15 s (in)", xticks=[1, 10, 20])
axes.legend()
figure.savefig(f"{Path(__file__).stem}.png", dpi=120)
