"""Figures of simulations, runs and analyses."""
