"""An objective of one's own: walk far and keep the tops of the tetrahedra still."""

# %% An objective is a function of a result, to be maximised.
from pathlib import Path

from matplotlib.figure import Figure

import tetra_drake as td
from tetra_drake.results.result import SimulationResult

scenario = td.load_scenario("coulomb").with_changes(
    {
        "optimizer": "!CmaEs",
        "evolution.trials": 1,
        "evolution.evaluations": 300,
        "simulation.duration": "8 s",
    }
)


def straight_and_frugal(result: SimulationResult) -> float:
    """Distance in inches, less ten for each watt that an actuator needs on average."""
    return result.metrics.distance_in - 10.0 * result.metrics.mean_actuator_power


# %% Two searches: by the scenario's own objective, and by this one.
far = td.evolve(scenario, "out/far", overwrite=True, reevaluate=False, report=False)
frugal = td.evolve(
    scenario,
    "out/frugal",
    objective=straight_and_frugal,
    overwrite=True,
    reevaluate=False,
    report=False,
)

# %% What all gaits of both searches need and reach.
figure = Figure(figsize=(7.0, 4.0), layout="constrained")
axes = figure.subplots()
for name, run in {"for distance": far, "for distance and power": frugal}.items():
    power = 1e3 * run.evaluations.mean_actuator_power
    axes.plot(power, run.evaluations.distance_in, ".", label=f"evolved {name}")
axes.set(xlabel="mean power of an actuator (mW)", ylabel="distance in 8 s (in)")
axes.legend()
figure.savefig(Path(__file__).with_suffix(".png"), dpi=120)
