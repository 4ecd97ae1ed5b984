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

LIMITED: dict[str, ActuatorKind] = {
    "winch": Winch(max_force=6.0, max_speed=0.1, time_constant=0.02),
    "motor": TensionMotor(max_force=4.0, max_speed=0.1, time_constant=0.02),
}
"""Actuators whose limits bind in a walk."""

SIDES = {"robot.actuation": [["outer bottom_left"], ["outer bottom_right"]]}
"""A row of tetrahedra whose bottom cables are driven by an oscillator at each side."""
