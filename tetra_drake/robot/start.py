"""Start of a robot, turned and in motion, and the effect of a push."""

from __future__ import annotations

import dataclasses

import numpy as np
from pydrake.multibody.tree import RotationalInertia

from tetra_drake.errors import InputError
from tetra_drake.laws.kinematics import P_WN, V_WN
from tetra_drake.robot.structure import Structure, moved_nodes, rotated, turned_back
from tetra_drake.scenario.start import BodyStart, Push, Start
from tetra_drake.scenario.world import World

HELD_STILL, HELD_SLOW = 1e-6, 1e-3
"""Largest displacement of what is held at the start, as a share of the robot's length; and largest
speed, as a share of the fastest node's. Numbers in files are rounded."""


def started(scenario: World, structure: Structure, start: Start) -> Structure:
    """A copy of a structure that is turned and moves as `start` says: first as a whole about its
    centre of mass, then body by body. Raises InputError if what is held would move."""
    from scipy.spatial.transform import Rotation

    own = [start.bodies.get(name, BodyStart()) for name in structure.bodies]
    whole, turns = start.rotation, [one.rotation for one in own]
    before = Rotation.from_quat(np.roll(structure.q_WB, -1, axis=1))
    turned = Rotation.concatenate(turns) * whole * before
    centre = structure.mass @ structure.p_WB / structure.mass.sum()
    arms = whole.apply(structure.p_WB - centre)
    w_WB = np.add(start.spin, [one.spin for one in own])
    v_WB = start.velocity + np.cross(start.spin, arms) + [one.velocity for one in own]
    moved = dataclasses.replace(
        structure,
        p_WB=centre + arms,
        q_WB=np.roll(turned.as_quat(), 1, axis=1),
        v_WB=np.hstack([w_WB, v_WB]),
    )
    if scenario.terrain.is_ground:
        moved.p_WB[:, 2] += max(0.0, _depth(moved) - max(0.0, _depth(structure)))
    _check_held(scenario, structure, moved)
    return moved


def _depth(structure: Structure) -> float:
    """Depth (m) of the deepest foot below z = 0; negative above."""
    nodes, feet = moved_nodes(structure, structure.initial_state), structure.contacts
    bottoms = nodes[feet, P_WN + 2] - structure.contact_radius[feet]
    return -float(bottoms.min(initial=np.inf))


def _check_held(scenario: World, before: Structure, after: Structure) -> None:
    """Raises InputError if the start moves a node along an axis of its anchor, or parts the nodes
    of a joint."""
    nodes = moved_nodes(after, after.initial_state)
    moves, v_WN = nodes[:, P_WN : P_WN + 3].copy(), nodes[:, V_WN : V_WN + 3]
    moves -= moved_nodes(before, before.initial_state)[:, P_WN : P_WN + 3]
    (first, second), names = after.joints.T, after.node_names
    named = [*names, *(f"{names[a]} from {names[b]}" for a, b in after.joints)]
    size, speed = after.length, np.linalg.norm(v_WN, axis=1).max()
    for vectors, unit, most in ((moves, "m", HELD_STILL * size), (v_WN, "m/s", HELD_SLOW * speed)):
        apart = np.vstack([vectors * before.held, vectors[first] - vectors[second]])
        worst, axis = np.unravel_index(np.abs(apart).argmax(), apart.shape)
        if abs(apart[worst, axis]) > most:
            found = scenario.units.shown(float(apart[worst, axis]), unit)
            problem = f"moves {named[worst]}, which is held along {'xyz'[axis]}, by {found}"
            raise InputError(scenario.name, "robot.start", f"{problem}; expected 0")


def pushed(states: np.ndarray, structure: Structure, push: Push) -> np.ndarray:
    """States [q; v] (..., 13*bodies) after a push on a body or a node of a structure."""
    on_node = push.on in structure.node_names
    node = structure.node_names.index(push.on) if on_node else 0
    body = structure.carriers[node] if on_node else structure.bodies.index(push.on)
    p_BN = structure.p_BN[node] if on_node else np.zeros(3)
    q, v = states[..., 7 * body : 7 * body + 4], 7 * len(structure.bodies) + 6 * body
    moments = structure.mass[body] * structure.unit_inertia[body]
    inertia = RotationalInertia(*moments).CopyToFullMatrix3()
    moment = np.cross(p_BN, turned_back(q, np.array(push.impulse)))
    after = states.copy()
    after[..., v : v + 3] += rotated(q, moment @ np.linalg.pinv(inertia, hermitian=True))
    after[..., v + 3 : v + 6] += np.divide(push.impulse, structure.mass[body])
    return after
