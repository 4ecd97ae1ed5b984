"""Whether the trials of one run walk farther than those of another."""

import numpy as np
import pytest
import settle


def test_the_interval_is_that_of_students_t():
    """Normal samples of 10 each: s sqrt(2 / 10) t, t = 2.10 with 18 degrees of freedom; a bootstrap
    of ten is narrower by sqrt(9 / 10) and takes 1.96 for t."""
    generator = np.random.default_rng(3)
    one, other = generator.normal(20.0, 4.0, 10), generator.normal(26.0, 4.0, 10)
    difference, low, high = settle.difference_of_means(one, other)
    assert difference == pytest.approx(other.mean() - one.mean())
    deviation = np.sqrt((one.var() + other.var()) / 10)
    assert high - low == pytest.approx(2 * 1.96 * deviation, rel=0.1)
    assert low < difference < high
    assert settle.difference_of_means(other, one)[0] == pytest.approx(-difference)
