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
    from rich import progress

_LINE_PERIOD = 10.0  # s, between plain lines, and before the time left is estimated


class Progress(contextlib.AbstractContextManager["Progress"]):
    """Display of a run's progress and messages on a stream.

    A terminal gets one bar per stage. Another stream gets a line when a stage begins and ends, and
    every ten seconds. Both show the time left for all trials. Without a stream, nothing is shown
    but warnings, as Python warnings. A display of your own overrides say(), warn() and stage().
    """

    _bars: progress.Progress | None = None

    def __init__(self, stream: TextIO | None = None) -> None:
        if stream is None:
            return
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
        self._stages: dict[str, progress.TaskID] = {}
        """The bar of each stage."""
        self._printed = -math.inf
        """Time at which the last plain line was printed."""
        self._line = ""
        """The last plain line."""

    def __exit__(self, *_: object) -> None:
        if self._bars is not None and not self._plain:
            self._bars.stop()

    def say(self, text: str) -> None:
        """Prints information for the user, above the bars; nothing without a stream."""
        if self._bars is not None:
            self._bars.print(text, markup=False, highlight=False, emoji=False, soft_wrap=True)

    def warn(self, text: str) -> None:
        """Prints a warning to stderr, above the bars. Without a stream, issues a Python warning."""
        if self._bars is None:
            warnings.warn(text, RuntimeWarning, stacklevel=3)
        else:
            print(f"tetra-drake: {text}", file=sys.stderr, flush=True)

    def show(self, statuses: Sequence[TrialStatus]) -> None:
        """Shows how many evaluations are done, all trials together, as the stage "evaluations". Its
        text has distance and fitness of the best gait, and the numbers of finished trials and of
        failures. `statuses` are the states of all trials. evolve() calls this method whenever
        evaluations end, and about once per second."""
        done = sum(status.evaluations for status in statuses)
        # A trial that ended early needs no more evaluations.
        total = sum(s.evaluations if s.stop else s.evaluations_at_most for s in statuses)
        fittest = max(statuses, key=lambda status: status.best_fitness)
        ended = sum(status.stop is not None for status in statuses)
        failures = sum(status.failures for status in statuses)
        parts = []
        if fittest.iteration >= 0:
            units, fitness = fittest.units, rounded(fittest.best_fitness)
            distance = rounded(fittest.best_distance / units.length)
            parts.append(f"best fitness {fitness} (its gait goes {distance} {units.length_name})")
        if len(statuses) > 1:
            parts.append(f"{ended} of {len(statuses)} trials finished")
        if failures:
            parts.append(f"{failures} failed")
        self.stage("evaluations", done, total, ", ".join(parts))

    def stage(self, title: str, done: int, total: int, text: str = "") -> None:
        """Shows that `done` of `total` steps of the stage `title` are done, with `text` and the
        time left. A terminal shows a bar per stage. Another stream gets a line when the stage
        begins and ends, and every ten seconds."""
        if self._bars is None:
            return
        self._bars.start()
        now, begins = time.monotonic(), title not in self._stages
        if begins:
            self._stages[title] = self._bars.add_task(title, total=total, completed=done, text="")
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
