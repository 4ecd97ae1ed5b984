"""Cables: springs with damping and a superimposed actuation force (Eq. 6)."""

from __future__ import annotations

import numpy as np

from tetra_drake.physics.compiling import compiled
from tetra_drake.physics.kinematics import P_WN, V_WN, gather_forces, node_motion

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
def add_cable_forces(
    motion: Array,
    signals: Array,
    cables: Array,
    slack: bool,
    node_force: Array,
    tensions: Array,
    lengths: Array,
) -> None:
    """Adds the forces of all cables to those at the nodes.

    Args:
        motion: (nodes, MOTION_COLUMNS) of `kinematics`.
        signals: (signals,), actuation forces in N.
        cables: (cables,) of dtype CABLE.
        slack: whether cables go slack instead of pushing.
        node_force: (nodes, 3), added to, in N.
        tensions, lengths: (cables,), written, in N and m.
    """
    for i in range(cables.size):
        cable = cables[i]
        a = cable.node_a
        b = cable.node_b
        d_x = motion[b, P_WN] - motion[a, P_WN]
        d_y = motion[b, P_WN + 1] - motion[a, P_WN + 1]
        d_z = motion[b, P_WN + 2] - motion[a, P_WN + 2]
        length = np.sqrt(d_x * d_x + d_y * d_y + d_z * d_z)
        d_x /= length
        d_y /= length
        d_z /= length
        rate = (
            (motion[b, V_WN] - motion[a, V_WN]) * d_x
            + (motion[b, V_WN + 1] - motion[a, V_WN + 1]) * d_y
            + (motion[b, V_WN + 2] - motion[a, V_WN + 2]) * d_z
        )
        signal = signals[cable.signal] if cable.signal >= 0 else 0.0
        tension = cable_tension(
            length, rate, signal, cable.stiffness, cable.damping, cable.free_length, slack
        )
        f_x, f_y, f_z = tension * d_x, tension * d_y, tension * d_z
        node_force[a, 0] += f_x
        node_force[a, 1] += f_y
        node_force[a, 2] += f_z
        node_force[b, 0] -= f_x
        node_force[b, 1] -= f_y
        node_force[b, 2] -= f_z
        tensions[i] = tension
        lengths[i] = length


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
        p_BN: (nodes a body, 3), in m.
        generalized_force: (6 bodies,), written, [t_W; f_W] at each Bo.
        signals, cables, slack, tensions, lengths: as in `add_cable_forces`.
    """
    motion = node_motion(state, p_BN)
    node_force = np.zeros((motion.shape[0], 3))
    add_cable_forces(motion, signals, cables, slack, node_force, tensions, lengths)
    gather_forces(motion, node_force, generalized_force)
