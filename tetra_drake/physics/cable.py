"""Cables: springs with damping and a superimposed actuation force (Eq. 6)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tetra_drake.physics.actuator import (
    DIRECT,
    DRIVE,
    LIMITED,
    RATE,
    Actuator,
    CableLaw,
    actuator_pull,
)
from tetra_drake.physics.kinematics import FORCE, P_WN, V_WN, gather_forces, move_nodes
from tetra_drake.physics.vectors import (
    add_vector,
    difference,
    dot,
    put_vector,
    scaled,
    subtract_vector,
    vector_at,
)
from tetra_drake.simd.compiling import compiled, inlined
from tetra_drake.simd.lanes import Real, Table, inverse_sqrt, maximum

PASSIVE = -1
"""The `signal` of a cable that no signal drives."""


class Cables(NamedTuple):
    """The two nodes each cable joins, the signal that drives it, and its law in SI: (cables,)."""

    node_a: Table
    node_b: Table
    signal: Table
    stiffness: Table
    damping: Table
    free_length: Table


CABLE = np.dtype(
    [
        ("node_a", np.int64),
        ("node_b", np.int64),
        ("signal", np.int64),
        ("stiffness", float),
        ("damping", float),
        ("free_length", float),
    ]
)
"""One cable. Kernels take an array of these or Cables, alike."""

DIRECTION, LENGTH, TENSION, SLOPE, PULL_COLUMNS = 0, 3, 4, 5, 6
"""Columns of `pulls`, (cables, 6): direction from node a to node b in World, length (m), tension
(N), how much that rises with the rate of the length (N s/m); and their number."""


@inlined
def cable_tension(length: Real, rate: Real, signal: Real, law: CableLaw) -> Real:
    """Tension (N) of a cable of `length` (m) that lengthens at `rate` (m/s).

    Eq. 6, with the actuation `signal` (N) superimposed.
    """
    return law.stiffness * (length - law.free_length) + law.damping * rate + signal


@inlined
def add_cable_forces(
    nodes: Table,
    signals: Table,
    cables: Table,
    actuator: Actuator,
    slack: bool,
    keep: bool,
    drives: Table,
    pulls: Table,
) -> None:
    """Adds the forces of all cables to those on the `nodes` of `kinematics`.

    `signals`, (signals,), are in N. With `slack`, tensions are never negative. Writes the rates of
    `drives`, (drives, DRIVE_COLUMNS), and with `keep` the `pulls`.
    """
    drive = 0
    for i in range(pulls.shape[0]):
        a, b, driver = cables.node_a[i], cables.node_b[i], cables.signal[i]
        p_AB = difference(vector_at(nodes, b, P_WN), vector_at(nodes, a, P_WN))
        v_AB = difference(vector_at(nodes, b, V_WN), vector_at(nodes, a, V_WN))
        square = dot(p_AB, p_AB)
        per_length = inverse_sqrt(square)
        length, direction = square * per_length, scaled(per_length, p_AB)
        signal = 0.0
        if driver != PASSIVE:
            signal = signals[driver]
        rate = dot(v_AB, direction)
        law = CableLaw(cables.stiffness[i], cables.damping[i], cables.free_length[i])
        if driver == PASSIVE or actuator.kind == DIRECT:
            slope = law.damping
            tension = cable_tension(length, rate, signal, law)
            if slack:
                tension = maximum(tension, 0.0)
        else:
            pull = actuator_pull(actuator, drives[drive, DRIVE], length, rate, signal, law)
            tension, slope = pull.tension, pull.slope
            drives[drive, RATE], drives[drive, LIMITED] = pull.rate, pull.limited
            drive += 1
        force = scaled(tension, direction)
        add_vector(force, a, FORCE, nodes)
        subtract_vector(force, b, FORCE, nodes)
        if keep:
            put_vector(direction, i, DIRECTION, pulls)
            pulls[i, LENGTH], pulls[i, TENSION], pulls[i, SLOPE] = length, tension, slope


@compiled
def cable_forces(
    state: Table,
    signals: Table,
    p_BN: Table,
    first_node: Table,
    cables: Table,
    kind: int,
    limits: Table,
    slack: bool,
    drives: Table,
    nodes: Table,
    pulls: Table,
    generalized_force: Table,
) -> None:
    """Writes [t_W; f_W] of all cables at each Bo, (6 bodies,), for a state of the bodies; also
    `nodes`, `pulls` and the rates of `drives`. `kind` and `limits` are an Actuator's: a call from
    Python takes longer if it has to unpack them."""
    move_nodes(state, p_BN, first_node, nodes)
    actuator = Actuator(kind, limits)
    add_cable_forces(nodes, signals, cables, actuator, slack, True, drives, pulls)
    gather_forces(nodes, first_node, generalized_force)
