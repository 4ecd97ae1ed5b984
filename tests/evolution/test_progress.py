"""What is shown of a run while it lasts."""

import io
from dataclasses import replace

from tetra_drake.evolution.progress import Progress
from tetra_drake.evolution.trials import TrialStatus

FRESH = TrialStatus(number=0, evaluations_at_most=140)
BEST = {"best_fitness": 4.25, "best_distance": 0.127}
STATUS = replace(FRESH, iteration=9, evaluations=40, failures=1, **BEST)
ENDED = replace(STATUS, evaluations=100, best_fitness=6.0, stop="levelled off")


def test_a_line_is_about_all_trials_and_shows_the_fittest_gait():
    stream = io.StringIO()
    Progress(stream).show([STATUS, ENDED, FRESH])
    for part in ("140 of 380", "fitness 6.00", "5.00 in", "1 of 3 trials", "2 failed"):
        assert part in stream.getvalue()


def test_lines_come_now_and_then_and_their_time_left_counts_no_compilation(monkeypatch):
    now, compiled = [0.0], [0.0]
    monkeypatch.setattr("tetra_drake.evolution.progress.time.monotonic", lambda: now[0])
    monkeypatch.setattr("tetra_drake.evolution.progress.compiling_time", lambda: compiled[0])
    stream = io.StringIO()
    moments = [(0, 0, 0), (38, 30, 8), (51, 30, 20), (59, 30, 20), (101, 75, 20), (125, 75, 50)]
    moments += [(126, 75, 100), (127, 75, 100)]
    with Progress(stream) as progress:
        for now[0], compiled[0], done in moments:
            progress.stage("gaits", done, 100)
    left = [line.partition("of 100")[2] for line in stream.getvalue().splitlines()]
    # After the first 8 gaits: 12 in 13 s, then 42 in 42 s. The end is told at once, and once.
    assert left == ["", "", ", 0:01:27 left", ", 0:00:50 left", ""]
