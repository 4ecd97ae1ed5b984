"""When something holds that was recorded at each step's end."""

import numpy as np

from tetra_drake.intervals import intervals

TIMES = np.array([0.0, 1.0, 2.0, 4.0, 8.0])


def stretches(*active: int) -> list[tuple[float, float]]:
    return intervals(TIMES, np.array(active, dtype=bool))


def test_a_stretch_begins_one_sample_before_it_shows() -> None:
    assert stretches(0, 0, 1, 1, 0) == [(1.0, 4.0)]


def test_what_holds_from_the_start_or_to_the_end_does() -> None:
    assert stretches(1, 1, 0, 0, 1) == [(0.0, 1.0), (4.0, 8.0)]
    assert stretches(1, 1, 1, 1, 1) == [(0.0, 8.0)]


def test_nothing_gives_no_stretch() -> None:
    assert stretches(0, 0, 0, 0, 0) == []
