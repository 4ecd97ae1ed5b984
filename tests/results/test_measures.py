"""Quantities derived from a trajectory, on walks of which everything is known."""

import math

import numpy as np
import pytest
from helpers.made_up_walk import PERIOD, make_walk

from tetra_drake.laws.curves import travelling_index
from tetra_drake.robot.measures import dominant_frequency, intervals, last_step

TIMES = np.linspace(0.0, 15.0, 1501)
UNEVEN = np.sort(np.concatenate([TIMES, np.linspace(4.0, 5.0, 37)]))


@pytest.fixture(scope="module")
def walk():
    return make_walk()


def test_an_interval_begins_one_sample_before_it_shows():
    times = np.array([0.0, 1.0, 2.0, 4.0, 8.0])
    assert intervals(times, np.array([0, 0, 1, 1, 0], dtype=bool)) == [(1.0, 4.0)]
    assert intervals(times, np.array([1, 1, 0, 0, 1], dtype=bool)) == [(0.0, 1.0), (4.0, 8.0)]
    assert intervals(times, np.array([1, 1, 1, 1, 1], dtype=bool)) == [(0.0, 8.0)]


@pytest.mark.parametrize("times", [TIMES, UNEVEN], ids=["even", "uneven"])
@pytest.mark.parametrize("hertz", [0.31, 0.8])
def test_the_frequency_is_that_of_the_strongest_sine(hertz, times):
    phase = 2.0 * np.pi * hertz * times
    assert dominant_frequency(times, 3.0 + np.sin(phase)) == pytest.approx(hertz, abs=0.003)
    both = np.sin(phase) + 0.8 * np.sin(2.0 * phase)
    assert dominant_frequency(times, both) == pytest.approx(hertz, abs=0.01)


def test_a_constant_has_no_frequency():
    for constant in (0.0 * TIMES, 0.7 + 0.0 * TIMES, 1.0 + 1e-9 * np.sin(TIMES)):
        assert math.isnan(dominant_frequency(TIMES, constant))


def test_the_last_step_is_one_period_and_ends_late(walk):
    start, end = last_step(walk)
    assert end - start == pytest.approx(PERIOD, rel=0.03)
    assert float(walk.time[-1]) - PERIOD <= end <= float(walk.time[-1])
    assert last_step(walk.assign(signal=0.0 * walk.signal)) is None
    assert last_step(make_walk(duration=1.5)) is None  # holds no two periods
    assert last_step(walk.isel(oscillator=[])) is None


def test_a_wave_travels_by_its_delay_from_place_to_place():
    # At places x = 0, 1, 2, 3 of a wave of length 4: full turns of phase pi / 2 spread the real and
    # imaginary parts evenly, in phase or antiphase there is no imaginary part.
    t, x = np.linspace(0.0, 10.0, 1000, endpoint=False)[:, None], np.arange(4.0)
    assert travelling_index(np.sin(2 * np.pi * (t - x / 4.0))) == pytest.approx(1.0)
    standing = np.sin(2 * np.pi * t) * np.cos(np.pi * x)
    assert travelling_index(standing) == pytest.approx(0.0, abs=1e-7)  # the root of rounding
    # Two places a quarter of a period apart, of amplitudes 1 and 0.3: an ellipse of that ratio.
    pair = np.hstack([np.sin(2 * np.pi * t), 0.3 * np.cos(2 * np.pi * t)]) + 5.0
    assert travelling_index(pair) == pytest.approx(0.3, rel=1e-6)
    assert travelling_index(np.sin(2 * np.pi * t)) == 0.0
