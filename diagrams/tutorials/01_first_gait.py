"""A first gait: simulate it, read its numbers, watch it, draw it."""

# %% A scenario gives the robot and its world. A gait gives the numbers of its oscillators.
from pathlib import Path

import tetra_drake as td
from tetra_drake.figures.gait_diagram import gait_diagram

scenario = td.load_scenario("coulomb")  # the thesis's robot, on feet that hold
gait = td.seeded_gait(scenario, seed=80)  # a random one
result = td.simulate(scenario, gait, record=True)
print(result.metrics)

# %% An animation for any browser. In a notebook, result.show() shows it.
result.save_replay("out/first_gait.html")

# %% The trajectory is an xarray dataset in SI units, with names along its axes.
outer = result.trajectory.tension.sel(cable_group="outer", time=slice(5.0, None))
print("greatest tension of an outer cable:", f"{outer.max().item():.2f} N")

# %% Feet on the ground, signals of the oscillators and speed of the robot over time.
gait_diagram(result).savefig(f"{Path(__file__).stem}.png", dpi=120)
