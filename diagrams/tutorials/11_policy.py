"""A policy: forces by a clock and by what the robot senses, evolved by CMA-ES."""

# %% Robots with Coulomb friction. Each driven cable gets a weighted sum of the readings.
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import tetra_drake as td

base = td.load_scenario("coulomb").with_changes(
    {
        "engine": "!Compiled",
        "simulation.duration": "5 s",
        "simulation.steady_from": "1 s",
        "objective": {"distance": "1 /in"},
        "optimizer": "!CmaEs {sample: 0, starts: 1}",
        "evolution.trials": 1,
        "evolution.evaluations": 2000,
    }
)
policies = {
    "clock alone": "!Linear {readings: [clock], clock: 1.4 s}",
    "clock and senses": "!Linear {readings: [clock, lengths, normal_forces], clock: 1.4 s}",
}

# %% A run for each policy, and the way of the robot's centre with its best parameters.
if __name__ == "__main__":
    figure = Figure(figsize=(7.0, 3.0), layout="constrained")
    axes = figure.subplots()
    for name, policy in policies.items():
        scenario = base.with_changes({"policy": policy, "name": name})
        folder = f"out/policies/{name.replace(' ', '_')}"
        run = td.evolve(scenario, folder, overwrite=True, reevaluate=False, report=False)
        result = td.simulate(scenario, run.best_gait())
        way = result.path.centre[:, 0] - result.path.centre[0, 0]
        count = len(td.ParameterSpace.of(scenario).names)
        print(f"{name}: {count} parameters, {result.metrics.distance_in:.1f} in")
        axes.plot(result.path.times, 100.0 * np.asarray(way), label=name)
    axes.set(xlabel="time (s)", ylabel="way (cm)")
    axes.legend()
    figure.savefig(f"{Path(__file__).stem}.png", dpi=120)
