"""An oscillator that feels the mass it drives, against harmonic balance."""

import pytest
from entrainment import FEEDBACK, balanced_frequencies, simulated_frequency

OFF = 0.02  # m, where the mass starts to find a rhythm that it does not find from rest


def simulate(ratio, feedback, start=0.0):
    return simulated_frequency(ratio=ratio, feedback=feedback, start=start)


def balance(ratio, feedback):
    return balanced_frequencies(ratio=ratio, feedback=feedback).tolist()


@pytest.mark.parametrize(
    ("ratio", "feedback", "near"), [(0.65, FEEDBACK, 0.1), (1.6, -FEEDBACK, 0.02)]
)
def test_it_follows_slower_and_faster_masses_by_feedback_of_either_sign(ratio, feedback, near):
    locked = min(balance(ratio, feedback), key=lambda f: abs(f - ratio))
    assert locked == pytest.approx(ratio, rel=near)
    assert simulate(ratio, feedback, OFF) == pytest.approx(locked, rel=0.02)
    alone = min(balance(ratio, -feedback), key=lambda f: abs(f - 1.0))
    assert simulate(ratio, -feedback, OFF) == pytest.approx(alone, rel=0.02)


def test_at_the_end_of_the_range_the_start_decides():
    free, locked = sorted(balance(1.9, -FEEDBACK), key=lambda f: abs(f - 1.0))
    assert simulate(1.9, -FEEDBACK) == pytest.approx(free, rel=0.02)
    assert simulate(1.9, -FEEDBACK, OFF) == pytest.approx(locked, rel=0.02)


@pytest.mark.parametrize(("ratio", "feedback", "far"), [(0.5, 0.0, 1e-4), (0.35, FEEDBACK, 0.15)])
def test_without_feedback_or_too_far_off_a_mass_is_not_followed(ratio, feedback, far):
    (only,) = balance(ratio, feedback)
    assert only == pytest.approx(1.0, abs=far)
    assert simulate(ratio, feedback, OFF) == pytest.approx(only, rel=0.02)
