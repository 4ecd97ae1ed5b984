"""The laws of friction of a node on the ground, in the plane that is tangent to it.

The reset integrator (Eq. 3-5) acts along each tangent by itself. Coulomb friction, regularised,
acts in the plane and is limited by the normal force. Which of them a ground has is asked at the end
of this module, and nowhere else.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from tetra_drake.simd.compiling import inlined
from tetra_drake.simd.lanes import (
    Real,
    Table,
    Truth,
    any_lane,
    maximum,
    minimum,
    named,
    select,
)

STICK = 0.0
"""The friction mode that sticks. One that slips is the direction in which the node broke free:
with the reset integrator +1 or -1 on each tangent, with Coulomb friction a unit vector."""

Pair = tuple[Real, Real]


class Slide(NamedTuple):
    """A node on the ground and in motion along it, by components along the tangents t1 and t2."""

    velocity: Pair
    """m/s."""
    deflection: Pair
    """Deflection from the stick point, m."""
    mode: Pair
    heading: Pair
    """Direction in which the node's body pointed at touchdown, a unit vector."""
    normal: Real
    """Normal force, N."""


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


# The reset integrator, along one tangent.


class ResetConstants(NamedTuple):
    """The constants of the reset integrator (Table 2), SI."""

    stiction_range: Real
    stiction_damping: Real
    stiction_switch: Real
    proportional_stiction: Real


@inlined
def reset_force(velocity: Real, deflection: Real, mode: Real, law: ResetConstants) -> Real:
    """Friction (N) along one tangent by the reset integrator (Eq. 3-5).

    `velocity` (m/s) is along the tangent and `deflection` (m) from the stick point; in slip
    the deflection is held at the stiction range, on the side the node slips to.
    """
    sigma_0 = law.proportional_stiction * abs(velocity)
    bristle = sigma_0 * (1.0 + law.stiction_switch) * deflection
    stick = -(bristle + law.stiction_damping * velocity)
    slip = -sigma_0 * law.stiction_range * mode
    return select(mode == STICK, stick, slip)


@inlined
def next_reset_mode(velocity: Real, deflection: Real, mode: Real, law: ResetConstants) -> Real:
    """The mode that follows `mode`: breaks free at the stiction range moving outward,
    sticks again when the velocity changes sign."""
    forward = (deflection >= law.stiction_range) & (velocity > 0.0)
    backward = (deflection <= -law.stiction_range) & (velocity < 0.0)
    from_stick = select(forward, 1.0, select(backward, -1.0, STICK))
    from_slip = select(mode * velocity > 0.0, mode, STICK)
    return select(mode == STICK, from_stick, from_slip)


@inlined
def reset_margin(velocity: float, deflection: float, mode: float, law: ResetConstants) -> float:
    """Mode margin along one tangent: in stick m, in slip m/s."""
    return law.stiction_range - abs(deflection) if mode == STICK else mode * velocity


@inlined
def time_to_reset_change(
    v: Real, x: Real, mode: Real, a: Real, touches: Truth, law: ResetConstants, horizon: Real
) -> Real:
    """Time (s) to the next mode change along one tangent; velocity, deflection, mode and
    acceleration are along it."""
    stuck, slips = touches & (mode == STICK), touches & (mode != STICK)
    # A value of 0 is never reached: it counts as no mode change.
    to_front = select(stuck, law.stiction_range - x, 0.0)
    to_back = select(stuck, law.stiction_range + x, 0.0)
    time = first_zero(to_front, -v, -a, horizon)
    time = minimum(time, first_zero(to_back, v, a, horizon))
    return minimum(time, first_zero(select(slips, mode * v, 0.0), mode * a, 0.0, horizon))


# Coulomb friction, in the plane.


class CoulombConstants(NamedTuple):
    """The constants of Coulomb friction, SI; of directional factors 1 / factor."""

    static: Real
    kinetic: Real
    stiffness: Real
    """Stiffness of the bristle."""
    damping: Real
    per_forward: Real
    per_backward: Real
    per_lateral: Real


class Pull(NamedTuple):
    """Pull at a node's bristle: u = c v, in stick + k x."""

    u: Pair
    """N."""
    size: Real
    """Size of u, N: its length where friction is the same in all directions."""
    limit: Real
    """Limit of the size, mu F_N."""


@inlined
def sticks(mode: Pair) -> Truth:
    """True if a mode of Coulomb friction sticks."""
    return (mode[0] == STICK) & (mode[1] == STICK)


@inlined
def coulomb_pull(slide: Slide, law: CoulombConstants) -> Pull:
    """The pull at the bristle. The directional factors make its size that of an ellipse, whose
    half-axis along the heading is `forward` or `backward` by the way u points."""
    stuck = sticks(slide.mode)
    k = select(stuck, law.stiffness, 0.0)
    u_1 = law.damping * slide.velocity[0] + k * slide.deflection[0]
    u_2 = law.damping * slide.velocity[1] + k * slide.deflection[1]
    size = coulomb_size((u_1, u_2), slide.heading, law)
    limit = select(stuck, law.static, law.kinetic) * slide.normal
    return Pull((u_1, u_2), size, limit)


@inlined
def coulomb_size(u: Pair, heading: Pair, law: CoulombConstants) -> Real:
    """The length of a vector, measured in directional factors."""
    along = u[0] * heading[0] + u[1] * heading[1]
    across = u[1] * heading[0] - u[0] * heading[1]
    along *= select(along > 0.0, law.per_forward, law.per_backward)
    across *= law.per_lateral
    return math.sqrt(along * along + across * across)


@inlined
def coulomb_force(slide: Slide, law: CoulombConstants) -> Pair:
    """Friction (N): -u, as far as the normal force allows."""
    pull = coulomb_pull(slide, law)
    share = select(pull.size > pull.limit, pull.limit / pull.size, 1.0)
    return -share * pull.u[0], -share * pull.u[1]


@inlined
def next_coulomb_mode(slide: Slide, law: CoulombConstants) -> Pair:
    """The mode that follows: breaks free beyond the static limit moving outward, and sticks again
    where its damping alone holds it."""
    pull, stuck = coulomb_pull(slide, law), sticks(slide.mode)
    (u_1, u_2), (v_1, v_2) = pull.u, slide.velocity
    beyond = pull.size > pull.limit
    breaks = stuck & beyond & (u_1 * v_1 + u_2 * v_2 > 0.0)
    length = math.sqrt(u_1 * u_1 + u_2 * u_2)
    return (
        select(breaks, u_1 / length, select(beyond, slide.mode[0], STICK)),
        select(breaks, u_2 / length, select(beyond, slide.mode[1], STICK)),
    )


@inlined
def coulomb_margin(slide: Slide, law: CoulombConstants) -> float:
    """Mode margin (N): in stick what is left of the limit, in slip what exceeds it."""
    pull, (v_1, v_2) = coulomb_pull(slide, law), slide.velocity
    left, outward = pull.limit - pull.size, pull.u[0] * v_1 + pull.u[1] * v_2
    return max(left, -outward) if sticks(slide.mode) else -left


@inlined
def time_to_coulomb_change(
    slide: Slide, acceleration: Pair, normal_rate: Real, law: CoulombConstants, horizon: Real
) -> Real:
    """Time (s) until a node's pull crosses the limit, by its rate now."""
    pull, (v_1, v_2), stuck = coulomb_pull(slide, law), slide.velocity, sticks(slide.mode)
    k = select(stuck, law.stiffness, 0.0)
    u_1, u_2 = law.damping * acceleration[0], law.damping * acceleration[1]
    u_1, u_2 = u_1 + k * v_1, u_2 + k * v_2
    time = 1e-6  # s; the difference gives the rate of the pull's size
    later = coulomb_size((pull.u[0] + time * u_1, pull.u[1] + time * u_2), slide.heading, law)
    left = pull.limit - pull.size
    left_rate = select(stuck, law.static, law.kinetic) * normal_rate - (later - pull.size) / time
    sign = select(stuck, 1.0, -1.0)
    return first_zero(sign * left, sign * left_rate, 0.0, horizon)


@inlined
def coulomb_damping(slide: Slide, time: Real, law: CoulombConstants) -> tuple[Real, Real, Real]:
    """-(time d/dv + time² d/dx) of the friction: its components 11, 12 and 22; time in s.

    Beyond the limit only the direction of the force changes (exact without directional factors).
    """
    pull = coulomb_pull(slide, law)
    k = select(sticks(slide.mode), time * law.stiffness, 0.0)
    slips = pull.size > pull.limit
    rate = time * (law.damping + k) * select(slips, pull.limit / pull.size, 1.0)
    u_1, u_2 = pull.u
    per_square = select(slips, rate / (u_1 * u_1 + u_2 * u_2), 0.0)
    return rate - per_square * u_1 * u_1, -per_square * u_1 * u_2, rate - per_square * u_2 * u_2


# The law of a ground.

RESET_INTEGRATOR, COULOMB = range(2)


class FrictionLaw(NamedTuple):
    """A law of friction and its constants."""

    kind: int
    """RESET_INTEGRATOR or COULOMB."""
    constants: Table
    """(constants,): those of the law, in its order."""

    @classmethod
    def reset_integrator(cls, constants: ResetConstants) -> FrictionLaw:
        """The reset integrator."""
        return cls(RESET_INTEGRATOR, np.array(constants))

    @classmethod
    def coulomb(cls, constants: CoulombConstants) -> FrictionLaw:
        """Coulomb friction."""
        return cls(COULOMB, np.array(constants))


@inlined
def friction_force(slide: Slide, friction: FrictionLaw) -> Pair:
    """Friction (N) along the tangents on a node that touches the ground."""
    if friction.kind == COULOMB:
        return coulomb_force(slide, named(CoulombConstants, friction.constants))
    law = named(ResetConstants, friction.constants)
    (v_1, v_2), (x_1, x_2), (m_1, m_2) = slide.velocity, slide.deflection, slide.mode
    return reset_force(v_1, x_1, m_1, law), reset_force(v_2, x_2, m_2, law)


@inlined
def friction_damping(slide: Slide, time: Real, friction: FrictionLaw) -> tuple[Real, Real, Real]:
    """-(time d/dv + time² d/dx) of the friction as far as it is stiff: its components 11, 12 and
    22; time in s."""
    if friction.kind == COULOMB:
        return coulomb_damping(slide, time, named(CoulombConstants, friction.constants))
    damping = time * named(ResetConstants, friction.constants).stiction_damping
    m_1, m_2 = slide.mode
    return select(m_1 == STICK, damping, 0.0), 0.0 * damping, select(m_2 == STICK, damping, 0.0)


@inlined
def stuck_along(mode: Pair, friction: FrictionLaw) -> tuple[Truth, Truth]:
    """True along each tangent on which a mode sticks."""
    if friction.kind == COULOMB:
        return sticks(mode), sticks(mode)
    return mode[0] == STICK, mode[1] == STICK


@inlined
def next_mode(slide: Slide, friction: FrictionLaw) -> Pair:
    """The mode that follows on a node that stays on the ground."""
    if friction.kind == COULOMB:
        return next_coulomb_mode(slide, named(CoulombConstants, friction.constants))
    law = named(ResetConstants, friction.constants)
    (v_1, v_2), (x_1, x_2), (m_1, m_2) = slide.velocity, slide.deflection, slide.mode
    return next_reset_mode(v_1, x_1, m_1, law), next_reset_mode(v_2, x_2, m_2, law)


@inlined
def friction_margin(slide: Slide, friction: FrictionLaw) -> float:
    """Positive while the mode is not due to change, zero where it is; only its sign has a
    meaning."""
    if friction.kind == COULOMB:
        return coulomb_margin(slide, named(CoulombConstants, friction.constants))
    law = named(ResetConstants, friction.constants)
    (v_1, v_2), (x_1, x_2), (m_1, m_2) = slide.velocity, slide.deflection, slide.mode
    return min(reset_margin(v_1, x_1, m_1, law), reset_margin(v_2, x_2, m_2, law))


@inlined
def time_to_friction_change(
    slide: Slide,
    acceleration: Pair,
    normal_rate: Real,
    touches: Truth,
    friction: FrictionLaw,
    horizon: Real,
) -> Real:
    """Time (s) to the next mode change, at most `horizon`, of nodes that touch the ground.

    `acceleration` is along the tangents; `normal_rate` (N/s) is that of the normal force.
    """
    if friction.kind == COULOMB:
        coulomb = named(CoulombConstants, friction.constants)
        time = time_to_coulomb_change(slide, acceleration, normal_rate, coulomb, horizon)
        return select(touches, time, horizon)
    law = named(ResetConstants, friction.constants)
    (v_1, v_2), (x_1, x_2), (m_1, m_2) = slide.velocity, slide.deflection, slide.mode
    a_1, a_2 = acceleration
    return minimum(
        time_to_reset_change(v_1, x_1, m_1, a_1, touches, law, horizon),
        time_to_reset_change(v_2, x_2, m_2, a_2, touches, law, horizon),
    )
