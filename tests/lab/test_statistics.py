"""Statistics of few values."""

import numpy as np
import pandas
import pytest

from tetra_drake.lab.study.statistics import interquartile_mean, interval, share_interval


def test_the_bootstrap_interval_is_that_of_the_mean_of_many_numbers():
    # Of 400 numbers of deviation 1, the mean has the deviation 0.05.
    numbers = np.random.default_rng(1).normal(size=400)
    numbers = pandas.Series((numbers - numbers.mean()) / numbers.std())
    low, high = interval(numbers)
    assert (low, high) == pytest.approx((-1.96 * 0.05, 1.96 * 0.05), abs=0.008)
    assert interval(pandas.Series([3.0, 3.0, np.nan])) == (3.0, 3.0)


def test_the_interval_of_a_share_has_a_width_even_if_it_is_whole():
    # With all n of n it ends at n / (n + z^2), z = 1.96 (Wilson 1927).
    assert share_interval(40, 40) == pytest.approx((40 / (40 + 1.96**2), 1.0), abs=1e-5)
    assert np.isnan(share_interval(0, 0)).all()


def test_the_interquartile_mean_leaves_out_a_quarter_on_either_side():
    # Of 10 values 2 on either side; of 3 none.
    values = [100.0, 3.0, 2.0, 1.0, 4.0, 6.0, 5.0, 8.0, -50.0, 7.0]
    assert interquartile_mean(values) == pytest.approx((2 + 3 + 4 + 5 + 6 + 7) / 6)
    assert interval([1.0] * 9 + [50.0], interquartile_mean)[0] == 1.0
