"""Tally of a made-up walk, for tests of metrics."""

from tetra_drake.kernels.packed import allocate
from tetra_drake.laws.tally import Tally


def make_totals(bodies: int = 5) -> Tally:
    """Tally of twelve steady seconds in which actuators do 0.3 J of work, and nothing else is."""
    tally = allocate(Tally, {"signals": 4, "cables": 1, "bodies": bodies})
    tally.effort.work[0], tally.begins[0], tally.time[0] = 0.3, 3.0, 15.0
    return tally
