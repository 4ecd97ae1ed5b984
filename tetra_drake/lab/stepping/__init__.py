"""Robots that a Python program steps, saves, copies and damages."""
