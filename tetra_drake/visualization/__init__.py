"""Meshcat: scene of the robot, replay page, live view."""
