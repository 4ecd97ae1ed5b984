"""What is measured on a recorded walk."""

import math

import numpy as np
import pytest
import xarray

from tetra_drake.experiment.walking import (
    dominant_frequency,
    shares_off_ground,
    signal_frequencies,
)

TIMES = np.sort(np.concatenate([np.linspace(0.0, 15.0, 1501), np.linspace(4.0, 5.0, 37)]))
"""Uneven, as steps of an integrator are."""


@pytest.mark.parametrize("hertz", [0.31, 0.53, 0.8])
def test_the_frequency_of_a_sine_is_found(hertz):
    signal = 3.0 + np.sin(2.0 * np.pi * hertz * TIMES)
    assert dominant_frequency(TIMES, signal) == pytest.approx(hertz, abs=0.003)


def test_the_strongest_of_several_frequencies_counts():
    signal = np.sin(2.0 * np.pi * 0.6 * TIMES) + 0.8 * np.sin(2.0 * np.pi * 1.2 * TIMES)
    assert dominant_frequency(TIMES, signal) == pytest.approx(0.6, abs=0.01)


def test_a_constant_has_no_frequency():
    assert math.isnan(dominant_frequency(TIMES, np.full(TIMES.shape, 0.7)))
    assert math.isnan(dominant_frequency(TIMES, np.zeros(TIMES.shape)))


def make_walk():
    """Two tetrahedra for 15 s. T1's left node is up from 6 s, its right one from 9 s on; T2
    never leaves the ground but for the time before 3 s."""
    times = np.linspace(0.0, 15.0, 1501)
    force = np.ones((len(times), 5))
    force[times > 6.0, 0] = 0.0
    force[times > 9.0, 1] = 0.0
    force[times < 3.0, 2:] = 0.0
    signal = np.where(times < 3.0, 0.0, np.sin(2.0 * np.pi * 0.5 * times))
    return xarray.Dataset(
        {
            "normal_force": (("time", "contact"), force),
            "signal": (("time", "junction"), signal[:, np.newaxis]),
        },
        coords={
            "time": times,
            "contact": ["T1 bottom_left", "T1 bottom_right", *(f"T2 {n}" for n in "abc")],
            "tetrahedron": ["T1", "T2"],
            "junction": ["T1-T2"],
        },
    )


def test_a_tetrahedron_is_off_the_ground_while_none_of_its_nodes_touches_it():
    shares = shares_off_ground(make_walk(), since=3.0)
    assert shares == {"T1": pytest.approx(0.5, abs=0.002), "T2": 0.0}


def test_only_the_steady_stretch_counts():
    assert shares_off_ground(make_walk(), since=0.0)["T2"] == pytest.approx(0.2, abs=0.002)
    assert signal_frequencies(make_walk(), since=3.0) == {"T1-T2": pytest.approx(0.5, abs=0.003)}
