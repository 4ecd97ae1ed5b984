"""Showing a run while it lasts: a live table on a terminal, plain lines elsewhere."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from types import TracebackType
from typing import TYPE_CHECKING, Protocol, TextIO

from tetra_drake.evolution.trial import TrialStatus

if TYPE_CHECKING:
    from rich.table import Table

_LINE_PERIOD = 10.0  # s, between plain lines of one trial
_FRAME_PERIOD = 0.5  # s, between frames of the live table

_COLUMNS = (
    "trial",
    "iteration",
    "mean fitness",
    "best fitness",
    "best distance",
    "evaluations per s",
    "time left",
    "failed",
)


class Progress(Protocol):
    """Is entered when a run begins and then shown where the trials stand, again and again."""

    def __enter__(self) -> Progress: ...

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None: ...

    def show(self, statuses: Sequence[TrialStatus]) -> None:
        """Called about once a second and whenever something was evaluated."""
        ...


def make_progress(stream: TextIO) -> Progress:
    """The display that suits the stream."""
    return LiveProgress() if stream.isatty() else PlainProgress(stream)


class SilentProgress:
    """Shows nothing."""

    def __enter__(self) -> Progress:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        return None

    def show(self, statuses: Sequence[TrialStatus]) -> None:
        """Does nothing."""


class PlainProgress(SilentProgress):
    """A line for each trial every ten seconds, and when it ends."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._started = time.monotonic()
        self._shown: dict[int, tuple[float, int, bool]] = {}

    def show(self, statuses: Sequence[TrialStatus]) -> None:
        """Prints the trials of which there is news."""
        now = time.monotonic()
        for status in statuses:
            last, evaluations, over = self._shown.get(status.number, (now, -1, False))
            ended = status.stop is not None
            due = now - last >= _LINE_PERIOD and status.evaluations != evaluations
            if status.number not in self._shown:
                self._shown[status.number] = now, status.evaluations, ended
            elif (due or ended) and not over:
                self._shown[status.number] = now, status.evaluations, ended
                print(plain_line(status, now - self._started), file=self._stream, flush=True)


class LiveProgress(SilentProgress):
    """A table that is redrawn in place."""

    def __init__(self) -> None:
        from rich.live import Live

        self._live = Live(auto_refresh=False)
        self._started = self._drawn = time.monotonic()
        self._statuses: Sequence[TrialStatus] = ()

    def __enter__(self) -> Progress:
        self._live.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._draw()
        self._live.stop()

    def show(self, statuses: Sequence[TrialStatus]) -> None:
        """Redraws the table, not more often than is of use."""
        self._statuses = statuses
        if time.monotonic() - self._drawn >= _FRAME_PERIOD:
            self._draw()

    def _draw(self) -> None:
        self._drawn = time.monotonic()
        self._live.update(_table(self._statuses, self._drawn - self._started), refresh=True)


def cells(status: TrialStatus, elapsed: float) -> list[str]:
    """A trial's row of the table. `elapsed` is the time in s since this process began."""
    made = status.evaluations - status.recalled
    rate = made / elapsed if elapsed > 0.0 else 0.0
    if status.stop is not None:
        left = status.stop
    elif rate > 0.0:
        left = duration((status.evaluations_at_most - status.evaluations) / rate)
    else:
        left = "-"
    iteration = str(status.iteration)
    if status.iteration < 0:
        iteration = f"0 ({status.evaluations} done)"
    return [
        f"{status.number}",
        iteration,
        number(status.mean_fitness),
        number(status.best_fitness),
        f"{number(status.best_distance_in)} in",
        f"{rate:.2f}",
        left,
        f"{status.failures}",
    ]


def plain_line(status: TrialStatus, elapsed: float) -> str:
    """The same row as a line of text."""
    trial, iteration, mean, best, distance, rate, left, failed = cells(status, elapsed)
    line = f"trial {trial}: iteration {iteration}, mean fitness {mean}, best {best}, "
    line += f"best distance {distance}, {rate} evaluations/s, "
    line += left if status.stop is not None else f"{left} left"
    return line + (f", {failed} failed" if status.failures else "")


def number(value: float) -> str:
    """Two decimals, or a dash for what is not there yet."""
    return f"{value:.2f}" if math.isfinite(value) else "-"


def duration(seconds: float) -> str:
    """A time as hours, minutes and seconds: 1:02:03."""
    minutes, second = divmod(round(seconds), 60)
    hour, minute = divmod(minutes, 60)
    return f"{hour}:{minute:02d}:{second:02d}"


def _table(statuses: Sequence[TrialStatus], elapsed: float) -> Table:
    from rich.table import Table

    table = Table()
    for column in _COLUMNS:
        table.add_column(column, justify="right")
    for status in statuses:
        table.add_row(*cells(status, elapsed))
    return table
