"""Progress of a run: bars on a terminal, a plain line every ten seconds elsewhere."""

from __future__ import annotations

import contextlib
import math
import sys
import time
import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, TextIO

from tetra_drake.evolution.trials import TrialStatus
from tetra_drake.formatting import duration, rounded
from tetra_drake.kernels.compiling import compiling_time

if TYPE_CHECKING:
    from rich.progress import TaskID

_LINE_PERIOD = 10.0  # s, between plain lines, and before the time left is estimated


class Progress(contextlib.AbstractContextManager["Progress"]):
    """Receiver of a run's messages and progress. This base class shows nothing but warnings."""

    def __exit__(self, *_: object) -> None:
        return None

    def say(self, text: str) -> None:
        """Receives information for the user."""

    def warn(self, text: str) -> None:
        """Receives a warning for the user; here it becomes a Python warning."""
        warnings.warn(text, RuntimeWarning, stacklevel=3)

    def show(self, statuses: Sequence[TrialStatus]) -> None:
        """Receives the state of all trials, after each evaluation and about once per second."""

    def stage(self, title: str, done: int, total: int, text: str = "") -> None:
        """Receives the progress of one stage of the run: `done` of `total`, and a remark."""


class Display(Progress):
    """Progress on a stream. A terminal gets one bar per stage. Another stream gets a line when a
    stage begins and ends, and every ten seconds. Both show the time left for all trials."""

    def __init__(self, stream: TextIO) -> None:
        from rich import progress
        from rich.console import Console

        self._plain = not stream.isatty()
        self._bars = progress.Progress(
            progress.TextColumn("{task.description}"),
            progress.BarColumn(bar_width=20),
            progress.MofNCompleteColumn(),
            progress.TextColumn("{task.fields[text]}"),
            console=Console(file=stream),
            refresh_per_second=4,
            disable=self._plain,
            speed_estimate_period=math.inf,
            # The clock stands still while kernels are compiled.
            get_time=lambda: time.monotonic() - compiling_time(),
        )
        self._stages: dict[str, TaskID] = {}
        """The bar of each stage."""
        self._printed = -math.inf
        """Time at which the last plain line was printed."""
        self._line = ""
        """The last plain line."""

    def __enter__(self) -> Progress:
        self._bars.start()
        return self

    def __exit__(self, *_: object) -> None:
        if not self._plain:
            self._bars.stop()

    def say(self, text: str) -> None:
        """Prints the text, above the bars."""
        self._bars.print(text, markup=False, highlight=False, emoji=False, soft_wrap=True)

    def warn(self, text: str) -> None:
        """Prints the text to stderr, above the bars."""
        print(f"tetra-drake: {text}", file=sys.stderr, flush=True)

    def show(self, statuses: Sequence[TrialStatus]) -> None:
        """Shows the evaluations of all trials. A trial that ended early needs no more."""
        done = sum(status.evaluations for status in statuses)
        total = sum(s.evaluations if s.stop else s.evaluations_at_most for s in statuses)
        self.stage("evaluations", done, total, overview(statuses))

    def stage(self, title: str, done: int, total: int, text: str = "") -> None:
        """Moves the bar of the stage, or prints a line if one is due."""
        now, begins = time.monotonic(), title not in self._stages
        if begins:
            bar = self._bars.add_task(title, total=total, completed=done, text="")
            self._stages[title] = bar
        bar = self._stages[title]
        self._bars.update(bar, completed=done, total=total)
        parts, stage = [text] if text else [], self._bars.tasks[bar]
        if stage.time_remaining and (stage.elapsed or 0.0) >= _LINE_PERIOD:
            parts.append(f"{duration(stage.time_remaining)} left")
        self._bars.update(bar, text=", ".join(parts))
        if not self._plain:
            return
        line = ", ".join([f"{title}: {done} of {total}", *parts])
        due = begins or done == total or now - self._printed >= _LINE_PERIOD
        if due and line != self._line:
            self._printed, self._line = now, line
            self.say(line)


def overview(statuses: Sequence[TrialStatus]) -> str:
    """Summary in one line: the fittest gait, finished trials, failures."""
    fittest = max(statuses, key=lambda status: status.best_fitness)
    ended = sum(status.stop is not None for status in statuses)
    failures = sum(status.failures for status in statuses)
    parts = []
    if fittest.iteration >= 0:
        units, fitness = fittest.units, rounded(fittest.best_fitness)
        distance = rounded(fittest.best_distance / units.length)
        parts.append(f"best gait {distance} {units.length_name} (fitness {fitness})")
    if len(statuses) > 1:
        parts.append(f"{ended} of {len(statuses)} trials finished")
    if failures:
        parts.append(f"{failures} failed")
    return ", ".join(parts)
