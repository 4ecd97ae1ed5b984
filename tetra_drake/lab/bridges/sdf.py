"""Model of a structure in SDFormat, without its cables, which SDFormat does not know, and joints.

Each body is a link, with a frame "node NAME" for each node: the ends of cables, for AddCables().
Fixed nodes are frames of the link "fixed nodes", which is welded to the world. What can touch has
collision shapes: struts, and the feet of contact nodes, unless their radius is 0. Joints may make
loops, which Drake's parser refuses, so they are left to the reader: both nodes of a joint have
frames.
"""

from __future__ import annotations

import re
from xml.etree.ElementTree import Element

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform, RollPitchYaw

from tetra_drake.errors import InputError
from tetra_drake.laws.model import WORLD
from tetra_drake.robot.structure import NODE_COLOUR, Shape, Structure, shapes_of
from tetra_drake.robot.xml_elements import add_element, xml_text

FIXED = "fixed nodes"
"""Name of the link of the fixed nodes."""


def make_sdf(structure: Structure, state: np.ndarray, *, name: str) -> str:
    """SDFormat text of a model called `name`: the bodies of a structure at the poses of a `state`
    [q; v] (13*bodies,), with a frame for each node. Cables and joints are left out. Raises
    InputError for a name that SDFormat refuses."""
    root = Element("sdf", version="1.9")
    model = add_element(root, "model", name=name)
    shapes = [*shapes_of(structure)]
    poses = state[: 7 * len(structure.bodies)].reshape(-1, 7)
    for body, pose in enumerate(poses):
        link = add_element(model, "link", name=structure.bodies[body])
        _add_pose(link, RigidTransform(Quaternion(pose[:4] / np.linalg.norm(pose[:4])), pose[4:]))
        inertial = add_element(link, "inertial")
        add_element(inertial, "mass", structure.mass[body])
        inertia = add_element(inertial, "inertia")
        moments = structure.mass[body] * structure.unit_inertia[body]
        for axes, moment in zip(("xx", "yy", "zz", "xy", "xz", "yz"), moments, strict=True):
            add_element(inertia, f"i{axes}", moment)
        for shape in shapes:
            if shape.body == body:
                visual = _add_shape(link, "visual", shape, "cylinder")
                add_element(add_element(visual, "material"), "diffuse", shape.colour)
                if shape.length:
                    _add_shape(link, "collision", shape, "capsule")
        for node in structure.contacts[structure.carriers[structure.contacts] == body]:
            radius, X_BS = structure.contact_radius[node], RigidTransform(structure.p_BN[node])
            foot = Shape(f"foot {structure.node_names[node]}", body, X_BS, radius, 0.0, NODE_COLOUR)
            if radius:
                _add_shape(link, "collision", foot, "capsule")
    if (structure.carriers == WORLD).any():
        add_element(model, "link", name=FIXED)
        joint = add_element(model, "joint", name=FIXED + " weld", type="fixed")
        add_element(joint, "parent", "world")
        add_element(joint, "child", FIXED)
    links = *structure.bodies, FIXED
    for node, p_BN in enumerate(structure.p_BN):
        link_name, frame = links[structure.carriers[node]], f"node {structure.node_names[node]}"
        element = add_element(model, "frame", name=frame, attached_to=link_name)
        _add_pose(element, RigidTransform(p_BN))
    taken = [part.get("name") for part in model]
    for given in (each.get("name", "") for each in root.iter()):
        if re.search(r"::|^__.*__$|^world$|^\s|\s$", given) or taken.count(given) > 1:
            problem = f"found the name '{given}', which SDFormat reserves, or takes once only"
            raise InputError(name, "robot", problem)
    return xml_text(root)


def _add_pose(parent: Element, X: RigidTransform) -> None:
    angles = RollPitchYaw(X.rotation()).vector()
    add_element(parent, "pose", np.concatenate([X.translation(), angles]))


def _add_shape(link: Element, purpose: str, shape: Shape, kind: str) -> Element:
    """Adds a shape to a link, and returns the new element. Its tag is `purpose`: "visual" or
    "collision".

    `kind` is the SDFormat tag of the shape's solid: "cylinder" or "capsule". A shape of length 0
    gets the tag "sphere" instead."""
    element = add_element(link, purpose, name=shape.name)
    _add_pose(element, shape.X_BS)
    solid = add_element(add_element(element, "geometry"), kind if shape.length else "sphere")
    add_element(solid, "radius", shape.radius)
    if shape.length:
        add_element(solid, "length", shape.length)
    return element
