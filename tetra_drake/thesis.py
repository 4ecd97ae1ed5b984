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
