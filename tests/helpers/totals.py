"""A tally of a walk made up for tests of what is made of it."""

import numpy as np

from tetra_drake.physics.tally import Tally


def make_totals(bodies: int = 5) -> Tally:
    """That of twelve steady seconds, in which each tetrahedron is lifted one second longer than
    the one behind it; the struts are 1 cm apart."""
    tally = Tally(*(np.zeros(1) for _ in Tally._fields))
    return tally._replace(
        begins=np.array([3.0]),
        time=np.array([15.0]),
        work=np.array([0.3]),
        peaks=np.array([4.0, 0.2, 0.5]),
        sums=np.array([96.0, 4.8, 24.0, 9.6]),
        roughness=np.array([48.0]),
        lifted=np.arange(float(bodies)),
        tension=np.array([1.0]),
        clearance=np.array([0.01]),
    )
