"""Actuators for tests."""

from tetra_drake.laws.actuator import TensionMotor, Winch

LAW = {"max_force": "10 N", "max_speed": "0.5 m/s", "time_constant": "20 ms"}

FORCE = {"actuation": "!Force"}
WINCH = {"actuation": {"_tag": "Winch", **LAW}}
MOTOR = {"actuation": {"_tag": "TensionMotor", **LAW}}
"""Changes of a scenario."""

LIMITED = {
    "winch": Winch(max_force=6.0, max_speed=0.1, time_constant=0.02),
    "motor": TensionMotor(max_force=4.0, max_speed=0.1, time_constant=0.02),
}
"""Actuators whose limits bind in a walk, but for the force."""
