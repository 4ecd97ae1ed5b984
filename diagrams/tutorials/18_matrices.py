"""A structure from matrices: nodes and connectivity as MATLAB's tensegrity toolboxes save them."""

# %% Nodes N (3, n), bars C_b and strings C_s (members, n): a row has -1 at its start, 1 at its end.
import json
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.io import loadmat

from tetra_drake.lab.gym.picture import picture
from tetra_drake.lab.study.equilibrium import robot_of_file, structure_text, study_equilibrium
from tetra_drake.robot.structure import node_positions

matrices = loadmat(Path(__file__).parent / "tower.mat")  # or numpy.loadtxt() for a CSV file


def pairs(members: np.ndarray) -> list[list[str]]:
    """Names of the two nodes of each member."""
    ends = np.stack([members.argmin(axis=1), members.argmax(axis=1)], axis=1)
    return [[f"n{start}", f"n{end}"] for start, end in ends.tolist()]


# %% The matrices say nothing of thickness and stiffness. JSON is YAML, too.
bar = {"diameter": "8 mm", "density": "1.2 g/cm^3", "node_diameter": "16 mm"}
string = {"stiffness": "400 N/m", "damping": "4 N*s/m", "tension": "10 N"}
nodes = {f"n{i}": place for i, place in enumerate(matrices["N"].T.tolist())}
structure = {"format": 1, "unit": "m", "nodes": nodes}
structure["struts"] = {"bar": bar | {"pairs": pairs(matrices["C_b"])}}
structure["cables"] = {"string": string | {"pairs": pairs(matrices["C_s"])}}
Path("out").mkdir(exist_ok=True)
Path("out/tower.yaml").write_text(json.dumps(structure))

# %% The command tetra-drake structure out/tower.yaml prints the same.
robot = robot_of_file("out/tower.yaml")
print(structure_text(study_equilibrium(robot)))
figure = Figure(figsize=(6.8, 4.0), layout="constrained")
axes = figure.subplots()
axes.imshow(picture(robot, node_positions(robot.structure, robot.structure.initial_state)))
axes.axis("off")
figure.savefig(f"{Path(__file__).stem}.png", dpi=120)
