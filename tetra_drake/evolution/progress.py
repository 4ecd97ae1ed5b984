"""Progress of a run: a bar on a terminal, plain lines elsewhere."""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TextIO

from tetra_drake.evolution.trial import TrialStatus
from tetra_drake.formatting import duration, fixed

if TYPE_CHECKING:
    from rich.progress import TaskID

_LINE_PERIOD = 10.0  # s, between plain lines


class Progress:
    """Receives what a run does, entered when it begins; this one shows nothing."""

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *_: object) -> None:
        return None

    def say(self, text: str) -> None:
        """Something the user may like to know."""

    def warn(self, text: str) -> None:
        """Something the user should know; here it becomes a Python warning."""
        warnings.warn(text, RuntimeWarning, stacklevel=3)

    def show(self, statuses: Sequence[TrialStatus]) -> None:
        """The state of all trials: about once per second and after every evaluation."""

    def stage(self, title: str, done: int, total: int) -> None:
        """The state of work other than the trials."""


def make_progress(stream: TextIO) -> Progress:
    """The display that suits the stream."""
    return BarProgress() if stream.isatty() else LineProgress(stream)


@dataclass(frozen=True)
class Overview:
    """A run in one line."""

    done: int
    total: int
    """Evaluations of all trials; of those that have ended, what they took."""
    made: int
    """Evaluations made now, not taken from the record."""
    parts: list[str]
    """Fitness and distance of the fittest gait, trials that have ended, failures."""

    @classmethod
    def of(cls, statuses: Sequence[TrialStatus]) -> Overview:
        """The overview of all trials."""
        fittest = max(statuses, key=lambda status: status.best_fitness)
        ended = sum(status.stop is not None for status in statuses)
        failures = sum(status.failures for status in statuses)
        parts = {
            f"best fitness {fixed(fittest.best_fitness)}": fittest.iteration >= 0,
            f"fittest gait's distance {fixed(fittest.best_distance_in)} in": fittest.iteration >= 0,
            f"{ended} of {len(statuses)} trials ended": len(statuses) > 1,
            f"{failures} failed": failures > 0,
        }
        return cls(
            done=sum(status.evaluations for status in statuses),
            total=sum(s.evaluations if s.stop else s.evaluations_at_most for s in statuses),
            made=sum(status.evaluations - status.recalled for status in statuses),
            parts=[part for part, known in parts.items() if known],
        )


class LineProgress(Progress):
    """Prints a line every ten seconds, and when a stage begins and ends."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._began = self._printed = time.monotonic()
        self._last = ""

    def say(self, text: str) -> None:
        """Prints the text."""
        print(text, file=self._stream, flush=True)

    def warn(self, text: str) -> None:
        """Prints the text to stderr."""
        print(f"tetra-drake: {text}", file=sys.stderr, flush=True)

    def show(self, statuses: Sequence[TrialStatus]) -> None:
        """Prints how far the run is, and one time left for all of it."""
        now, run = time.monotonic(), Overview.of(statuses)
        if run.made == 0:
            self._began = now
        parts = [f"{run.done} of {run.total} evaluations", *run.parts]
        if run.made and run.done < run.total:
            left = (run.total - run.done) * (now - self._began) / run.made
            parts.append(f"{duration(left)} left")
        self._print(", ".join(parts), due=run.done == run.total)

    def stage(self, title: str, done: int, total: int) -> None:
        """Prints how far a stage is."""
        self._print(f"{title}: {done} of {total}", due=done in (0, total))

    def _print(self, text: str, *, due: bool) -> None:
        now = time.monotonic()
        if text != self._last and (due or now - self._printed >= _LINE_PERIOD):
            self._printed, self._last = now, text
            self.say(text)


class BarProgress(Progress):
    """A bar of rich for the run, and one for each stage."""

    def __init__(self) -> None:
        from rich import progress

        self._bars = progress.Progress(
            progress.TextColumn("{task.description}"),
            progress.BarColumn(bar_width=20),
            progress.MofNCompleteColumn(),
            progress.TimeRemainingColumn(),
            progress.TextColumn("{task.fields[text]}"),
            refresh_per_second=4,
        )
        self._tasks: dict[str, TaskID] = {}

    def __enter__(self) -> Progress:
        self._bars.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bars.stop()

    def say(self, text: str) -> None:
        """Prints the text above the bars."""
        self._bars.print(text, markup=False, highlight=False, soft_wrap=True)

    def warn(self, text: str) -> None:
        """Prints the text above the bars."""
        self.say(f"tetra-drake: {text}")

    def show(self, statuses: Sequence[TrialStatus]) -> None:
        """Moves the run's bar."""
        run = Overview.of(statuses)
        self._move("evaluations", run.done, run.total, ", ".join(run.parts))

    def stage(self, title: str, done: int, total: int) -> None:
        """Moves the bar of a stage."""
        self._move(title, done, total)

    def _move(self, title: str, done: int, total: int, text: str = "") -> None:
        if title not in self._tasks:
            # Begun with what is done, so that the speed counts only what is made now.
            self._tasks[title] = self._bars.add_task(title, completed=done, total=total, text=text)
        self._bars.update(self._tasks[title], completed=done, total=total, text=text)
