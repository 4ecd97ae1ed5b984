"""Fits of scenario values to measurements of a robot."""
