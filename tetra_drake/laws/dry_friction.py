"""Dry friction inside a robot: of cables at rings, and of ball joints.

At a ring with the coefficient mu, over which a cable turns by the angle theta, the tensions of both
pieces have the ratio (capstan)

    T / T_next = exp(mu theta s(v / CREEP)),   s(x) = x / sqrt(1 + x²)

The slip v is the rate at which cable runs through the ring, towards the first of the two pieces.
The cable is stretched alike along its path: with the length a before the ring, the whole length l,
and the winding rate w of a winch at the end of the path, v = a' - (a / l) (l' - w). The tensions,
weighted by the lengths of their pieces, have the mean that the law of the cable gives. Then the
power of the friction is the sum of v (T_next - T) over the rings, which is never above 0.

A joint with the torque limit M resists the relative angular velocity w of its bodies by the torque
M s(w / SPIN_CREEP). What friction holds creeps, as feet without bristles do.
"""

from __future__ import annotations

import math

from tetra_drake.kernels.compiling import inlined
from tetra_drake.kernels.lanes import Real, exponential, inverse_sqrt
from tetra_drake.laws.vectors import Vector3, difference, dot, sum_of

CREEP, SPIN_CREEP = 1e-3, 1e-2
"""Slip (m/s) and relative angular velocity (rad/s) at which friction has 71 % of its limit."""

ALONG, BEFORE, SHARE, DAMPING, RING_COLUMNS = 0, 3, 4, 5, 6
"""Columns of the table `rings` (path nodes, 6), and their number: direction of the piece that ends
at a node; length of cable before the node, as a share; tension of this piece as a multiple of the
first one's; derivative of the friction by the slip (N s/m)."""


@inlined
def turn_between(a: Vector3, b: Vector3) -> Real:
    """Angle (rad) from 0 to pi between two unit vectors."""
    apart, mean = difference(a, b), sum_of(a, b)
    tangent = math.sqrt(dot(apart, apart)) / (2.0 + math.sqrt(dot(mean, mean)))  # of a quarter
    for _ in range(2):
        tangent = tangent / (1.0 + math.sqrt(1.0 + tangent * tangent))
    z, series = tangent * tangent, 1.0 / 19.0 + 0.0 * tangent
    for odd in (17.0, 15.0, 13.0, 11.0, 9.0, 7.0, 5.0, 3.0, 1.0):
        series = 1.0 / odd - z * series
    return 16.0 * tangent * series


@inlined
def capstan(slip: Real, wrap: Real, tension: Real) -> tuple[Real, Real]:
    """Ratio of the tensions before and behind a ring, and the derivative of their difference by the
    slip (N s/m).

    `slip` is in m/s, `wrap` is the coefficient of friction times the angle, `tension` (N) the
    cable's mean one.
    """
    per_speed = inverse_sqrt(slip * slip + CREEP**2)
    share = CREEP * per_speed
    return exponential(wrap * slip * per_speed), wrap * tension * share * share * per_speed


@inlined
def spin_friction(w: Vector3, limit: Real) -> tuple[Real, Real]:
    """Friction of a joint divided by the relative angular velocity w (rad/s) of its bodies, and
    what it loses along w per square of w; `limit` is the torque limit in N m."""
    per_speed = inverse_sqrt(dot(w, w) + SPIN_CREEP**2)
    return limit * per_speed, limit * per_speed * per_speed * per_speed
