"""The motion of bodies."""

import numpy as np

from tetra_drake.physics.kinematics import move_bodies


def test_bodies_turn_as_drakes_quaternions_do():
    # A turn by angle w t about z: quaternion (cos(w t / 2), 0, 0, sin(w t / 2)).
    state = np.append(1.0, np.zeros(12))
    moved = np.empty(13)
    move_bodies(state, np.array([0.0, 0.0, 3.0, 0.1, 0.2, 0.3]), 0.01, moved)
    np.testing.assert_allclose(moved[:4], [np.cos(0.015), 0, 0, np.sin(0.015)], atol=1e-11)
    np.testing.assert_allclose(moved[4:7], [1e-3, 2e-3, 3e-3], atol=1e-18)
