"""Measures of claims.py on known waves."""

import claims
import numpy as np


def test_delays_and_lags_of_shifted_sines_are_found_between_samples():
    times, late = np.arange(2000.0), np.array([0.0, 7.3, 100.0])
    waves = 1.0 + np.sin(0.02 * (times[:, np.newaxis] - late))
    first, second, _ = waves.T
    np.testing.assert_allclose(claims.delay(first, second, 150), [7.3, 1.0], atol=0.01)
    lags = claims.phase_lags(times, waves, 0.02 / (2.0 * np.pi))
    np.testing.assert_allclose(lags, 0.02 * np.diff(late) / (2.0 * np.pi), atol=1e-3)
