"""Actuators for tests."""

from tetra_drake.laws.actuator import ActuatorKind, Force, TensionMotor, Winch

ACTUATIONS: dict[str, ActuatorKind] = {
    "force": Force(),
    "winch": Winch(max_force=10.0, max_speed=0.5, time_constant=0.02),
    "motor": TensionMotor(max_force=10.0, max_speed=0.5, time_constant=0.02),
}
"""An example of every kind."""

FORCE, WINCH, MOTOR = ({"actuation": ACTUATIONS[name]} for name in ("force", "winch", "motor"))
"""Changes of a scenario."""

_WEAK = {"max_force": 4.0, "max_speed": 0.1}

LIMITED = {
    name: kind.model_copy(update={key: weak for key, weak in _WEAK.items() if hasattr(kind, key)})
    for name, kind in ACTUATIONS.items()
    if not kind.lacking
}
LIMITED["winch"] = LIMITED["winch"].model_copy(update={"max_force": 6.0})
"""Actuators whose limits bind in a walk, but for the force."""

SIDES = {"robot.actuation": [["outer bottom_left"], ["outer bottom_right"]]}
"""A row of tetrahedra whose bottom cables are driven by an oscillator at each side."""
