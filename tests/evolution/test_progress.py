"""What is shown of a run while it lasts."""

import dataclasses
import io
import math

from tetra_drake.evolution.progress import BarProgress, LineProgress, Overview
from tetra_drake.evolution.trial import TrialStatus

STATUS = TrialStatus(
    number=0,
    evaluations_at_most=140,
    iteration=10,
    evaluations=40,
    recalled=20,
    failures=1,
    best_fitness=4.25,
    best_distance_in=5.0,
)
ENDED = dataclasses.replace(
    STATUS, number=1, evaluations=100, recalled=0, best_fitness=6.0, stop="levelled off"
)
FRESH = TrialStatus(number=2, evaluations_at_most=140)


def test_the_overview_counts_all_trials_and_shows_the_fittest_gait():
    run = Overview.of([STATUS, ENDED, FRESH])
    # A trial that has ended early takes no more evaluations.
    assert (run.done, run.total, run.made) == (140, 380, 120)
    text = ", ".join(run.parts)
    for part in ("6.00", "5.00 in", "1 of 3 trials", "2 failed"):
        assert part in text
    assert Overview.of([FRESH]).parts == []
    assert math.isinf(FRESH.best_fitness)


def test_plain_lines_come_now_and_then_and_at_the_end_with_one_time_left(monkeypatch):
    now = [100.0]
    monkeypatch.setattr("tetra_drake.evolution.progress.time.monotonic", lambda: now[0])
    stream = io.StringIO()
    status = dataclasses.replace(STATUS, evaluations=0, recalled=0)
    with LineProgress(stream) as progress:
        for second in range(25):
            now[0] = 100.0 + second
            progress.show([status])
            status.evaluations += 1
        lines = stream.getvalue().splitlines()
        assert len(lines) == 2
        assert "20 of 140 evaluations" in lines[1]
        assert lines[1].endswith("0:02:00 left")
        status.evaluations, status.stop = 30, "levelled off"
        for _ in range(3):
            progress.show([status])
        for done in range(4):
            progress.stage("best gaits", done, 3)
    lines = stream.getvalue().splitlines()
    assert lines[2].startswith("30 of 30 evaluations")
    assert [line.endswith(("0 of 3", "3 of 3")) for line in lines[3:]] == [True, True]


def test_a_terminal_shows_one_bar_for_the_run_and_one_per_stage(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "160")
    with BarProgress() as progress:
        progress.show([STATUS, ENDED, FRESH])
        progress.stage("best gaits", 2, 5)
        progress.say("hello")
    printed = capsys.readouterr().out
    for text in ("hello", "140/380", "6.00", "best gaits", "2/5"):
        assert text in printed
