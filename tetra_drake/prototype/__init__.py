"""Commands for a prototype of the robot."""
