"""Cables: springs with damping and a superimposed actuation force (Eq. 6)."""

from __future__ import annotations

import numpy as np

from tetra_drake.physics.compiling import compiled
from tetra_drake.physics.kinematics import add_node_force, node_motion

Array = np.ndarray

PASSIVE = -1
"""The `signal` of a cable that no signal drives."""

CABLE = np.dtype(
    [
        ("node_a", np.int64),
        ("node_b", np.int64),
        ("stiffness", np.float64),
        ("damping", np.float64),
        ("free_length", np.float64),
        ("signal", np.int64),
    ]
)
"""One cable: the two nodes it joins, its law in SI, and the signal that drives it."""


@compiled
def cable_tension(
    length: float,
    rate: float,
    signal: float,
    stiffness: float,
    damping: float,
    free_length: float,
    slack: bool,
) -> float:
    """Tension (N) of a cable of `length` (m) that lengthens at `rate` (m/s).

    Eq. 6, with the actuation `signal` (N) superimposed. With `slack`, never negative.
    """
    tension = stiffness * (length - free_length) + damping * rate + signal
    if slack and tension < 0.0:
        return 0.0
    return tension


@compiled
def cable_forces(
    state: Array,
    signals: Array,
    p_BN: Array,
    cables: Array,
    slack: bool,
    generalized_force: Array,
    tensions: Array,
    lengths: Array,
) -> None:
    """Forces of all cables on the bodies.

    Args:
        state: [q; v] of the bodies, 13 numbers a body.
        signals: (signals,), actuation forces in N.
        p_BN: (nodes a body, 3), in m.
        cables: (cables,) of dtype CABLE.
        slack: whether cables go slack instead of pushing.
        generalized_force: (6 bodies,), written, [t_W; f_W] at each Bo.
        tensions, lengths: (cables,), written, in N and m.
    """
    nodes_a_body = p_BN.shape[0]
    p_BN_W, p_WN, v_WN = node_motion(state, p_BN)
    generalized_force[:] = 0.0
    for i in range(cables.size):
        cable = cables[i]
        a = cable.node_a
        b = cable.node_b
        d_x = p_WN[b, 0] - p_WN[a, 0]
        d_y = p_WN[b, 1] - p_WN[a, 1]
        d_z = p_WN[b, 2] - p_WN[a, 2]
        length = np.sqrt(d_x * d_x + d_y * d_y + d_z * d_z)
        d_x /= length
        d_y /= length
        d_z /= length
        rate = (
            (v_WN[b, 0] - v_WN[a, 0]) * d_x
            + (v_WN[b, 1] - v_WN[a, 1]) * d_y
            + (v_WN[b, 2] - v_WN[a, 2]) * d_z
        )
        signal = signals[cable.signal] if cable.signal >= 0 else 0.0
        tension = cable_tension(
            length, rate, signal, cable.stiffness, cable.damping, cable.free_length, slack
        )
        f_x, f_y, f_z = tension * d_x, tension * d_y, tension * d_z
        add_node_force(a // nodes_a_body, p_BN_W[a], f_x, f_y, f_z, generalized_force)
        add_node_force(b // nodes_a_body, p_BN_W[b], -f_x, -f_y, -f_z, generalized_force)
        tensions[i] = tension
        lengths[i] = length
