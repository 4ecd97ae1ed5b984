"""Gait diagram: signals, stance of the feet, and speed over time."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pandas
import xarray
from matplotlib import rcParams
from matplotlib.axes import Axes
from scipy.integrate import trapezoid

from tetra_drake.figures.style import (
    OKABE_ITO,
    REFERENCE,
    Drawn,
    figure_function,
    folded,
    most_lines,
    name_panel,
    own_words,
    page_of,
    page_width,
    shown_part,
    titled,
    write_beside,
)
from tetra_drake.formatting import fixed
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot import measures
from tetra_drake.robot.measures import Span
from tetra_drake.settings.units import Units

_ROW = 0.165  # height of a row, in inches; a signal or a foot takes one
_ROWS = (4, 20)  # least and greatest height of the panels of signals and of stance, in rows
_NAMED = 14  # largest number of feet, or of lines with names of signals, beside their rows
_NAMES = 0.3  # largest width of the names, as a share of the page's width

_BAR = 0.78  # height of a stance bar, in heights of a row
_EDGE = 0.2  # free height above and below all bars

_LINE: Any = {"color": OKABE_ITO["vermillion"], "linewidth": 1.0, "linestyle": "-"}
_STANCE = {"left": OKABE_ITO["blue"], "right": OKABE_ITO["sky_blue"]}


@figure_function
def gait_diagram(result: SimulationResult, *, time: Span | None = None) -> Drawn:
    """Gait diagram: actuation signals, stance of each foot, and forward speed of the centre of
    mass. A bar shows when a foot bears load. The front body is on top. The duty factor is the share
    of time during which a foot bears load.

    The diagram shows the last three cycles, or the given time span. Cycles are periods of the
    signals; dotted lines mark them. If no signal has two periods in the second half of the
    simulation, the last quarter is shown."""
    structure, cycle = result.robot.structure, measures.last_step(result.trajectory)
    first, end = (float(result.trajectory.time[i]) for i in (0, -1))
    length, title = 0.25 * (end - first), "Gait diagram"
    if cycle is not None:
        period, end = cycle[1] - cycle[0], cycle[1]
        length, title = 3 * period, f"Gait diagram, cycle of {fixed(period)} s"
    trajectory = shown_part(result.trajectory, time or (max(first, end - length), end))
    # Feet are the bottom nodes of tetrahedra, and all other nodes that touch the ground.
    stands = ~measures.off_ground(trajectory)
    are_feet = np.isin(structure.contacts, structure.markers)
    stands = stands[:, stands.any("time").values | are_feet]
    # The first body (the rear) is at the bottom; a left foot is above the right foot.
    of_body, _ = pandas.factorize(stands.contact_body.values)
    order = sorted(range(len(of_body)), key=lambda foot: (of_body[foot], -foot))
    stands = stands[:, order]
    heights = 0.5 + np.arange(len(order)) + 0.5 * of_body[order]  # in rows; gaps between bodies
    names_of_feet = [foot_name(foot) for foot in stands.contact.values]
    named = pandas.Series(heights, names_of_feet)
    if len(order) > _NAMED:  # of many feet, the bodies are named
        named = named.groupby(stands.contact_body.values, sort=False).mean()
    width = _NAMES * page_width()
    named.index = [folded(name, width) for name in named.index]
    height = max(heights, default=0.0) * _rows_of_names(named.index)
    rows = [np.clip(height, *_ROWS), 5]  # stance, speed
    if structure.signals:
        names = [folded(name, width) for name in own_words(structure.oscillators)]
        rows.insert(0, np.clip(structure.signals * _rows_of_names(names), *_ROWS))
    page = page_of(height_in=_ROW * sum(rows) + 1.25)
    panels = page.subplots(len(rows), sharex=True, height_ratios=rows)
    if structure.signals:
        _draw_signals(panels[0], trajectory, names, result.scenario.units)
    _draw_stance(panels[-2], stands, heights, named)
    _draw_speed(panels[-1], trajectory, result)
    start, stop = trajectory.time.values[[0, -1]]
    if cycle is not None:
        marks = np.arange(end % period, stop, period)
        for panel in panels:
            panel.grid(visible=False, axis="x")
            for mark in marks[marks >= start]:
                panel.axvline(mark, color="0.6", linewidth=0.7, linestyle=(0, (1, 2)))
    return titled(page, f"{title}, {start:.3g} to {stop:.3g} s")


def _rows_of_names(names: Iterable[str]) -> float:
    """Height that the name with the most lines needs, in heights of a row of the diagram."""
    return 1.3 * most_lines(names) - 0.3


def _write_names(panel: Axes, names: Sequence[str], rows: Iterable[float]) -> None:
    """Writes names at the y values `rows` of a panel. If they do not all fit, only every second
    name is written, or every third, and so on."""
    fitting = max(1, _NAMED // most_lines(names))
    every = max(1, math.ceil(len(names) / fitting))
    panel.set_yticks(list(rows)[::every], names[::every])


def foot_name(node: str) -> str:
    """Name of a contact node as a foot, such as "T1 left" for the node "T1 bottom_left"."""
    return node.replace("bottom_", "").replace("_", " ")


def _draw_signals(
    panel: Axes, trajectory: xarray.Dataset, names: Sequence[str], unit: Units
) -> None:
    """Draws the actuation signals of a trajectory in one panel, one above the other, with `names`
    beside them, one per signal. The last signal, of the front body, is on top. All have the same
    scale; the panel's name has the largest, in the given unit of force."""
    signals, oscillators = trajectory.signal / unit.force, trajectory.oscillator.values
    largest = float(np.abs(signals.values).max())
    scale = 0.48 / largest if largest else 0.0  # signals do not touch each other
    for row, name in enumerate(oscillators):
        panel.axhline(row, color="0.8", linewidth=0.5)
        panel.plot(signals.time, row + scale * signals.sel(oscillator=name), **_LINE)
    _write_names(panel, names, range(len(names)))
    panel.set_ylim(-0.6, len(oscillators) - 0.4)
    panel.grid(visible=False, axis="y")
    name_panel(panel, f"actuation signals, up to {fixed(largest)} {unit.force_name}")


def _draw_stance(
    panel: Axes, stands: xarray.DataArray, heights: np.ndarray, named: pandas.Series
) -> None:
    """Draws stance bars of the feet in a panel, and names beside it.

    `stands` (time, contact) is True where a foot bears load. `heights` (contact,) are the y values
    of the bars. `named` has the y values of the names, by name: of the feet, which then also get
    their duty factors, or of the bodies if there are many feet.
    """
    name, times = "stance", stands.time.values
    for foot, height in zip(stands.contact.values, heights, strict=True):
        stance = stands.sel(contact=foot)
        spans = [(start, end - start) for start, end in measures.intervals(times, stance.values)]
        colour = _STANCE.get(foot.rpartition("_")[2], "0.35")
        panel.broken_barh(spans, (height - _BAR / 2, _BAR), facecolors=colour)
        if len(heights) <= _NAMED:
            duty = fixed(100.0 * measures.share_of_time(stance), 0)
            write_beside(panel, height, f"{duty} %")
    _write_names(panel, list(named.index), named)
    if len(heights) <= _NAMED:
        panel.set_title("duty factor", loc="right", fontsize=rcParams["ytick.labelsize"])
    elif any(foot.endswith("_left") for foot in stands.contact.values):
        name = "stance, left foot above right one"
    name_panel(panel, name)
    panel.tick_params(axis="y", length=0)
    panel.set_ylim(-_EDGE, max(heights, default=0.5) + 0.5 + _EDGE)
    panel.grid(visible=False, axis="y")


def _draw_speed(panel: Axes, trajectory: xarray.Dataset, result: SimulationResult) -> None:
    structure, unit = result.robot.structure, result.scenario.units
    velocity = np.einsum("tna,n->at", trajectory.v_WN.values, structure.node_shares)
    speed, name, times = velocity[0], "speed along x", trajectory.time.values
    if structure.points_ahead:
        heading = measures.path_of_centre(trajectory, structure).heading
        speed = velocity[0] * np.cos(heading) + velocity[1] * np.sin(heading)
        name = "forward speed"
    speed = speed / unit.length
    mean = float(trapezoid(speed, times) / np.ptp(times))
    panel.axhline(0.0, color="0.8", linewidth=0.5)
    panel.axhline(mean, **REFERENCE)
    panel.plot(times, speed, color="black", linewidth=1.1, linestyle="-")
    write_beside(panel, mean, f"mean\n{fixed(mean, unit.decimals + 1)}")
    panel.set(xlabel="time (s)", xlim=times[[0, -1]])
    name_panel(panel, f"{name} ({unit.length_name}/s)")
