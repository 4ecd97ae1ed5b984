"""What simulations end with."""

import xarray

from tetra_drake.errors import SimulationFailure
from tetra_drake.results.result import SimulationResult


def assert_same(
    found: SimulationResult | SimulationFailure, expected: SimulationResult | SimulationFailure
) -> None:
    """Two recorded simulations agree to the last bit, or have failed alike."""
    if isinstance(found, SimulationFailure) or isinstance(expected, SimulationFailure):
        assert repr(found) == repr(expected)
        return
    names = "metrics", "fitness", "integrator"
    ours, theirs = ([repr(getattr(each, name)) for name in names] for each in (found, expected))
    assert ours == theirs  # NaN, too
    xarray.testing.assert_identical(found.trajectory, expected.trajectory)
