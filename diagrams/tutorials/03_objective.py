"""A custom objective: a large distance with little power."""

# %% An objective is a function of a result. The search maximises it.
from pathlib import Path

from matplotlib.figure import Figure

import tetra_drake as td
from tetra_drake.results.result import SimulationResult

scenario = td.load_scenario("coulomb").with_changes(
    {
        "optimizer": "!CmaEs",
        "evolution.trials": 1,
        "evolution.evaluations": 250,
        "simulation.duration": "8 s",
    }
)


def far_and_frugal(result: SimulationResult) -> float:
    """Distance in inches, less one for each 10 mW that an actuator needs on average."""
    return result.metrics.distance_in - 100.0 * result.metrics.mean_actuator_power


# %% Two searches with all their gaits: one with the scenario's objective, one with this objective.
figure = Figure(figsize=(7.0, 4.0), layout="constrained")
axes = figure.subplots()
for name, objective in {"distance": None, "distance and power": far_and_frugal}.items():
    out = f"out/{name.replace(' ', '_')}"
    run = td.evolve(
        scenario, out, objective=objective, overwrite=True, reevaluate=False, report=False
    )
    power = 1e3 * run.evaluations.mean_actuator_power
    axes.plot(power, run.evaluations.distance_in, ".", label=f"evolved for {name}")
axes.set(xlabel="mean power of an actuator (mW)", ylabel="distance in 8 s (in)")
axes.legend()
figure.savefig(f"{Path(__file__).stem}.png", dpi=120)
