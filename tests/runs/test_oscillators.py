"""The study of oscillators: its page, and what its records say."""

import oscillators
from records import read

RECORDS = read(oscillators.HERE / oscillators.RECORDS)


def test_phase_oscillators_that_evolve_on_steps_pass_the_farthest_sine_there():
    trials = oscillators.numbers(RECORDS)["steps"]["trials"]
    assert trials.min() > oscillators.load_sines()["steps"]["distance_in"]


def test_phase_oscillators_pass_the_farthest_sine_in_at_least_eight_of_ten_trials():
    found = oscillators.numbers(RECORDS)
    trials = found["phases"]["trials"]
    assert trials.size == 10 and (trials > oscillators.farthest_sine(found)).sum() >= 8
