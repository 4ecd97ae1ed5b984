"""Cables: springs with damping and a superimposed actuation force (Eq. 6)."""

from __future__ import annotations

from typing import Any

import numpy as np

from tetra_drake.physics.compiling import compiled
from tetra_drake.physics.kinematics import FORCE, P_WN, V_WN, gather_forces, move_nodes

Array = np.ndarray

PASSIVE = -1
"""The `signal` of a cable that no signal drives."""

CABLE = np.dtype(
    [(name, np.int64) for name in ("node_a", "node_b", "signal")]
    + [(name, np.float64) for name in ("stiffness", "damping", "free_length")]
)
"""One cable: the two nodes it joins, its law in SI, and the signal that drives it."""


@compiled
def cable_tension(length: float, rate: float, signal: float, cable: Any, slack: bool) -> float:
    """Tension (N) of a cable of `length` (m) that lengthens at `rate` (m/s).

    Eq. 6, with the actuation `signal` (N) superimposed. With `slack`, never negative.
    """
    tension = cable.stiffness * (length - cable.free_length) + cable.damping * rate + signal
    if slack and tension < 0.0:
        return 0.0
    return tension


@compiled
def add_cable_forces(nodes: Array, signals: Array, cables: Array, slack: bool) -> Array:
    """Adds the forces of all cables to those on the `nodes` of `kinematics`.

    `signals`, (signals,), are in N; `cables` is of dtype CABLE. Returns (2, cables): tensions (N)
    and lengths (m).
    """
    found = np.empty((2, cables.size))
    for i in range(cables.size):
        cable = cables[i]
        a = cable.node_a
        b = cable.node_b
        d_x = nodes[b, P_WN] - nodes[a, P_WN]
        d_y = nodes[b, P_WN + 1] - nodes[a, P_WN + 1]
        d_z = nodes[b, P_WN + 2] - nodes[a, P_WN + 2]
        length = np.sqrt(d_x * d_x + d_y * d_y + d_z * d_z)
        d_x /= length
        d_y /= length
        d_z /= length
        rate = (
            (nodes[b, V_WN] - nodes[a, V_WN]) * d_x
            + (nodes[b, V_WN + 1] - nodes[a, V_WN + 1]) * d_y
            + (nodes[b, V_WN + 2] - nodes[a, V_WN + 2]) * d_z
        )
        signal = signals[cable.signal] if cable.signal >= 0 else 0.0
        tension = cable_tension(length, rate, signal, cable, slack)
        f_x, f_y, f_z = tension * d_x, tension * d_y, tension * d_z
        nodes[a, FORCE] += f_x
        nodes[a, FORCE + 1] += f_y
        nodes[a, FORCE + 2] += f_z
        nodes[b, FORCE] -= f_x
        nodes[b, FORCE + 1] -= f_y
        nodes[b, FORCE + 2] -= f_z
        found[0, i], found[1, i] = tension, length
    return found


@compiled
def cable_forces(
    state: Array, signals: Array, p_BN: Array, cables: Array, slack: bool, generalized_force: Array
) -> None:
    """Writes [t_W; f_W] of all cables at each Bo, (6 bodies,), for a state of the bodies."""
    nodes = move_nodes(state, p_BN)
    add_cable_forces(nodes, signals, cables, slack)
    generalized_force[:] = gather_forces(nodes, state.size // 13)
