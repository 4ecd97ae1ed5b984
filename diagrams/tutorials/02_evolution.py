"""Evolution: gaits that walk far, found by CMA-ES on the compiled engine in some seconds."""

# %% The scenario has the settings of the search. They are changed here from Python.
from pathlib import Path

import tetra_drake as td
from tetra_drake.figures.fitness import fitness_of_trials

scenario = td.load_scenario("coulomb").with_changes(
    {
        "name": "tutorial",
        "optimizer": "!CmaEs",
        "evolution.trials": 4,
        "evolution.evaluations": 160,
        "simulation.duration": "8 s",
    }
)

# %% The folder records every evaluation. With resume=True, an interrupted run continues.
run = td.evolve(scenario, "out/evolution", overwrite=True, reevaluate=False, report=False)
print(run)

# %% The best gait of each trial, simulated on the compiled engine and on the Drake diagram.
for gait in run.gaits():
    compiled = td.simulate(scenario, gait)
    print(f"{gait.name}: {compiled.metrics.distance_in:.2f} in")
diagram = td.simulate(scenario.with_changes({"engine": "!Drake"}), run.best_gait())
print(f"the best on the diagram: {diagram.metrics.distance_in:.2f} in")

# %% Fitness over the evaluations of each trial.
fitness_of_trials(run).savefig(f"{Path(__file__).stem}.png", dpi=120)
