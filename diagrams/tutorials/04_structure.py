"""A structure of one's own: a prism of four struts, from its file to a gait."""

# %% The file beside this script lists nodes, struts, cables and the driven cables.
from pathlib import Path

import tetra_drake as td
from tetra_drake.figures.gait_diagram import gait_diagram

# %% A scenario with this robot. In a file: robot: !Structure {file: four_struts.yaml}
structure = Path(__file__).parent / "four_struts.yaml"
scenario = td.load_scenario("prism").with_changes(
    {
        "name": "four-struts",
        "robot": f"!Structure {{file: {structure}}}",
        "optimizer": "!CmaEs",
        "evolution.evaluations": 400,
    }
)
print(scenario)

# %% In equilibrium: does every cable pull?
still = scenario.with_changes({"cpg.gain": "0 lbf"})
rest = td.simulate(still, td.seeded_gait(still))
print(f"least tension of a cable: {rest.metrics.tension:.2f} N")

# %% A gait for its four oscillators, one for each side cable.
run = td.evolve(scenario, "out/four_struts", overwrite=True, reevaluate=False, report=False)
result = td.simulate(scenario, run.best_gait(), record=True)
print(result.metrics)
result.save_replay("out/four_struts.html")
gait_diagram(result).savefig(f"{Path(__file__).stem}.png", dpi=120)
