"""Figures of forces in the actuated cables and at the ground."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.patches import Patch

from tetra_drake.figures.gait_diagram import foot_name
from tetra_drake.figures.style import (
    OKABE_ITO,
    SHADE,
    Drawn,
    Page,
    figure_function,
    folded,
    legend_below,
    most_lines,
    name_panel,
    page_of,
    page_width,
    panels_in_columns,
    shown_part,
    titled,
)
from tetra_drake.formatting import fixed
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.measures import Span, intervals, off_ground, share_of_time
from tetra_drake.settings.units import Units

_SECONDS = 4.0  # length of the part that is shown by default

_FIRST: Any = {"color": OKABE_ITO["blue"], "linestyle": "-"}
_SECOND: Any = {"color": OKABE_ITO["vermillion"], "linestyle": (0, (4, 1.2))}
_LANDING: Any = {"color": "black", "marker": "v", "markersize": 4.0, "linestyle": ""}

_TOP = 0.92  # height of the marks of landings, as a share of a panel's height
_IMPACTS = 0.01  # share of the smallest and of the largest forces that the y axis may cut off
_MARGIN = 0.25  # free space above and below the forces, as a share of their range
_ROWS, _COLUMNS = 10, 4  # largest numbers of rows and columns of panels
_NAME = 0.7  # largest width of a panel's name, as a share of the panel's
_MIRRORED = 0.01  # two nodes share a panel if mean difference / mean force is at most this


@figure_function
def signals_and_tensions(result: SimulationResult, *, time: Span | None = None) -> Drawn:
    """Actuation signals and tensions of the cables that they drive. A panel shows one signal and
    the tension of one cable, whose name is its title. Both are forces; a positive signal shortens
    the cable.

    The figure shows the given time span, by default the last 4 s of the simulation. If a signal
    drives several cables, the first is shown. The start-up, while signals are 0, is shaded."""
    unit, trajectory = result.scenario.units, _shown(result, time)
    forces = trajectory[["signal", "tension"]] / unit.force
    oscillators, signals = forces.oscillator.values, forces.cable_signal.values.tolist()
    driven = [signals.index(oscillator) for oscillator in oscillators]
    groups = len(driven) // len(np.unique(forces.cable_bodies[driven]))
    start_up = result.scenario.cpg.start_up
    is_shown = float(trajectory.time[0]) < start_up
    others = [Patch(color=SHADE, label="start-up")] if is_shown else []
    page, panels = _panels_over_time(forces.cable.values[driven], unit, groups=groups)
    for cable, oscillator, panel in zip(driven, oscillators, panels, strict=True):
        panel.axhline(0.0, color="0.6", linewidth=0.6)
        if others:
            panel.axvspan(float(trajectory.time[0]), start_up, color=SHADE, linewidth=0.0)
        panel.plot(forces.time, forces.tension[:, cable], **_FIRST)
        panel.plot(forces.time, forces.signal.sel(oscillator=oscillator), **_SECOND)
    legend_below(page, {"cable tension": _FIRST, "signal": _SECOND}, *others)
    return titled(page, "Signals and tensions of actuated cables")


@figure_function
def ground_forces(result: SimulationResult, *, time: Span | None = None) -> Drawn:
    """Normal force and friction of the ground on the feet. Friction is along x, the forward
    direction. Grey: stance. Peaks of impacts are cut off, because they are shorter than the time
    between samples.

    The figure shows the given time span, by default the last 4 s of the simulation. On uneven
    ground, friction is along x projected on the slope. Each foot that touches the ground has a
    panel; feet of one body with equal forces share a panel."""
    unit, end = result.scenario.units, _shown(result, time)
    forces = end[["normal_force", "friction_force"]] / unit.force
    feet = _feet_to_show(end)
    _, per_body = np.unique(end.contact_body.sel(contact=list(feet)), return_counts=True)
    names, groups = list(feet.values()), per_body.min()
    page, panels = _panels_over_time(names, unit, groups=groups, beside="stands 100 %")
    touching = forces.where(forces.normal_force > 0.0)
    both = touching.normal_force, touching.friction_force.sel(horizontal="x")
    values = np.concatenate([*(each.values.ravel() for each in both), [0.0]])
    low, high = np.nanquantile(values, [_IMPACTS, 1.0 - _IMPACTS])
    margin = _MARGIN * (high - low)
    for foot, panel in zip(feet, panels, strict=True):
        node, stands = forces.sel(contact=foot), ~off_ground(end.sel(contact=foot))
        spans = intervals(stands.time.values, stands.values)
        for start, stop in spans:
            panel.axvspan(start, stop, color=SHADE, linewidth=0.0)
        panel.plot(node.time, node.normal_force, **_FIRST)
        panel.plot(node.time, node.friction_force.sel(horizontal="x"), **_SECOND)
        landings = [start for start, _ in spans if start > stands.time[0]]
        above = panel.get_xaxis_transform()
        panel.plot(landings, [_TOP] * len(landings), transform=above, **_LANDING)
        share = fixed(100.0 * share_of_time(stands), 0)
        panel.set_title(f"stands {share} %", loc="right", fontsize="small", pad=3.0)
        if margin > 0.0:
            panel.set_ylim(low - margin, high + margin)
    along = "along x" if result.robot.ground.flat else "along the forward tangent"
    looks = {"normal force": _FIRST, f"friction {along}": _SECOND, "landing": _LANDING}
    legend_below(page, looks, Patch(color=SHADE, label="stance"))
    start, stop = end.time.values[[0, -1]]
    return titled(page, f"Forces of the ground, {start:.3g} to {stop:.3g} s")


def _shown(result: SimulationResult, time: Span | None) -> xarray.Dataset:
    """The part of a result's trajectory between the two times (s) of `time`, by default its last
    4 s."""
    end = float(result.trajectory.time[-1])
    return shown_part(result.trajectory, time or (max(0.0, end - _SECONDS), end))


def _feet_to_show(trajectory: xarray.Dataset) -> dict[str, str]:
    """Contact nodes to show: a dict from the node's name to the title of its panel. A node that
    touches the ground is shown, unless it has the same normal force as the first touching node of
    its body; that node's title then names both. If no node touches, the first node is shown."""
    feet: dict[str, str] = {}
    for body in dict.fromkeys(trajectory.contact_body.values):
        normal = trajectory.normal_force[:, (trajectory.contact_body == body).values]
        names, forces = normal.contact.values, normal.values.T
        touching = np.flatnonzero((forces > 0.0).any(axis=1))
        for node in touching:
            first = touching[0]
            difference = np.abs(forces[node] - forces[first]).mean()
            if node != first and difference <= _MIRRORED * forces[first].mean():
                feet[names[first]] += f" = {foot_name(names[node]).removeprefix(f'{body} ')}"
            else:
                feet[names[node]] = foot_name(names[node])
    first_node = trajectory.contact.values[0]
    return feet or {first_node: foot_name(first_node)}


def _panels_over_time(
    names: Sequence[str], units: Units, *, groups: int, beside: str = ""
) -> tuple[Page, list[Axes]]:
    """A new figure, and its empty panels for forces over time, one per name, in columns.

    With 2 to 4 `groups` of panels, one per signal or body for example, there is a column for each.
    `names` are the titles of the panels, `units` gives the unit of force in the label. `beside` is
    a text that the caller writes to the right of each name; the name gets a line of its own if both
    do not fit.
    """
    several = 1 < groups <= _COLUMNS
    columns = groups if several else min(math.ceil(len(names) / _ROWS), _COLUMNS)
    rows = math.ceil(len(names) / columns)
    width = _NAME / columns * page_width()
    names = [folded(name.replace("_", " "), width) for name in names]
    if most_lines(folded(f"{name} {beside}", width) for name in names) > most_lines(names):
        names = [f"{name}\n" for name in names]
    row = 1.05 + 0.15 * most_lines(names)
    page = page_of(height_in=1.0 + min(row * rows, 9.0))
    shared: Any = {"sharex": True, "sharey": True}
    panels = panels_in_columns(page, len(names), columns, x_label="time (s)", **shared)
    panels[0].figure.supylabel(f"force ({units.force_name})")
    for name, panel in zip(names, panels, strict=True):
        name_panel(panel, name)
        panel.set_xmargin(0.0)
    return page, panels
