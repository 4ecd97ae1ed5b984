"""Tally of a made-up walk, for tests of metrics."""

import numpy as np

from tetra_drake.kernels.packed import allocate
from tetra_drake.laws.tally import Tally


def make_totals(bodies: int = 5) -> Tally:
    """Tally of twelve steady seconds. Each tetrahedron is lifted one second longer than the one
    behind it; the struts are 1 cm apart."""
    tally = allocate(Tally, {"signals": 4, "cables": 1, "bodies": bodies})
    numbers = {"peak_force": 4.0, "peak_speed": 0.2, "peak_power": 0.5, "work": 0.3}
    numbers |= {"impulse": 96.0, "wound": 4.8, "pulled": 24.0, "limited": 9.6}
    for name, number in numbers.items():
        getattr(tally.effort, name)[0] = number
    tally.begins[0], tally.time[0], tally.clearance[0] = 3.0, 15.0, 0.01
    tally.roughness[0], tally.least_tension[0] = 48.0, 1.0
    tally.rolled[0] = 7.0
    tally.lifted[:] = np.arange(bodies)
    return tally
