"""The reset-integrator friction of a contact node (Eq. 3-5), along one horizontal axis."""

from __future__ import annotations

from typing import Any

from tetra_drake.physics.compiling import compiled
from tetra_drake.physics.lanes import Real, select

STICK = 0.0
"""The friction mode of an axis that sticks; +1 or -1 slips in that direction."""


@compiled
def friction_force(velocity: Real, deflection: Real, mode: Real, law: Any) -> Real:
    """Friction (N) along one horizontal axis of a node on the ground (Eq. 3-5).

    `velocity` (m/s) is along the axis and `deflection` (m) from the stick point; in slip
    the deflection is held at the stiction range, on the side the node slips to. `law` is that
    of `contact`.
    """
    sigma_0 = law.proportional_stiction * abs(velocity)
    bristle = sigma_0 * (1.0 + law.stiction_switch) * deflection
    stick = -(bristle + law.stiction_damping * velocity)
    slip = -sigma_0 * law.stiction_range * mode
    return select(mode == STICK, stick, slip)


@compiled
def next_friction_mode(velocity: Real, deflection: Real, mode: Real, stiction_range: Real) -> Real:
    """The mode that follows `mode`: breaks free at the stiction range moving outward,
    sticks again when the velocity changes sign."""
    forward = (deflection >= stiction_range) & (velocity > 0.0)
    backward = (deflection <= -stiction_range) & (velocity < 0.0)
    from_stick = select(forward, 1.0, select(backward, -1.0, STICK))
    from_slip = select(mode * velocity > 0.0, mode, STICK)
    return select(mode == STICK, from_stick, from_slip)
