"""Figure and files of a comparison of runs."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, NullFormatter, StrMethodFormatter

from tetra_drake.analysis.comparison import Compared, comparison_numbers
from tetra_drake.figures.style import (
    AS_USUAL,
    Drawn,
    Look,
    Page,
    Print,
    figure_function,
    legend_below,
    line_style,
    page_of,
    page_width,
    save_findings,
    set_title,
)

_FIRST = 10  # simulations; the axes of costs begin here
_POWERS = 10.0 ** np.arange(9)
_BESIDE = 5.5  # least width (in) of two panels side by side, with letters of the usual size


def save_comparison(compared: Compared, folder: Path, printed: Print = AS_USUAL) -> list[str]:
    """Writes trials.csv, curves.csv, summary.json (lengths in m) and the figure to a folder.

    Returns the names of the files. Raises InputError if a file cannot be written.
    """
    tables = {"trials": compared.trials, "curves": compared.curves}
    figure, summary = comparison(compared, **vars(printed.look)), comparison_numbers(compared)
    kinds = printed.kinds
    return save_findings(figure, folder, "comparison", tables=tables, summary=summary, kinds=kinds)


@figure_function
def comparison(compared: Compared, *, figure: Page | None = None) -> Drawn:
    """Comparison of runs: the best fitness so far, as median and interquartile band over the trials
    of each run.

    If a distance to reach was given, a second panel shows the share of trials that have reached it.
    Finished trials keep their last values. A dot marks the end of a run."""
    panel_count, unit = 1 if compared.reach is None else 2, compared.scenario.units
    counts = compared.runs["trials"].items()
    labels = [f"{label} ({count} {'trial' if count == 1 else 'trials'})" for label, count in counts]
    is_narrow = page_width(figure) < _BESIDE * rcParams["font.size"] / Look.font_size
    rows, columns = (panel_count, 1) if is_narrow else (1, panel_count)
    page = page_of(figure, height_in=1.2 + 2.2 * rows + 0.1 * len(labels))
    panels = page.subplots(rows, columns, squeeze=False).ravel()
    ends = compared.curves.groupby("run", sort=False)["cost"].max()
    first = min(_FIRST, ends.min())
    for series, label in enumerate(compared.runs.index):
        style = {**line_style(series), "drawstyle": "steps-post", "marker": "o", "markevery": [-1]}
        _draw_best(panels[0], compared, label, first, style)
        if compared.reach is not None:
            _draw_reached(panels[1], compared, label, ends[label], style)
            reached = f"{compared.reach / unit.length:.4g} {unit.length_name}"
            panels[1].set_ylabel(f"{reached} reached (% of trials)")
    decades = math.log10(ends.max() / first)
    ticks = (1.0, 2.0, 5.0) if decades < 2.0 else (1.0, 3.0) if decades < 3.0 else (1.0,)
    for panel in panels:
        panel.set(xlabel="simulations", xscale="log", xlim=(first, 1.1 * ends.max()))
        # A locator that counts ticks by the width leaves a narrow panel without any.
        panel.xaxis.set_major_locator(FixedLocator(np.outer(_POWERS, ticks).ravel().tolist()))
        panel.xaxis.set_major_formatter(StrMethodFormatter("{x:,.0f}"))
        panel.xaxis.set_minor_formatter(NullFormatter())
    panels[0].set_ylabel("best fitness so far")
    legend_below(page, {label: line_style(series) for series, label in enumerate(labels)})
    set_title(page, "How well runs search: median and quartiles over trials")
    return page


def _draw_best(axes: Axes, compared: Compared, label: str, first: int, style: Any) -> None:
    curve = compared.curves[compared.curves["run"] == label].replace(-math.inf, math.nan)
    curve = curve.assign(cost=curve["cost"].clip(lower=first)).drop_duplicates("cost", keep="last")
    axes.plot(curve["cost"], curve["median"], **style)
    band: Any = {"step": "post", "color": style["color"], "alpha": 0.15, "linewidth": 0.0}
    axes.fill_between(curve["cost"], curve["low"], curve["high"], **band)


def _draw_reached(axes: Axes, compared: Compared, label: str, end: int, style: Any) -> None:
    trials = compared.trials[compared.trials["run"] == label]
    there = np.sort(trials["reached"][trials["reached"] <= end])
    shares = 100.0 * np.arange(len(there) + 1) / len(trials)
    axes.plot([0.0, *there, end], [*shares, shares[-1]], **style)
    axes.set_ylim(-3.0, 103.0)
