"""The figure of what a run's gaits trade distance against."""

from __future__ import annotations

from typing import Any

import pandas
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from tetra_drake.evolution.pareto import (
    NEAREST,
    Trade,
    champions,
    distinct_gaits,
    forward_gaits,
    front_of,
    trades,
)
from tetra_drake.evolution.tables import Run, gait_label
from tetra_drake.figures.style import OKABE_ITO, common_style, make_figure, round_logarithmic
from tetra_drake.formatting import listed

_SHOWN = 0.95
"""At least this share of the gaits is within the axes: what hardly walks costs any amount."""

_WIDE = 8.0
"""An axis whose ends have a greater ratio is logarithmic."""

_FRONT: Any = {"color": "black", "linewidth": 1.0, "marker": ".", "markersize": 5.0}
_NEAREST: Any = {"color": "0.4", "linewidth": 1.0, "linestyle": ":"}
_MARKS: dict[str, Any] = {
    name: {"marker": marker, "color": OKABE_ITO[colour], "markersize": size}
    | {"linestyle": "", "fillstyle": "none", "markeredgewidth": 1.6}
    for name, marker, colour, size in (
        ("fittest", "o", "vermillion", 8.0),
        ("farthest", "^", "blue", 12.0),
        ("cheapest", "s", "green", 10.0),
        ("steadiest", "D", "purple", 9.0),
    )
}
"""Hollow, as one gait may lie over another's."""


@common_style()
def pareto(run: Run) -> Figure:
    """Distance against cost of transport and, in a run with disturbances, against steadiness; all
    evaluations that walk forward, but for up to 5 % beyond the axes.

    The line is the front: no gait of the run goes farther and is better in the other number, too.
    The cheapest and the steadiest gait are found among those that walk at least half as far as the
    farthest, above the dotted line. Steadiness is the distance in a gait's worst draw as a share of
    its mean distance, by the draws of its own iteration."""
    gaits = forward_gaits(run.evaluations)
    fittest = run.evaluation(*run.fittest())
    marked = distinct_gaits({"fittest": fittest} | champions(run))
    panels = trades(gaits)
    figure, [row] = make_figure(width_in=7.0, height_in=4.4, columns=len(panels), sharey=True)
    for axes, trade in zip(row, panels, strict=True):
        _draw(axes, gaits, trade)
        for names, gait in marked:
            axes.plot(trade.of(gait), gait["distance_in"], **_MARKS[names[0]])
    farthest = gaits["distance_in"].max()
    row[0].set(
        ylabel=f"distance in {run.manifest.scenario.simulation.duration:g} s (in)",
        ylim=(0.0, 1.06 * farthest),
    )
    labels = {f"{listed(n)}: {gait_label(gait)}": _MARKS[n[0]] for n, gait in marked}
    labels |= {"front": _FRONT, f"{100 * NEAREST:g} % of the farthest": _NEAREST}
    handles = [Line2D([], [], label=text, **style) for text, style in labels.items()]
    figure.legend(handles=handles, loc="outside lower center", ncols=2)
    others = " and ".join(trade.name for trade in panels)
    figure.suptitle(f"Distance against {others}\n{len(gaits)} gaits that walk forward")
    return figure


def _draw(axes: Axes, gaits: pandas.DataFrame, trade: Trade) -> None:
    """Draws gaits and front in the plane of a trade."""
    front, numbers = front_of(gaits, trade), trade.of(gaits)
    # One picture within the SVG, as there are tens of thousands.
    faint: Any = {"color": "0.4", "alpha": 0.4, "markersize": 3.5, "rasterized": True}
    axes.plot(numbers, gaits["distance_in"], ".", markeredgewidth=0.0, **faint)
    axes.axhline(NEAREST * gaits["distance_in"].max(), **_NEAREST)
    # What is a little worse than one gait of the front goes as far as that gait.
    axes.step(trade.of(front), front["distance_in"], where="pre", **_FRONT)
    worst = numbers.quantile(_SHOWN if trade.wanted < 0.0 else 1.0 - _SHOWN)
    shown = [*trade.of(front), worst]
    low, high = min(shown), max(shown)
    if low > 0.0 and high > _WIDE * low:
        margin = (high / low) ** 0.04
        axes.set(xscale="log", xlim=(low / margin, high * margin))
        round_logarithmic(axes.xaxis, "{x:g}")
    else:
        margin = 0.04 * (high - low or 1.0)
        axes.set(xlim=(low - margin, high + margin))
    axes.set(xlabel=trade.name)
