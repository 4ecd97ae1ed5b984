"""States of the robot to test forces, rates and the laws of conservation on."""

import numpy as np

from tetra_drake.robot.structure import Structure, node_positions


def disturbed(structure: Structure, seed: int, *, pose: float, speed: float) -> np.ndarray:
    """The start (13 n,) with normally distributed errors of all positions (m), quaternions,
    and velocities (m/s, rad/s)."""
    generator = np.random.default_rng(seed)
    state, bodies = structure.initial_state, len(structure.bodies)
    state[: 7 * bodies] += generator.normal(scale=pose, size=7 * bodies)
    state[7 * bodies :] = generator.normal(scale=speed, size=6 * bodies)
    quaternions = state[: 7 * bodies].reshape(bodies, 7)[:, :4]
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    return state


def stretched(structure: Structure, state: np.ndarray) -> np.ndarray:
    """How much longer than at rest each cable is (m)."""
    p_WN, cables = node_positions(structure, state), structure.cables
    lengths = np.linalg.norm(p_WN[cables["node_b"]] - p_WN[cables["node_a"]], axis=1)
    return lengths - cables["free_length"]
