"""The reset-integrator friction of a contact node (Eq. 3-5), along one horizontal axis."""

from __future__ import annotations

from typing import Any

from tetra_drake.physics.compiling import compiled

STICK = 0.0
"""The friction mode of an axis that sticks; +1 or -1 slips in that direction."""


@compiled
def friction_force(velocity: float, deflection: float, mode: float, law: Any) -> float:
    """Friction (N) along one horizontal axis of a node on the ground (Eq. 3-5).

    `velocity` (m/s) is along the axis and `deflection` (m) from the stick point; in slip
    the deflection is held at the stiction range, on the side the node slips to.
    """
    sigma_0 = law.proportional_stiction * abs(velocity)
    if mode == STICK:
        bristle = sigma_0 * (1.0 + law.stiction_switch) * deflection
        return -(bristle + law.stiction_damping * velocity)
    return -sigma_0 * law.stiction_range * mode


@compiled
def next_friction_mode(
    velocity: float, deflection: float, mode: float, stiction_range: float
) -> float:
    """The mode that follows `mode`: breaks free at the stiction range moving outward,
    sticks again when the velocity changes sign."""
    if mode == STICK:
        if deflection >= stiction_range and velocity > 0.0:
            return 1.0
        if deflection <= -stiction_range and velocity < 0.0:
            return -1.0
        return STICK
    return mode if mode * velocity > 0.0 else STICK
