"""The laws of friction of a node on the ground, in the plane that is tangent to it.

With v the velocity and x the deflection from the stick point, the reset integrator (Eq. 3-5) acts
along each tangent by itself:

    in stick  F = -(sigma_0 |v| (1 + a_c) x + sigma_1 v)
    in slip   F = -sigma_0 |v| x, where x is held at p0 or -p0

A node breaks free where |x| >= p0 moving outward. It sticks again, with x = 0, where v changes
sign.

Coulomb friction, regularised, acts in the plane and is limited by the normal force F_N:

    u = c v + k x, with x in stick only
    F = -u min(1, mu F_N / s(u)), with mu static in stick and kinetic in slip
    s(u) = sqrt((u_f / a_f)^2 + (u_l / a_l)^2)

u_f is along the body's heading at touchdown, where a_f is `forward` or `backward` by the sign of
u_f. u_l is sideways, where a_l is `lateral`. A node breaks free where s(u) > static F_N moving
outward. It sticks again, with x = 0, where s(c v) <= kinetic F_N. With k = 0 and static = kinetic
the law has no memory: it is MuJoCo's soft friction.

A node on the ground sticks or slips: its *mode* is STICK, or the direction in which it broke free.
With the reset integrator that is +1 or -1 on each tangent, with Coulomb friction a unit vector. A
node that sticks may creep, as its bristle bends. Modes are constant within a step of an integrator,
so forces are smooth there; they change at its end. A law without stiction always sticks.

Both laws have the same functions of a Slide: force, damping, stuck, next mode, margin and time to
the next change. The last section calls those of a ground's law. A further law takes its constants,
these functions, and a branch in each function of that section.
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
    not_,
    select,
)

STICK = 0.0
"""The mode of a node that sticks."""

Pair = tuple[Real, Real]
"""Components along the tangents t1 and t2."""


class TangentSlide(NamedTuple):
    """A node's slide along one tangent."""

    velocity: Real
    """m/s."""
    deflection: Real
    """Deflection from the stick point, m."""
    mode: Real


class Slide(NamedTuple):
    """A node on the ground, in motion along it."""

    t1: TangentSlide
    t2: TangentSlide
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


# The reset integrator: one law along each tangent.


class ResetConstants(NamedTuple):
    """The constants of the reset integrator (Table 2), SI."""

    stiction_range: Real
    stiction_damping: Real
    stiction_switch: Real
    proportional_stiction: Real


@inlined
def reset_force(slide: Slide, law: ResetConstants) -> Pair:
    """Friction (N) by the reset integrator (Eq. 3-5)."""
    return tangent_force(slide.t1, law), tangent_force(slide.t2, law)


@inlined
def tangent_force(slide: TangentSlide, law: ResetConstants) -> Real:
    """Friction (N) along one tangent; in slip the deflection is held at the stiction range, on the
    side the node slips to."""
    sigma_0 = law.proportional_stiction * abs(slide.velocity)
    bristle = sigma_0 * (1.0 + law.stiction_switch) * slide.deflection
    stick = -(bristle + law.stiction_damping * slide.velocity)
    slip = -sigma_0 * law.stiction_range * slide.mode
    return select(slide.mode == STICK, stick, slip)


@inlined
def reset_damping(slide: Slide, time: Real, law: ResetConstants) -> tuple[Real, Real, Real]:
    """Stiff part of -(time d/dv + time² d/dx) of the friction, the damping in stick: its components
    11, 12 and 22."""
    damping = time * law.stiction_damping
    along_1 = select(slide.t1.mode == STICK, damping, 0.0)
    along_2 = select(slide.t2.mode == STICK, damping, 0.0)
    return along_1, 0.0 * damping, along_2


@inlined
def next_reset_mode(slide: Slide, law: ResetConstants) -> Pair:
    """The mode that follows on each tangent."""
    return next_tangent_mode(slide.t1, law), next_tangent_mode(slide.t2, law)


@inlined
def next_tangent_mode(slide: TangentSlide, law: ResetConstants) -> Real:
    """The mode that follows on one tangent: breaks free at the stiction range moving outward,
    sticks again when the velocity changes sign."""
    forward = (slide.deflection >= law.stiction_range) & (slide.velocity > 0.0)
    backward = (slide.deflection <= -law.stiction_range) & (slide.velocity < 0.0)
    from_stick = select(forward, 1.0, select(backward, -1.0, STICK))
    from_slip = select(slide.mode * slide.velocity > 0.0, slide.mode, STICK)
    return select(slide.mode == STICK, from_stick, from_slip)


@inlined
def reset_margin(slide: Slide, law: ResetConstants) -> float:
    """Mode margin, the lesser of the two tangents'."""
    return min(tangent_margin(slide.t1, law), tangent_margin(slide.t2, law))


@inlined
def tangent_margin(slide: TangentSlide, law: ResetConstants) -> float:
    """Mode margin along one tangent: in stick m, in slip m/s."""
    if slide.mode == STICK:
        return law.stiction_range - abs(slide.deflection)
    return slide.mode * slide.velocity


@inlined
def time_to_reset_change(
    slide: Slide, acceleration: Pair, law: ResetConstants, horizon: Real
) -> Real:
    """Time (s) to the next mode change on either tangent."""
    return minimum(
        time_to_tangent_change(slide.t1, acceleration[0], law, horizon),
        time_to_tangent_change(slide.t2, acceleration[1], law, horizon),
    )


@inlined
def time_to_tangent_change(
    slide: TangentSlide, acceleration: Real, law: ResetConstants, horizon: Real
) -> Real:
    """Time (s) to the next mode change on one tangent."""
    velocity, stuck = slide.velocity, slide.mode == STICK
    # A value of 0 is never reached: it counts as no mode change.
    to_front = select(stuck, law.stiction_range - slide.deflection, 0.0)
    to_back = select(stuck, law.stiction_range + slide.deflection, 0.0)
    to_rest = select(stuck, 0.0, slide.mode * velocity)
    time = first_zero(to_front, -velocity, -acceleration, horizon)
    time = minimum(time, first_zero(to_back, velocity, acceleration, horizon))
    return minimum(time, first_zero(to_rest, slide.mode * acceleration, 0.0, horizon))


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


class BristleForce(NamedTuple):
    """The force u at a node's bristle: c v, in stick + k x. Friction is -u within the limit."""

    u_1: Real
    """N; along t1, and next along t2."""
    u_2: Real
    size: Real
    """Size of u, N: its length where friction is the same in all directions."""
    limit: Real
    """Limit of the size, mu F_N."""
    stuck: Truth


@inlined
def coulomb_sticks(mode: Pair) -> Truth:
    """True if a mode of Coulomb friction sticks."""
    return (mode[0] == STICK) & (mode[1] == STICK)


@inlined
def bristle_force(slide: Slide, law: CoulombConstants) -> BristleForce:
    """The force at the bristle of a node."""
    stuck = coulomb_sticks((slide.t1.mode, slide.t2.mode))
    stiffness = select(stuck, law.stiffness, 0.0)
    u_1 = law.damping * slide.t1.velocity + stiffness * slide.t1.deflection
    u_2 = law.damping * slide.t2.velocity + stiffness * slide.t2.deflection
    size = coulomb_size(u_1, u_2, slide.heading, law)
    limit = select(stuck, law.static, law.kinetic) * slide.normal
    return BristleForce(u_1, u_2, size, limit, stuck)


@inlined
def coulomb_size(u_1: Real, u_2: Real, heading: Pair, law: CoulombConstants) -> Real:
    """The length of a vector, measured in directional factors: vectors of the same size are on an
    ellipse, whose half-axis along the heading is `forward` or `backward` by the way they point."""
    along = u_1 * heading[0] + u_2 * heading[1]
    across = u_2 * heading[0] - u_1 * heading[1]
    along *= select(along > 0.0, law.per_forward, law.per_backward)
    across *= law.per_lateral
    return math.sqrt(along * along + across * across)


@inlined
def coulomb_force(slide: Slide, law: CoulombConstants) -> Pair:
    """Friction (N): -u, as far as the normal force allows."""
    bristle = bristle_force(slide, law)
    share = select(bristle.size > bristle.limit, bristle.limit / bristle.size, 1.0)
    return -share * bristle.u_1, -share * bristle.u_2


@inlined
def coulomb_damping(slide: Slide, time: Real, law: CoulombConstants) -> tuple[Real, Real, Real]:
    """-(time d/dv + time² d/dx) of the friction: its components 11, 12 and 22.

    Beyond the limit only the direction of the force changes (exact without directional factors).
    """
    bristle = bristle_force(slide, law)
    stiffness = select(bristle.stuck, time * law.stiffness, 0.0)
    slips = bristle.size > bristle.limit
    rate = time * (law.damping + stiffness) * select(slips, bristle.limit / bristle.size, 1.0)
    u_1, u_2 = bristle.u_1, bristle.u_2
    per_square = select(slips, rate / (u_1 * u_1 + u_2 * u_2), 0.0)
    return rate - per_square * u_1 * u_1, -per_square * u_1 * u_2, rate - per_square * u_2 * u_2


@inlined
def next_coulomb_mode(slide: Slide, law: CoulombConstants) -> Pair:
    """The mode that follows: breaks free beyond the static limit moving outward, and sticks again
    where its damping alone holds it."""
    bristle = bristle_force(slide, law)
    u_1, u_2 = bristle.u_1, bristle.u_2
    beyond = bristle.size > bristle.limit
    breaks = bristle.stuck & beyond & (u_1 * slide.t1.velocity + u_2 * slide.t2.velocity > 0.0)
    # A sum of products would be rounded differently in one lane and in several.
    square_1, square_2 = select(breaks, u_1 * u_1, 1.0), select(breaks, u_2 * u_2, 0.0)
    length = math.sqrt(square_1 + square_2)
    return (
        select(breaks, u_1 / length, select(beyond, slide.t1.mode, STICK)),
        select(breaks, u_2 / length, select(beyond, slide.t2.mode, STICK)),
    )


@inlined
def coulomb_margin(slide: Slide, law: CoulombConstants) -> float:
    """Mode margin (N): in stick what is left of the limit, in slip what exceeds it."""
    bristle = bristle_force(slide, law)
    if not bristle.stuck:
        return bristle.size - bristle.limit
    outward = bristle.u_1 * slide.t1.velocity + bristle.u_2 * slide.t2.velocity
    return max(bristle.limit - bristle.size, -outward)


@inlined
def time_to_coulomb_change(
    slide: Slide, acceleration: Pair, normal_rate: Real, law: CoulombConstants, horizon: Real
) -> Real:
    """Time (s) until the force at a node's bristle crosses the limit, by its rate now."""
    bristle = bristle_force(slide, law)
    stiffness = select(bristle.stuck, law.stiffness, 0.0)
    rate_1 = law.damping * acceleration[0] + stiffness * slide.t1.velocity
    rate_2 = law.damping * acceleration[1] + stiffness * slide.t2.velocity
    time = 1e-6  # s; the difference gives the rate of the force's size
    u_1, u_2 = bristle.u_1 + time * rate_1, bristle.u_2 + time * rate_2
    size_rate = (coulomb_size(u_1, u_2, slide.heading, law) - bristle.size) / time
    limit_rate = select(bristle.stuck, law.static, law.kinetic) * normal_rate
    sign = select(bristle.stuck, 1.0, -1.0)
    room, room_rate = bristle.limit - bristle.size, limit_rate - size_rate
    return first_zero(sign * room, sign * room_rate, 0.0, horizon)


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
    return reset_force(slide, named(ResetConstants, friction.constants))


@inlined
def friction_damping(slide: Slide, time: Real, friction: FrictionLaw) -> tuple[Real, Real, Real]:
    """-(time d/dv + time² d/dx) of the friction as far as it is stiff: its components 11, 12 and
    22; time in s."""
    if friction.kind == COULOMB:
        return coulomb_damping(slide, time, named(CoulombConstants, friction.constants))
    return reset_damping(slide, time, named(ResetConstants, friction.constants))


@inlined
def stuck_along(mode: Pair, friction: FrictionLaw) -> tuple[Truth, Truth]:
    """True along each tangent on which a mode sticks."""
    if friction.kind == COULOMB:
        stuck = coulomb_sticks(mode)
        return stuck, stuck
    return mode[0] == STICK, mode[1] == STICK


@inlined
def begins_to_stick(before: Pair, after: Pair, friction: FrictionLaw) -> tuple[Truth, Truth]:
    """True along each tangent on which a mode sticks that did not stick before."""
    stuck_1, stuck_2 = stuck_along(before, friction)
    sticks_1, sticks_2 = stuck_along(after, friction)
    return sticks_1 & not_(stuck_1), sticks_2 & not_(stuck_2)


@inlined
def next_mode(slide: Slide, stays: Truth, friction: FrictionLaw) -> Pair:
    """The mode that follows on a node that `stays` on the ground; STICK on any other."""
    if friction.kind == COULOMB:
        after_1, after_2 = next_coulomb_mode(slide, named(CoulombConstants, friction.constants))
    else:
        after_1, after_2 = next_reset_mode(slide, named(ResetConstants, friction.constants))
    return select(stays, after_1, STICK), select(stays, after_2, STICK)


@inlined
def friction_margin(slide: Slide, friction: FrictionLaw) -> float:
    """Mode margin of a node on the ground: positive while no change is due, zero where one is. Only
    its sign has a meaning."""
    if friction.kind == COULOMB:
        return coulomb_margin(slide, named(CoulombConstants, friction.constants))
    return reset_margin(slide, named(ResetConstants, friction.constants))


@inlined
def time_to_friction_change(
    slide: Slide, acceleration: Pair, normal_rate: Real, friction: FrictionLaw, horizon: Real
) -> Real:
    """Time (s) to the next mode change, at most `horizon`, of a node on the ground.

    `acceleration` is along the tangents; `normal_rate` (N/s) is that of the normal force.
    """
    if friction.kind == COULOMB:
        law = named(CoulombConstants, friction.constants)
        return time_to_coulomb_change(slide, acceleration, normal_rate, law, horizon)
    return time_to_reset_change(
        slide, acceleration, named(ResetConstants, friction.constants), horizon
    )
