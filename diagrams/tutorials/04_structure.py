"""A structure of one's own: a prism of four struts, from its file to a gait."""

# %% The file beside this script lists nodes, struts, cables, and which cables oscillators drive.
from pathlib import Path

import tetra_drake as td
from tetra_drake.figures.gait_diagram import gait_diagram
from tetra_drake.report.structure_page import structure_text

here = Path(__file__).parent
print(structure_text(here / "four_struts.yaml"))

# %% A scenario with this robot, read from a file as the shipped ones are.
file = Path("out/four_struts.yaml")
file.parent.mkdir(exist_ok=True)
file.write_text(
    f"""
base: prism
name: four-struts
robot: !Structure {{file: {here / "four_struts.yaml"}}}
evolution: {{evaluations: 300}}
optimizer: !CmaEs {{}}
""",
    encoding="utf-8",
)
scenario = td.load_scenario(file)

# %% It hops: each side cable pulls its strut's foot along.
run = td.evolve(scenario, "out/four_struts", overwrite=True, reevaluate=False, report=False)
result = td.simulate(scenario, run.best_gait(), record=True)
print(result.metrics)
result.save_replay("out/four_struts.html")
gait_diagram(result).savefig(Path(__file__).with_suffix(".png"), dpi=120)
