"""When contact and friction modes change: the margin until then, and a prediction of the time."""

from __future__ import annotations

import math

import numpy as np

from tetra_drake.physics.contact import (
    CONTACT,
    Ground,
    Law,
    gap,
    law_of,
    meet_ground,
    modes_after_step,
    sliding,
)
from tetra_drake.physics.friction import STICK, Slide, coulomb_pull, coulomb_size, sticks
from tetra_drake.physics.kinematics import node_acceleration
from tetra_drake.physics.terrain import to_frame
from tetra_drake.simd.compiling import compiled, inlined
from tetra_drake.simd.lanes import Real, Table, Truth, any_lane, maximum, minimum, select

Array = np.ndarray


@compiled
def mode_margin(
    state: Array, modes: Array, p_BN: Array, ground: Ground, nodes: Array, frames: Array
) -> float:
    """Positive while no mode is due to change; crosses zero where the first one is.

    The least of: gap in the air, depth on the ground (m); with the reset integrator stiction range
    less deflection (m), and in slip speed in its direction (m/s); with Coulomb friction what is
    left of the limit, and in slip what exceeds it (N). Only its sign has a meaning. Writes `nodes`
    and `frames`.
    """
    meet_ground(state, p_BN, ground, nodes, frames)
    margin, law = math.inf, law_of(ground)
    for i in range(ground.contacts.size):
        distance = gap(nodes, ground, frames, i)
        if modes[i, CONTACT] == 0.0:
            margin = min(margin, distance)
            continue
        margin = min(margin, -distance)
        slide, _ = sliding(nodes, modes, ground, law, frames, i)
        (v_1, v_2), (x_1, x_2), (m_1, m_2) = slide.velocity, slide.deflection, slide.mode
        if not ground.coulomb:
            margin = min(margin, reset_margin(v_1, x_1, m_1, law))
            margin = min(margin, reset_margin(v_2, x_2, m_2, law))
            continue
        pull = coulomb_pull(slide, law)
        left, outward = pull.limit - pull.size, pull.u[0] * v_1 + pull.u[1] * v_2
        margin = min(margin, max(left, -outward) if sticks(slide.mode) else -left)
    return margin


@inlined
def reset_margin(velocity: float, deflection: float, mode: float, law: Law) -> float:
    """Mode margin along one tangent (reset integrator)."""
    return law.stiction_range - abs(deflection) if mode == STICK else mode * velocity


@inlined
def first_zero(value: Real, rate: Real, rate_rate: Real, horizon: Real) -> Real:
    """First time in (0, horizon) at which value + rate t + rate_rate t²/2 falls to zero;
    the horizon where it does not, or where the value is not positive now."""
    reach = horizon * (abs(rate) + 0.5 * horizon * abs(rate_rate))
    if not any_lane((value > 0.0) & (value <= reach)):
        return horizon
    discriminant = rate * rate - 2.0 * rate_rate * value
    # Twice the mean speed at which the value falls until it is zero.
    speed = math.sqrt(maximum(discriminant, 0.0)) - rate
    falls = (value > 0.0) & (discriminant >= 0.0) & (speed > 0.0)
    return select(falls, minimum(2.0 * value / select(falls, speed, 1.0), horizon), horizon)


@inlined
def time_to_mode_change(
    state: Table,
    acceleration: Table,
    nodes: Table,
    modes: Table,
    ground: Ground,
    frames: Table,
    horizon: Real,
) -> Real:
    """Time (s) to the next mode change, at most `horizon`, at constant node accelerations, over the
    local tangent plane.

    `acceleration` is dv/dt, 6 numbers per body, and `nodes` that of `state`; the other arguments
    are those of `add_ground_forces`.
    """
    time, law = horizon, law_of(ground)
    for i in range(ground.contacts.size):
        a_WN = node_acceleration(state, acceleration, nodes, ground.contacts[i])
        a_1, a_2, a_n = to_frame(a_WN[0], a_WN[1], a_WN[2], frames, i, ground.flat)
        slide, v_n = sliding(nodes, modes, ground, law, frames, i)
        touches, distance = modes[i, CONTACT] != 0.0, gap(nodes, ground, frames, i)
        up = select(touches, -1.0, 1.0)  # the way that leads to the ground's surface
        time = minimum(time, first_zero(up * distance, up * v_n, up * a_n, horizon))
        if not any_lane(touches):
            continue
        (v_1, v_2), (x_1, x_2), (m_1, m_2) = slide.velocity, slide.deflection, slide.mode
        if ground.coulomb:
            rate = law.damping * (v_n * v_n + distance * a_n) - law.stiffness * v_n
            rate = select(slide.normal > 0.0, rate, 0.0)
            change = time_to_coulomb_change(slide, (a_1, a_2), rate, law, horizon)
            time = select(touches, minimum(time, change), time)
        else:
            p_0 = law.stiction_range
            time = minimum(time, time_to_reset_change(v_1, x_1, m_1, a_1, touches, p_0, horizon))
            time = minimum(time, time_to_reset_change(v_2, x_2, m_2, a_2, touches, p_0, horizon))
    return time


@compiled
def next_mode_change(
    state: Array,
    acceleration: Array,
    modes: Array,
    p_BN: Array,
    ground: Ground,
    nodes: Array,
    frames: Array,
    horizon: float,
) -> tuple[bool, float]:
    """Whether a mode is due to change in a state of the bodies, and the time (s) to the next change
    after that, as time_to_mode_change() predicts it.

    Writes `nodes` and `frames`, and brings `modes` up to date.
    """
    due = modes_after_step(state, p_BN, ground, nodes, frames, modes)
    return due, time_to_mode_change(state, acceleration, nodes, modes, ground, frames, horizon)


@inlined
def time_to_reset_change(
    v: Real, x: Real, mode: Real, a: Real, touches: Truth, stiction_range: Real, horizon: Real
) -> Real:
    """That of the reset integrator along one tangent, on nodes that touch the ground; velocity,
    deflection, mode and acceleration are along it."""
    stuck, slips = touches & (mode == STICK), touches & (mode != STICK)
    # A value of 0 is never reached: it counts as no mode change.
    to_front = select(stuck, stiction_range - x, 0.0)
    to_back = select(stuck, stiction_range + x, 0.0)
    time = first_zero(to_front, -v, -a, horizon)
    time = minimum(time, first_zero(to_back, v, a, horizon))
    return minimum(time, first_zero(select(slips, mode * v, 0.0), mode * a, 0.0, horizon))


@inlined
def time_to_coulomb_change(
    slide: Slide, acceleration: tuple[Real, Real], rate: Real, law: Law, horizon: Real
) -> Real:
    """Time (s) until a node's pull crosses the limit of Coulomb friction, by its rate now.

    `acceleration` is along the tangents; `rate` (N/s) is that of the normal force.
    """
    pull, (v_1, v_2), stuck = coulomb_pull(slide, law), slide.velocity, sticks(slide.mode)
    k = select(stuck, law.bristle_stiffness, 0.0)
    u_1, u_2 = law.bristle_damping * acceleration[0], law.bristle_damping * acceleration[1]
    u_1, u_2 = u_1 + k * v_1, u_2 + k * v_2
    time = 1e-6  # s; the difference gives the rate of the pull's size
    later = coulomb_size((pull.u[0] + time * u_1, pull.u[1] + time * u_2), slide.heading, law)
    left = pull.limit - pull.size
    left_rate = select(stuck, law.static, law.kinetic) * rate - (later - pull.size) / time
    sign = select(stuck, 1.0, -1.0)
    return first_zero(sign * left, sign * left_rate, 0.0, horizon)
