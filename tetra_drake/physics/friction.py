"""Laws of friction for a node on the ground, in the tangent plane of the ground.

The velocity is v, the deflection from the stick point x. The reset integrator (Eq. 3-5) acts along
each tangent independently:

    in stick  F = -(s (1 + a_c) x + sigma_1 v), with s = k + sigma_0 |v|
    in slip   F = -s x, with x constant at p0 or -p0

A node breaks free at |x| >= p0 if it moves outward. It sticks again, with x = 0, when v changes
sign. The thesis's bristle has no stiffness k.

Settings change this law. At p0, x can become 0, and the node sticks again at once. When v changes
sign, x can stay what it is. A node that breaks free along one tangent can break free along both,
and x stays what it is along the other. F can be proportional to the normal force.

Coulomb friction acts in the plane, regularised by a bristle. The normal force F_N limits it:

    u = c v + k x in stick, c v in slip
    F = -u min(1, mu F_N / s(u)), with mu static in stick and kinetic in slip
    s(u) = sqrt((u_f / a_f)^2 + (u_l / a_l)^2)

The component u_f is along the body's heading at touchdown; a_f is `forward` or `backward`,
depending on the sign of u_f. The component u_l is sideways; a_l is `lateral`. A node breaks free at
s(u) > static F_N if it moves outward. It sticks again, with x = 0, at s(c v) <= kinetic F_N. With k
= 0 and static = kinetic the law has no memory: it is MuJoCo's soft friction.

A node on the ground sticks or slips. Its *mode* is STICK, or the direction of its slip when it
broke free: +1 or -1 along each tangent for the reset integrator, a unit vector for Coulomb
friction. A node that sticks may creep, because its bristle bends. Modes are constant within a step
of an integrator, so forces are smooth there. Modes change at the end of a step. With a law without
stiction, nodes always stick.

Both laws have the same functions of a Slide: force, damping, stuck, next mode, margin, and time to
the next change. The functions in the last section choose the law of the ground. A further law needs
constants, these functions, and a branch in each function of the last section.
"""

from __future__ import annotations

import math
from typing import NamedTuple, Self

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
"""Friction mode of a node that sticks."""

Pair = tuple[Real, Real]
"""Components along the tangents t1 and t2."""


class TangentSlide(NamedTuple):
    """Motion of a node along one tangent."""

    velocity: Real
    """Velocity in m/s."""
    deflection: Real
    """Distance from the stick point in m."""
    mode: Real


class Slide(NamedTuple):
    """Motion of a node along the ground, and the normal force on it."""

    t1: TangentSlide
    t2: TangentSlide
    heading: Pair
    """Direction of the node's body at touchdown, a unit vector."""
    normal: Real
    """Normal force in N."""


@inlined
def first_zero(value: Real, rate: Real, rate_rate: Real, horizon: Real) -> Real:
    """First time t in (0, horizon) at which value + rate t + rate_rate t²/2 falls to zero.

    The horizon if there is no such time, or if `value` is not positive.
    """
    reach = horizon * (abs(rate) + 0.5 * horizon * abs(rate_rate))
    if not any_lane((value > 0.0) & (value <= reach)):
        return horizon
    discriminant = rate * rate - 2.0 * rate_rate * value
    # Twice the mean speed of the fall to zero.
    speed = math.sqrt(maximum(discriminant, 0.0)) - rate
    falls = (value > 0.0) & (discriminant >= 0.0) & (speed > 0.0)
    return select(falls, minimum(2.0 * value / select(falls, speed, 1.0), horizon), horizon)


# Reset integrator: a law along each tangent.


class ResetConstants(NamedTuple):
    """Constants of the reset integrator (Table 2); SI units."""

    stiction_range: Real
    stiction_damping: Real
    stiction_switch: Real
    proportional_stiction: Real
    stiffness: Real
    """Stiffness k of the bristle."""
    kept: Real
    """Share of the deflection that remains when a node sticks again: 0 or 1."""
    restarts: Real
    """1 if the deflection becomes 0 at the stiction range and the node sticks, otherwise 0."""
    joint: Real
    """1 if a node breaks free along both tangents, otherwise 0."""
    per_load: Real
    """Factor on the friction per normal force (1/N); 0 if friction is independent of the load."""


@inlined
def reset_force(slide: Slide, law: ResetConstants) -> Pair:
    """Friction (N) of the reset integrator (Eq. 3-5)."""
    force_1, force_2 = tangent_force(slide.t1, law), tangent_force(slide.t2, law)
    if not any_lane(law.per_load > 0.0):
        return force_1, force_2
    factor = load_factor(slide, law)
    return factor * force_1, factor * force_2


@inlined
def load_factor(slide: Slide, law: ResetConstants) -> Real:
    """Factor of the load on the friction of the reset integrator."""
    return select(law.per_load > 0.0, law.per_load * slide.normal, 1.0)


@inlined
def tangent_force(slide: TangentSlide, law: ResetConstants) -> Real:
    """Friction (N) of the reset integrator along one tangent. In slip, the deflection is the
    stiction range times the mode."""
    per_length = law.stiffness + law.proportional_stiction * abs(slide.velocity)
    bristle = per_length * (1.0 + law.stiction_switch) * slide.deflection
    stick = -(bristle + law.stiction_damping * slide.velocity)
    slip = -per_length * law.stiction_range * slide.mode
    return select(slide.mode == STICK, stick, slip)


@inlined
def reset_damping(slide: Slide, time: Real, law: ResetConstants) -> tuple[Real, Real, Real]:
    """Stiff part of -(time d/dv + time² d/dx) of the friction: components 11, 12 and 22. For the
    reset integrator these are damping and stiffness in stick."""
    stiffness = time * law.stiffness * (1.0 + law.stiction_switch)
    damping = time * (law.stiction_damping + stiffness) * load_factor(slide, law)
    along_1 = select(slide.t1.mode == STICK, damping, 0.0)
    along_2 = select(slide.t2.mode == STICK, damping, 0.0)
    return along_1, 0.0 * damping, along_2


@inlined
def next_reset_mode(slide: Slide, law: ResetConstants) -> Pair:
    """Next mode along each tangent; see next_tangent_mode()."""
    slips = law.restarts == 0.0
    breaks_1, breaks_2 = at_range(slide.t1, law) & slips, at_range(slide.t2, law) & slips
    share_1 = share_2 = 0.0 * law.joint
    if any_lane(law.joint != 0.0):  # deflections that are held along the other tangent
        per_range = law.joint / law.stiction_range
        share_1 = select(breaks_2, per_range * slide.t1.deflection, 0.0)
        share_2 = select(breaks_1, per_range * slide.t2.deflection, 0.0)
    return (
        next_tangent_mode(slide.t1, breaks_1, share_1),
        next_tangent_mode(slide.t2, breaks_2, share_2),
    )


@inlined
def at_range(slide: TangentSlide, law: ResetConstants) -> Truth:
    """True if a node that sticks is at the stiction range and moves outward."""
    forward = (slide.deflection >= law.stiction_range) & (slide.velocity > 0.0)
    backward = (slide.deflection <= -law.stiction_range) & (slide.velocity < 0.0)
    return (slide.mode == STICK) & (forward | backward)


@inlined
def next_tangent_mode(slide: TangentSlide, breaks: Truth, share: Real) -> Real:
    """Next mode along one tangent. A node that `breaks` free slips in the direction of its
    velocity. The other tangent may free it with a `share` of the stiction range as deflection. A
    node sticks again when its velocity changes sign."""
    from_stick = select(breaks, select(slide.velocity > 0.0, 1.0, -1.0), share)
    mode = select(slide.mode == STICK, from_stick, slide.mode)
    return select(mode * slide.velocity > 0.0, mode, STICK)


@inlined
def reset_margin(slide: Slide, law: ResetConstants) -> float:
    """Mode margin of the reset integrator: the smaller margin of the two tangents."""
    return min(tangent_margin(slide.t1, law), tangent_margin(slide.t2, law))


@inlined
def tangent_margin(slide: TangentSlide, law: ResetConstants) -> float:
    """Mode margin along one tangent of the reset integrator. A node that sticks may be at the
    stiction range as long as it moves inward."""
    if slide.mode == STICK:
        reserve = law.stiction_range - abs(slide.deflection)
        inward = -slide.velocity * slide.deflection
        return max(reserve, inward) if inward > 0.0 else reserve
    return slide.mode * slide.velocity


@inlined
def time_to_reset_change(
    slide: Slide, acceleration: Pair, law: ResetConstants, horizon: Real
) -> Real:
    """Time (s) to the next mode change of the reset integrator along either tangent."""
    return minimum(
        time_to_tangent_change(slide.t1, acceleration[0], law, horizon),
        time_to_tangent_change(slide.t2, acceleration[1], law, horizon),
    )


@inlined
def time_to_tangent_change(
    slide: TangentSlide, acceleration: Real, law: ResetConstants, horizon: Real
) -> Real:
    """Time (s) to the next mode change along one tangent."""
    velocity, stuck = slide.velocity, slide.mode == STICK
    # first_zero() ignores a value of 0, so 0 stands for no mode change.
    to_front = select(stuck, law.stiction_range - slide.deflection, 0.0)
    to_back = select(stuck, law.stiction_range + slide.deflection, 0.0)
    to_rest = select(stuck, 0.0, slide.mode * velocity)
    time = first_zero(to_front, -velocity, -acceleration, horizon)
    time = minimum(time, first_zero(to_back, velocity, acceleration, horizon))
    return minimum(time, first_zero(to_rest, slide.mode * acceleration, 0.0, horizon))


# Coulomb friction in the tangent plane.


class CoulombConstants(NamedTuple):
    """Constants of Coulomb friction; SI units. The last three are 1 / directional factor."""

    static: Real
    kinetic: Real
    stiffness: Real
    """Stiffness of the bristle."""
    damping: Real
    per_forward: Real
    per_backward: Real
    per_lateral: Real


class BristleForce(NamedTuple):
    """Force u of a node's bristle: c v + k x in stick, c v in slip. Friction is -u up to a
    limit."""

    u_1: Real
    """Component along t1 in N."""
    u_2: Real
    """Component along t2 in N."""
    size: Real
    """Size of u in N; its length if friction is the same in all directions."""
    limit: Real
    """Largest size without slip in N: mu F_N."""
    stuck: Truth


@inlined
def coulomb_sticks(mode: Pair) -> Truth:
    """True if a mode of Coulomb friction means stick."""
    return (mode[0] == STICK) & (mode[1] == STICK)


@inlined
def bristle_force(slide: Slide, law: CoulombConstants) -> BristleForce:
    """Force of a node's bristle."""
    stuck = coulomb_sticks((slide.t1.mode, slide.t2.mode))
    stiffness = select(stuck, law.stiffness, 0.0)
    u_1 = law.damping * slide.t1.velocity + stiffness * slide.t1.deflection
    u_2 = law.damping * slide.t2.velocity + stiffness * slide.t2.deflection
    size = coulomb_size(u_1, u_2, slide.heading, law)
    limit = select(stuck, law.static, law.kinetic) * slide.normal
    return BristleForce(u_1, u_2, size, limit, stuck)


@inlined
def coulomb_size(u_1: Real, u_2: Real, heading: Pair, law: CoulombConstants) -> Real:
    """Size of a vector for direction-dependent friction.

    Vectors of the same size lie on an ellipse. Its half-axes are the directional factors: `forward`
    or `backward` along the heading, depending on the sign, and `lateral` across it.
    """
    along = u_1 * heading[0] + u_2 * heading[1]
    across = u_2 * heading[0] - u_1 * heading[1]
    along *= select(along > 0.0, law.per_forward, law.per_backward)
    across *= law.per_lateral
    return math.sqrt(along * along + across * across)


@inlined
def coulomb_force(slide: Slide, law: CoulombConstants) -> Pair:
    """Coulomb friction (N): -u, limited by the normal force."""
    bristle = bristle_force(slide, law)
    share = select(bristle.size > bristle.limit, bristle.limit / bristle.size, 1.0)
    return -share * bristle.u_1, -share * bristle.u_2


@inlined
def coulomb_damping(slide: Slide, time: Real, law: CoulombConstants) -> tuple[Real, Real, Real]:
    """Stiff part of -(time d/dv + time² d/dx) of the friction: components 11, 12 and 22.

    Beyond the limit only the direction of the force changes. This is exact without directional
    factors.
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
    """Next mode of Coulomb friction. A node breaks free beyond the static limit if it moves
    outward. It sticks again when the bristle's damping alone can hold it."""
    bristle = bristle_force(slide, law)
    u_1, u_2 = bristle.u_1, bristle.u_2
    beyond = bristle.size > bristle.limit
    breaks = bristle.stuck & beyond & (u_1 * slide.t1.velocity + u_2 * slide.t2.velocity > 0.0)
    # The two products are kept apart: their sum would be rounded differently in one lane and in
    # several.
    square_1, square_2 = select(breaks, u_1 * u_1, 1.0), select(breaks, u_2 * u_2, 0.0)
    length = math.sqrt(square_1 + square_2)
    return (
        select(breaks, u_1 / length, select(beyond, slide.t1.mode, STICK)),
        select(breaks, u_2 / length, select(beyond, slide.t2.mode, STICK)),
    )


@inlined
def coulomb_margin(slide: Slide, law: CoulombConstants) -> float:
    """Mode margin (N) of Coulomb friction: in stick limit - size, in slip size - limit."""
    bristle = bristle_force(slide, law)
    if not bristle.stuck:
        return bristle.size - bristle.limit
    outward = bristle.u_1 * slide.t1.velocity + bristle.u_2 * slide.t2.velocity
    return max(bristle.limit - bristle.size, -outward)


@inlined
def time_to_coulomb_change(
    slide: Slide, acceleration: Pair, normal_rate: Real, law: CoulombConstants, horizon: Real
) -> Real:
    """Time (s) until the bristle's force crosses the limit, at its present rate."""
    bristle = bristle_force(slide, law)
    stiffness = select(bristle.stuck, law.stiffness, 0.0)
    rate_1 = law.damping * acceleration[0] + stiffness * slide.t1.velocity
    rate_2 = law.damping * acceleration[1] + stiffness * slide.t2.velocity
    time = 1e-6  # s; for a finite difference
    u_1, u_2 = bristle.u_1 + time * rate_1, bristle.u_2 + time * rate_2
    size_rate = (coulomb_size(u_1, u_2, slide.heading, law) - bristle.size) / time
    limit_rate = select(bristle.stuck, law.static, law.kinetic) * normal_rate
    sign = select(bristle.stuck, 1.0, -1.0)
    reserve, reserve_rate = bristle.limit - bristle.size, limit_rate - size_rate
    return first_zero(sign * reserve, sign * reserve_rate, 0.0, horizon)


# Functions of the ground's law: each calls the function of the reset integrator or of Coulomb.

LAWS = ResetConstants, CoulombConstants
RESET_INTEGRATOR, COULOMB = range(len(LAWS))
"""Kinds of laws, in the order of LAWS."""


class FrictionLaw(NamedTuple):
    """Law of friction: its kind and its constants."""

    kind: int
    """RESET_INTEGRATOR or COULOMB."""
    constants: Table
    """Table of the numbers of ResetConstants or CoulombConstants."""

    @classmethod
    def of(cls, constants: ResetConstants | CoulombConstants) -> Self:
        """The law with these constants."""
        return cls(LAWS.index(type(constants)), np.array(constants))


@inlined
def friction_force(slide: Slide, friction: FrictionLaw) -> Pair:
    """Friction (N) along both tangents on a node that touches the ground."""
    if friction.kind == COULOMB:
        return coulomb_force(slide, named(CoulombConstants, friction.constants))
    return reset_force(slide, named(ResetConstants, friction.constants))


@inlined
def friction_damping(slide: Slide, time: Real, friction: FrictionLaw) -> tuple[Real, Real, Real]:
    """Stiff part of -(time d/dv + time² d/dx) of the friction: components 11, 12 and 22. `time` is
    in s."""
    if friction.kind == COULOMB:
        return coulomb_damping(slide, time, named(CoulombConstants, friction.constants))
    return reset_damping(slide, time, named(ResetConstants, friction.constants))


@inlined
def stuck_along(mode: Pair, friction: FrictionLaw) -> tuple[Truth, Truth]:
    """For each tangent, True if a mode sticks along it."""
    if friction.kind == COULOMB:
        stuck = coulomb_sticks(mode)
        return stuck, stuck
    return mode[0] == STICK, mode[1] == STICK


@inlined
def begins_to_stick(slide: Slide, after: Pair, friction: FrictionLaw) -> tuple[Truth, Truth]:
    """For each tangent, True if a node begins to stick along it, in the mode `after`."""
    stuck_1, stuck_2 = stuck_along((slide.t1.mode, slide.t2.mode), friction)
    sticks_1, sticks_2 = stuck_along(after, friction)
    begins_1, begins_2 = sticks_1 & not_(stuck_1), sticks_2 & not_(stuck_2)
    if friction.kind == COULOMB:
        return begins_1, begins_2
    law = named(ResetConstants, friction.constants)
    restarts = law.restarts != 0.0
    if not any_lane(restarts):
        return begins_1, begins_2
    return (
        begins_1 | (at_range(slide.t1, law) & restarts),
        begins_2 | (at_range(slide.t2, law) & restarts),
    )


@inlined
def kept_deflection(before: Pair, friction: FrictionLaw) -> Pair:
    """Deflection (m) along each tangent with which a node of the mode `before` sticks again."""
    if friction.kind == COULOMB:
        return 0.0 * before[0], 0.0 * before[1]
    law = named(ResetConstants, friction.constants)
    kept = law.kept * law.stiction_range
    return kept * before[0], kept * before[1]


@inlined
def next_mode(slide: Slide, stays: Truth, friction: FrictionLaw) -> Pair:
    """Next mode of a node that `stays` on the ground; STICK for other nodes."""
    if friction.kind == COULOMB:
        after_1, after_2 = next_coulomb_mode(slide, named(CoulombConstants, friction.constants))
    else:
        after_1, after_2 = next_reset_mode(slide, named(ResetConstants, friction.constants))
    return select(stays, after_1, STICK), select(stays, after_2, STICK)


@inlined
def friction_margin(slide: Slide, friction: FrictionLaw) -> float:
    """Mode margin of a node on the ground: positive until its friction mode changes, zero at the
    change. Only the sign has a meaning."""
    if friction.kind == COULOMB:
        return coulomb_margin(slide, named(CoulombConstants, friction.constants))
    return reset_margin(slide, named(ResetConstants, friction.constants))


@inlined
def time_to_friction_change(
    slide: Slide, acceleration: Pair, normal_rate: Real, friction: FrictionLaw, horizon: Real
) -> Real:
    """Time (s) to the next change of the friction mode of a node, at most `horizon`.

    `acceleration` is along the tangents. `normal_rate` (N/s) is the rate of the normal force.
    """
    if friction.kind == COULOMB:
        law = named(CoulombConstants, friction.constants)
        return time_to_coulomb_change(slide, acceleration, normal_rate, law, horizon)
    return time_to_reset_change(
        slide, acceleration, named(ResetConstants, friction.constants), horizon
    )
