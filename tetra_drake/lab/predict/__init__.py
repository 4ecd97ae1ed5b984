"""Predictions with intervals, from tolerances of a robot's numbers."""
