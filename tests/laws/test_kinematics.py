"""The motion of bodies between two states."""

import numpy as np
import pytest

from tetra_drake.laws.kinematics import interpolate_state


@pytest.mark.parametrize("part", [0.0, 0.3, 0.8, 1.0])
def test_between_two_states_bodies_move_by_cubic_polynomials_and_turn_steadily(part):
    step = 0.01
    turn_rates = np.array([[3.0, -2.0, 1.0], [0.5, 4.0, -6.0]])  # (bodies, axis), rad/s
    shift = (
        np.random.default_rng(3).normal(size=(4, 2, 3)) * np.array([1, 1, 10, 1e3])[:, None, None]
    )

    def state_at(time):
        powers, rates = time ** np.arange(4), np.array([0, 1, 2 * time, 3 * time**2])
        positions, velocities = (np.tensordot(x, shift, 1) for x in (powers, rates))
        speeds = np.linalg.norm(turn_rates, axis=1, keepdims=True)
        angles, axes = 0.5 * time * speeds, turn_rates / speeds
        poses = np.hstack([np.cos(angles), np.sin(angles) * axes, positions])
        return np.append(poses, np.hstack([turn_rates, velocities]))

    before, exact, after = (state_at(x * step) for x in (0.0, part, 1.0))
    found = interpolate_state(before, after, step, part)
    np.testing.assert_allclose(found[:14], exact[:14], rtol=0, atol=1e-9)
    linear = (1.0 - part) * before[14:] + part * after[14:]
    np.testing.assert_allclose(found[14:], linear, rtol=0, atol=1e-14)
