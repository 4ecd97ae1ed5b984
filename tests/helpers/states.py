"""States of the robot to test forces and rates on."""

import numpy as np

from tetra_drake.robot.structure import Structure


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
