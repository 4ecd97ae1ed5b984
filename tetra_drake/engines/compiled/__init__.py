"""The same robot simulated without Drake, compiled end to end, for speed.

The laws are those of `physics`; here are the equations of motion and their integration.
"""
