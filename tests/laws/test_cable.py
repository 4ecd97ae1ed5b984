"""The law of a cable."""

import numpy as np
import pytest

from tetra_drake.laws.cable import (
    CableLaw,
    cable_tension,
    elastic_energy,
    elastic_stiffness,
    elastic_stretch,
    elastic_tension,
    slack_tension,
)


def test_tension_is_equation_6():
    # 35 N/m (0.3 m - 0.1 m) + 8 N s/m * -0.25 m/s + 1.5 N = 7 - 2 + 1.5
    assert cable_tension(0.3, -0.25, 1.5, CableLaw(35.0, 8.0, 0.1)) == pytest.approx(6.5, rel=1e-15)


SLACK = [(0.2, 0.5, 11.0)]  # 7 N of the spring and 4 N of the damper: Eq. 6
SLACK += [(0.2, 1.0, 14.0)]  # the damper's 8 N count as the spring's 7 N
SLACK += [(0.2, -1.0, 0.0)]
SLACK += [(-0.001, 50.0, 0.0)]  # loose, however fast it lengthens
SLACK += [(0.0, 50.0, 0.0)]


@pytest.mark.parametrize(("stretch", "rate", "tension"), SLACK)
def test_a_cable_that_goes_slack_pulls_only_while_it_is_stretched(stretch, rate, tension):
    law = CableLaw(35.0, 8.0, 0.1)
    found, per_rate = slack_tension(35.0 * stretch, rate, law)
    assert found == pytest.approx(tension, rel=1e-12)
    assert per_rate == (8.0 if tension == 11.0 else 0.0)


@pytest.mark.parametrize("stretch", [0.0, 0.02, -0.01])
def test_stiffness_and_energy_are_the_derivative_and_the_integral_of_the_tension(stretch):
    law, at = CableLaw(35.0, 8.0, 0.1), np.float64(stretch)
    assert elastic_stiffness(at, law) == 35.0
    assert elastic_energy(at, law) == pytest.approx(0.5 * elastic_tension(at, law) * stretch)
    assert elastic_stretch(elastic_tension(at, law), law) == pytest.approx(stretch)
