"""Actuators for tests: changes of a scenario."""

LAW = {"max_force": "10 N", "max_speed": "0.5 m/s", "time_constant": "20 ms"}

FORCE = {"actuation": "!Force"}
WINCH = {"actuation": {"_tag": "Winch", **LAW}}
MOTOR = {"actuation": {"_tag": "TensionMotor", **LAW}}
