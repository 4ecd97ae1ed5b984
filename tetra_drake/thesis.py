"""Numbers the thesis reports, to be shown beside ours."""

from __future__ import annotations

BEST_INITIAL_DISTANCE_IN = 6.6
"""Farthest of the random gaits in 15 s (section 3.1)."""

BEST_EVOLVED_DISTANCE_IN = 14.34
"""Farthest evolved gait in 15 s (section 3.2)."""

MEAN_IMPROVEMENT_PERCENT = 32.0
BEST_IMPROVEMENT_PERCENT = 51.0
"""Rise by evolution over ten trials, on average and in the best trial (abstract)."""

SECONDS_PER_ITERATION = 22.0
"""Two 15 s simulations (section 2.4), so slower than real time."""

OSCILLATOR_FREQUENCY_HZ = 0.7
"""Of a single oscillator (section 2.3)."""

SETTLING_IMPACT_SPEED_IN_S = 0.12
SETTLING_RESTITUTION = 0.9
"""A node let go just above the ground (section 2.1.1)."""

SHARE_BACKWARD = "nearly half"
"""Of the initial gaits of a trial, how many go backward (section 3.1)."""

TWO_BEST_FITNESS = 0.0006
TWO_BEST_WEIGHTS = (
    *(0.0594, 0.1063, 0.0919, 0.0329),
    *(0.1184, 0.0, 0.11, 0.1364),
    *(0.0874, 0.064, 0.1928, 0.3157),
    *(0.0738, 0.2638, 0.1313, 0.0),
    *(0.0288, 0.1233, 0.1689, 0.3806),
    *(0.0125, 0.0244, 0.0357, 0.1322),
)
TWO_BEST_TAU_S = 0.0
"""Absolute differences of the two best solutions of the best trial (Table 8): in fitness, in the
weights w1 to w24, and in either time constant."""
