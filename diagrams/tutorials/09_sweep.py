"""A sweep: how distance depends on the cables and on friction, over several gaits."""

# %% Ten gaits of a recorded run, so that no single one decides.
from pathlib import Path

from matplotlib.figure import Figure

import tetra_drake as td

run = td.load_run(Path(__file__).parents[2] / "runs" / "coulomb")

# %% All combinations in one call: an xarray dataset with an axis for each key and one for gaits.
walks = td.sweep(
    run.scenario,
    run.gaits(),
    {
        "robot.cables.outer_stiffness": [f"{k} N/m" for k in range(25, 52, 3)],
        "friction.static": [0.5, 0.7],
    },
)
print(walks.distance)

# %% The mean over the gaits, and their quartiles.
figure = Figure(figsize=(7.0, 4.0), layout="constrained")
axes = figure.subplots()
inches = walks.distance / 0.0254
for static, of_one in inches.groupby("static"):
    low, middle, high = of_one.squeeze("static").quantile([0.25, 0.5, 0.75], dim="gait")
    axes.fill_between(walks.outer_stiffness, low, high, alpha=0.2)
    axes.plot(walks.outer_stiffness, middle, label=f"static friction {static:g}")
axes.set(xlabel="stiffness of the outer cables (N/m)", ylabel="distance in 15 s (in)")
axes.legend()
figure.savefig(f"{Path(__file__).stem}.png", dpi=120)
