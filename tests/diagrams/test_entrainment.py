"""An oscillator that feels the mass it drives, against harmonic balance."""

import pytest
from entrainment import FEEDBACK, balanced_frequencies, simulated_frequency

OFF = 0.02  # m, where the mass starts to find a rhythm that it does not find from rest
FOLLOWED = [(0.65, FEEDBACK, OFF, 0.65), (1.6, -FEEDBACK, OFF, 1.6)]
"""Ratio of the mass's frequency, feedback, start, and the frequency that is near. Slower masses
are followed by feedback of one sign, faster ones by the other."""
ALONE = [(0.65, -FEEDBACK, OFF, 1.0), (1.6, FEEDBACK, OFF, 1.0)]
ALONE += [(0.5, 0.0, OFF, 1.0), (0.35, FEEDBACK, OFF, 1.0)]
AT_THE_END = [(1.9, -FEEDBACK, 0.0, 1.0), (1.9, -FEEDBACK, OFF, 1.9)]
"""Of the range, where the start decides."""


@pytest.mark.parametrize(("ratio", "feedback", "start", "near"), FOLLOWED + ALONE + AT_THE_END)
def test_a_mass_is_followed_where_harmonic_balance_says(ratio, feedback, start, near):
    balances = balanced_frequencies(ratio=ratio, feedback=feedback).tolist()
    balance = min(balances, key=lambda frequency: abs(frequency - near))
    assert balance == pytest.approx(near, rel=0.15)
    assert len(balances) == 1 or ratio not in (0.35, 0.5)
    found = simulated_frequency(ratio=ratio, feedback=feedback, start=start)
    assert found == pytest.approx(balance, rel=0.02)
