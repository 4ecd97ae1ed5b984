"""Totals of a walk made up for tests of what is made of them."""

import numpy as np

from tetra_drake.results.metrics import Totals


def make_totals(bodies: int = 5, **given: float) -> Totals:
    """Those of twelve steady seconds, in which each tetrahedron is lifted one second longer than
    the one behind it."""
    numbers = {"work": 0.3, "roughness": 48.0, "tension": 1.0, "clearance": 0.01} | given
    return Totals(time=12.0, lifted=np.arange(float(bodies)), **numbers)
