"""Figures of simulations and runs, and the common style of all figures."""
