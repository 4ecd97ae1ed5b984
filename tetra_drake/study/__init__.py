"""Robustness, comparisons and maps of recorded runs, as tables."""
