"""The laws of friction of a node on the ground, in the plane that is tangent to it.

The reset integrator (Eq. 3-5) acts along each tangent by itself. Coulomb friction, regularised,
acts in the plane and is limited by the normal force. `law` is that of `contact`.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from tetra_drake.simd.compiling import inlined
from tetra_drake.simd.lanes import Real, Truth, select

STICK = 0.0
"""The friction mode that sticks. One that slips is the direction in which the node broke free:
with the reset integrator +1 or -1 on each tangent, with Coulomb friction a unit vector."""

Pair = tuple[Real, Real]


class Slide(NamedTuple):
    """A node on the ground and in motion along it, by components along the tangents t1 and t2."""

    velocity: Pair
    """m/s."""
    deflection: Pair
    """From the stick point, m."""
    mode: Pair
    heading: Pair
    """Direction in which the node's body pointed at touchdown, a unit vector."""
    normal: Real
    """Normal force, N."""


# The reset integrator, along one tangent.


@inlined
def reset_force(velocity: Real, deflection: Real, mode: Real, law: Any) -> Real:
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
def next_reset_mode(velocity: Real, deflection: Real, mode: Real, stiction_range: Real) -> Real:
    """The mode that follows `mode`: breaks free at the stiction range moving outward,
    sticks again when the velocity changes sign."""
    forward = (deflection >= stiction_range) & (velocity > 0.0)
    backward = (deflection <= -stiction_range) & (velocity < 0.0)
    from_stick = select(forward, 1.0, select(backward, -1.0, STICK))
    from_slip = select(mode * velocity > 0.0, mode, STICK)
    return select(mode == STICK, from_stick, from_slip)


# Coulomb friction, in the plane.


class Pull(NamedTuple):
    """What pulls at a node's bristle: u = c v, in stick + k x."""

    u: Pair
    """N."""
    size: Real
    """Of u, N: its length where friction is the same in all directions."""
    limit: Real
    """Of the size, mu F_N."""


@inlined
def sticks(mode: Pair) -> Truth:
    """Whether a mode of Coulomb friction sticks."""
    return (mode[0] == STICK) & (mode[1] == STICK)


@inlined
def coulomb_pull(slide: Slide, law: Any) -> Pull:
    """The pull at the bristle. The directional factors make its size that of an ellipse, whose
    half-axis along the heading is `forward` or `backward` by the way u points."""
    stuck = sticks(slide.mode)
    k = select(stuck, law.bristle_stiffness, 0.0)
    u_1 = law.bristle_damping * slide.velocity[0] + k * slide.deflection[0]
    u_2 = law.bristle_damping * slide.velocity[1] + k * slide.deflection[1]
    size = coulomb_size((u_1, u_2), slide.heading, law)
    limit = select(stuck, law.static, law.kinetic) * slide.normal
    return Pull((u_1, u_2), size, limit)


@inlined
def coulomb_size(u: Pair, heading: Pair, law: Any) -> Real:
    """The length of a vector, measured in directional factors."""
    along = u[0] * heading[0] + u[1] * heading[1]
    across = u[1] * heading[0] - u[0] * heading[1]
    along *= select(along > 0.0, law.per_forward, law.per_backward)
    across *= law.per_lateral
    return math.sqrt(along * along + across * across)


@inlined
def coulomb_force(slide: Slide, law: Any) -> Pair:
    """Friction (N): -u, as far as the normal force allows."""
    pull = coulomb_pull(slide, law)
    share = select(pull.size > pull.limit, pull.limit / pull.size, 1.0)
    return -share * pull.u[0], -share * pull.u[1]


@inlined
def next_coulomb_mode(slide: Slide, law: Any) -> Pair:
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
def coulomb_damping(slide: Slide, time: Real, law: Any) -> tuple[Real, Real, Real]:
    """-(time d/dv + time² d/dx) of the friction: its components 11, 12 and 22; time in s.

    Beyond the limit only the direction of the force changes (exact without directional factors).
    """
    pull = coulomb_pull(slide, law)
    k = select(sticks(slide.mode), time * law.bristle_stiffness, 0.0)
    slips = pull.size > pull.limit
    rate = time * (law.bristle_damping + k) * select(slips, pull.limit / pull.size, 1.0)
    u_1, u_2 = pull.u
    per_square = select(slips, rate / (u_1 * u_1 + u_2 * u_2), 0.0)
    return rate - per_square * u_1 * u_1, -per_square * u_1 * u_2, rate - per_square * u_2 * u_2
