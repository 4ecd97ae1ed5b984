"""The laws of friction of a node, against their equations."""

import math

import numpy as np
import pytest

from tetra_drake.laws.friction import (
    STICK,
    CoulombConstants,
    ResetConstants,
    Slide,
    TangentSlide,
    coulomb_damping,
    coulomb_force,
    next_coulomb_mode,
    next_reset_mode,
    reset_force,
    tangent_force,
)

# The reset integrator, along one tangent.

P0, SIGMA_1, A_C, SIGMA_0 = 1e-4, 70.0, 0.7, 2000.0
OLSSON = 50.0  # N/m, of a bristle with stiffness
OTHERS = {"stiffness": 0.0, "kept": 0.0, "restarts": 0.0, "joint": 0.0, "per_load": 0.0}
RESET = ResetConstants(P0, SIGMA_1, A_C, SIGMA_0, **OTHERS)


@pytest.mark.parametrize("velocity", [-0.02, 0.02])
@pytest.mark.parametrize("stiffness", [0.0, OLSSON])
@pytest.mark.parametrize("share", [0.5, -0.9])
def test_reset_friction_is_equation_5_with_the_absolute_speed(velocity, stiffness, share):
    law, per_length = RESET._replace(stiffness=stiffness), stiffness + SIGMA_0 * 0.02
    sticking = tangent_force(TangentSlide(velocity, share * P0, STICK), law)
    expected = -(per_length * (1.0 + A_C) * share * P0 + SIGMA_1 * velocity)
    assert sticking == pytest.approx(expected, rel=1e-14)
    # In slip x is held at +-p0: the force opposes a slip in the direction of the mode.
    mode = math.copysign(1.0, share)
    slipping = tangent_force(TangentSlide(velocity, 12.3, mode), law)
    assert slipping == pytest.approx(-mode * per_length * P0, rel=1e-14)


def test_friction_is_proportional_to_the_load_where_a_load_is_given():
    pushed = slide(v=(0.02, -0.01), x=(0.5 * P0, 0.0))
    force = np.array(reset_force(pushed, RESET))
    at_twice_the_load = reset_force(pushed, RESET._replace(per_load=2.0 / NORMAL))
    assert np.array(at_twice_the_load) == pytest.approx(2.0 * force, rel=1e-14)


RESETS = [(0.01, 0.99 * P0, STICK, STICK), (0.01, P0, STICK, 1.0)]
RESETS += [(-0.01, P0, STICK, STICK)]  # beyond the range, but moving inward
RESETS += [(-0.01, -P0, STICK, -1.0), (-0.01, 5.0, 1.0, STICK), (-0.01, -5.0, -1.0, -1.0)]
RESETS += [(0.01, -5.0, -1.0, STICK)]


@pytest.mark.parametrize(("velocity", "deflection", "mode", "after"), RESETS)
def test_breaks_free_at_the_range_and_sticks_at_a_reversal(velocity, deflection, mode, after):
    moving = slide(v=(0.0, velocity), x=(0.0, deflection), mode=(STICK, mode))
    assert next_reset_mode(moving, RESET).mode == (STICK, after)


def test_a_joint_law_breaks_free_along_both_tangents_and_holds_each_deflection():
    moving = slide(v=(0.01, -0.01), x=(P0, -0.25 * P0))
    assert next_reset_mode(moving, RESET).mode == (1.0, STICK)
    assert next_reset_mode(moving, RESET._replace(joint=1.0)).mode == (1.0, -0.25)
    inward = slide(v=(0.01, 0.01), x=(P0, -0.25 * P0))
    assert next_reset_mode(inward, RESET._replace(joint=1.0)).mode == (1.0, STICK)


def test_the_deflection_starts_again_at_the_range_or_is_kept_at_a_reversal():
    at_range, reversed_slip = slide(v=(0.01, 0.0), x=(P0, 0.0)), slide(v=(-0.01, 0.0), mode=(1, 0))
    due = next_reset_mode(at_range, RESET._replace(restarts=1.0))
    assert due.mode == (STICK, STICK) and due.begins == (True, False)
    for law, kept in ((RESET, 0.0), (RESET._replace(kept=1.0), P0)):
        due = next_reset_mode(reversed_slip, law)
        assert due.begins == (True, False) and due.bend == (kept, 0.0)


# Coulomb friction.

C, K, STATIC, KINETIC, NORMAL = 70.0, 1000.0, 0.6, 0.5, 0.2
ALONG_X = (1.0, 0.0)


SAME = {"per_forward": 1.0, "per_backward": 1.0, "per_lateral": 1.0}  # in all directions
LAW = CoulombConstants(static=STATIC, kinetic=KINETIC, stiffness=K, damping=C, **SAME)


def slide(v=(0.0, 0.0), x=(0.0, 0.0), mode=(0.0, 0.0), heading=ALONG_X) -> Slide:
    # Of NumPy's numbers, which may be divided by zero, as in a kernel.
    t1, t2 = (TangentSlide(*np.array([v[i], x[i], mode[i]])) for i in range(2))
    return Slide(t1, t2, heading, np.float64(NORMAL))


@pytest.mark.parametrize(("mode", "coefficient"), [((0.0, 0.0), STATIC), ((0.6, 0.8), KINETIC)])
@pytest.mark.parametrize("angle", [0.0, 1.0, 2.5])
def test_the_force_is_limited_by_the_load_and_opposes_the_motion(mode, coefficient, angle):
    v = 0.05 * math.cos(angle), 0.05 * math.sin(angle)
    force = coulomb_force(slide(v=v, mode=mode), LAW)
    expected = [-coefficient * NORMAL * each / 0.05 for each in v]
    assert force == pytest.approx(expected, rel=1e-12)


def test_slow_slip_is_viscous_and_forgets_the_bristle():
    # c v = 0.07 N < 0.5 * 0.2 N
    force = coulomb_force(slide(v=(1e-3, 0.0), x=(1.0, 1.0), mode=ALONG_X), LAW)
    assert force == pytest.approx((-0.07, 0.0), rel=1e-12)


SLIPS = [((1e-4, 0.0), (1e-4, 0.0), (0.0, 0.0), (0.0, 0.0))]  # 0.107 N < 0.6 * 0.2 N
SLIPS += [((3e-4, 0.0), (1e-4, 0.0), (0.0, 0.0), (1.0, 0.0))]  # 0.121 N
SLIPS += [((-1e-4, 0.0), (2e-4, 0.0), (0.0, 0.0), (0.0, 0.0))]  # 0.193 N, but moving back
SLIPS += [((1.5e-3, 0.0), (9.0, 9.0), (1.0, 0.0), (1.0, 0.0))]  # 0.105 N > 0.5 * 0.2 N: slips on
SLIPS += [((0.0, 1.5e-3), (9.0, 9.0), (1.0, 0.0), (1.0, 0.0))]  # whichever way
SLIPS += [((1.4e-3, 0.0), (9.0, 9.0), (1.0, 0.0), (0.0, 0.0))]  # 0.098 N: the damping holds it
SLIPS += [((0.0, 0.0), (9.0, 9.0), (1.0, 0.0), (0.0, 0.0))]


@pytest.mark.parametrize(("v", "x", "before", "after"), SLIPS)
def test_breaks_free_beyond_the_static_limit_and_sticks_below_the_kinetic_one(v, x, before, after):
    with np.errstate(invalid="ignore"):  # a pull of 0 has no direction, and none is chosen
        mode = next_coulomb_mode(slide(v=v, x=x, mode=before), LAW).mode
    assert mode == pytest.approx(after, abs=1e-15)


@pytest.mark.parametrize("mode", [(0.0, 0.0), (0.8, 0.6)])
@pytest.mark.parametrize("v", [(3e-4, -2e-4), (0.02, 0.01)])
def test_the_damping_is_the_derivative_of_the_force(mode, v):
    time, h, x = 1e-3, 1e-9, (2e-5, 1e-5)

    def force(dv: np.ndarray, dx: np.ndarray) -> np.ndarray:
        moved = slide(v=tuple(np.array(v) + dv), x=tuple(np.array(x) + dx), mode=mode)
        return np.array(coulomb_force(moved, LAW))

    zero, expected = np.zeros(2), np.zeros((2, 2))
    for i, step in enumerate(h * np.eye(2)):
        by_velocity = (force(step, zero) - force(-step, zero)) / (2 * h)
        by_deflection = (force(zero, step) - force(zero, -step)) / (2 * h)
        expected[:, i] = -(time * by_velocity + time**2 * by_deflection)
    a, b, c = coulomb_damping(slide(v=v, x=x, mode=mode), time, LAW)
    np.testing.assert_allclose([[a, b], [b, c]], expected, atol=1e-6 * time * C)
