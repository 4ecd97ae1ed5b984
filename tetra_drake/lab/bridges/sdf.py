"""Model of a structure in SDFormat, without its cables, which SDFormat does not know, and joints.

Each body is a link, with a frame "node NAME" for each node: the ends of cables, for AddCables().
Fixed nodes are frames of the link "fixed nodes", which is welded to the world. What can touch has
collision shapes: struts, and the feet of contact nodes, unless their radius is 0. Joints may make
loops, which Drake's parser refuses, so they are left to the reader: both nodes of a joint have
frames.
"""

from __future__ import annotations

import re

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform, RollPitchYaw

from tetra_drake.errors import InputError
from tetra_drake.formatting import render
from tetra_drake.laws.model import WORLD
from tetra_drake.robot.structure import NODE_COLOUR, Shape, Structure, shapes_of

FIXED = "fixed nodes"
"""Name of the link of the fixed nodes."""


def make_sdf(structure: Structure, state: np.ndarray, *, name: str) -> str:
    """SDFormat text of a model called `name`: the bodies of a structure at the poses of a `state`
    [q; v] (13*bodies,), with a frame for each node. Cables and joints are left out. Raises
    InputError for a name that SDFormat refuses."""
    poses = state[: 7 * len(structure.bodies)].reshape(-1, 7)
    turns = [Quaternion(pose[:4] / np.linalg.norm(pose[:4])) for pose in poses]
    visible = [*shapes_of(structure)]
    solid = [shape for shape in visible if shape.length]
    for node in structure.contacts[structure.contact_radius[structure.contacts] > 0.0]:
        foot, X_BS = f"foot {structure.node_names[node]}", RigidTransform(structure.p_BN[node])
        body, radius = structure.carriers[node], structure.contact_radius[node]
        solid.append(Shape(foot, body, X_BS, radius, 0.0, NODE_COLOUR))
    fixed = [FIXED, f"{FIXED} weld"] if (structure.carriers == WORLD).any() else []
    frames = [f"node {node}" for node in structure.node_names]
    taken = [*structure.bodies, *fixed, *frames]
    for given in [name, *taken, *(shape.name for shape in visible + solid)]:
        if re.search(r"::|^__.*__$|^world$|^\s|\s$", given) or taken.count(given) > 1:
            problem = f"found the name '{given}', which SDFormat reserves, or takes once only"
            raise InputError(name, "robot", problem)
    return render(
        "lab/bridges/model.sdf.jinja",
        name=name,
        structure=structure,
        X_WB=[RigidTransform(turn, pose[4:]) for turn, pose in zip(turns, poses, strict=True)],
        visible=visible,
        solid=solid,
        fixed=fixed,
        frames=frames,
        pose=_pose,
    )


def _pose(given: RigidTransform | np.ndarray) -> str:
    """Text of a pose, or of a position (3,)."""
    X = RigidTransform(given)
    numbers = np.concatenate([X.translation(), RollPitchYaw(X.rotation()).vector()])
    return " ".join(map(repr, numbers.tolist()))
