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

LIMITED = {
    name: kind.model_copy(update={"max_force": 6.0 if name == "winch" else 4.0, "max_speed": 0.1})
    for name, kind in ACTUATIONS.items()
    if not kind.lacking
}
"""Actuators whose limits bind in a walk, but for the force."""
