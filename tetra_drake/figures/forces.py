"""Figures of forces: in the actuated cables and on the ground."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from tetra_drake.figures.style import OKABE_ITO, SHADE, add_grid, common_style, legend_below
from tetra_drake.formatting import fixed
from tetra_drake.results.measures import intervals, off_ground, share_of_time
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.units import POUND_FORCE

_FIRST: Any = {"color": OKABE_ITO["blue"], "linestyle": "-"}
_SECOND: Any = {"color": OKABE_ITO["vermillion"], "linestyle": (0, (4, 1.2))}
_LANDING: Any = {"color": "black", "marker": "v", "markersize": 4.0, "linestyle": ""}

_TOP = 0.94  # height of the marks of landings, as a share of a panel's height
_IMPACTS = 0.01  # share of the samples at either end that does not count for the scale of forces
_MARGIN = 0.25  # free space above and below the others, as a share of their range
_ROWS, _COLUMNS = 10, 4  # largest number of panels one below the other, and of columns
_MIRRORED = 0.01  # mean difference over mean force, below which two nodes are mirror images


@common_style()
def signals_and_tensions(trajectory: xarray.Dataset) -> Figure:
    """Actuation signals and the tension of a cable that each drives (lbf) over time (s).

    One panel per oscillator, with the first of the cables that it drives.
    """
    forces = trajectory[["signal", "tension"]] / POUND_FORCE
    oscillators, signals = forces.oscillator.values, forces.cable_signal.values.tolist()
    driven = [signals.index(oscillator) for oscillator in oscillators]
    groups = len(driven) // len(np.unique(forces.cable_bodies[driven]))
    figure, panels = _panels_over_time(oscillators, groups=groups)
    for cable, (oscillator, panel) in zip(driven, panels.items(), strict=True):
        panel.plot(forces.time, forces.tension[:, cable], **_FIRST)
        panel.plot(forces.time, forces.signal.sel(oscillator=oscillator), **_SECOND)
    legend_below(figure, {"cable tension": _FIRST, "signal": _SECOND})
    swing = np.ptp(forces.signal.values, axis=0).max()
    figure.suptitle(
        f"Signals and tensions of actuated cables\nlargest signal: {fixed(swing)} lbf peak to peak"
    )
    return figure


@common_style()
def ground_forces(trajectory: xarray.Dataset, robot: Robot, *, seconds: float = 5.0) -> Figure:
    """Normal force and friction along x (lbf) over the last seconds of time (s).

    On uneven ground, friction along the forward tangent, which is x projected on the slope. One
    panel per body that can touch, for the first of its nodes that does, and one for each other node
    that touches and is not its mirror image. Shaded: intervals without normal force, with their
    share of the time shown. Triangles: landings. An impact is shorter than the time between two
    samples, so a sample may show or miss its peak. The scale is that of the forces between impacts:
    peaks beyond it are cut off.
    """
    end = trajectory.sel(time=slice(trajectory.time[-1] - seconds, None))
    forces = end[["normal_force", "friction_force"]] / POUND_FORCE
    shown = _contacts_to_show(end)
    along = "along x" if robot.ground.flat else "along the forward tangent"
    _, per_body = np.unique(end.contact_body.sel(contact=shown), return_counts=True)
    figure, panels = _panels_over_time(shown, groups=per_body.min())
    for contact, panel in panels.items():
        node, off = forces.sel(contact=contact), off_ground(end.sel(contact=contact))
        lifted = intervals(off.time.values, off.values)
        for start, stop in lifted:
            panel.axvspan(start, stop, color=SHADE, linewidth=0.0)
        panel.plot(node.time, node.normal_force, **_FIRST)
        panel.plot(node.time, node.friction_force.sel(horizontal="x"), **_SECOND)
        landings = [stop for _, stop in lifted if stop < off.time[-1]]
        above = panel.get_xaxis_transform()
        panel.plot(landings, [_TOP] * len(landings), transform=above, **_LANDING)
        share = fixed(100 * share_of_time(off), 0)
        panel.set_title(f"lifted {share} %", loc="right")
        panel.set_ylim(_limits_between_impacts(forces))
    lines = {"normal force": _FIRST, f"friction force {along}": _SECOND, "landing": _LANDING}
    legend_below(figure, lines, Patch(color=SHADE, label="no normal force"))
    period = 1e3 * float(end.time[1] - end.time[0])
    figure.suptitle(
        "Forces of the ground on each body\n"
        f"every {period:.3g} ms: peaks of impacts, which are shorter, are missed or cut off"
    )
    return figure


def _limits_between_impacts(forces: xarray.Dataset) -> tuple[float, float] | None:
    """Range of the forces of nodes that touch, without impacts; None if no node touches."""
    touching = forces.where(forces.normal_force > 0.0)
    normal, friction = touching.normal_force, touching.friction_force.sel(horizontal="x")
    values = np.concatenate([normal.values.ravel(), friction.values.ravel(), [0.0]])
    low, high = np.nanquantile(values, [_IMPACTS, 1.0 - _IMPACTS])
    margin = _MARGIN * (high - low)
    return (low - margin, high + margin) if margin > 0.0 else None


def _contacts_to_show(trajectory: xarray.Dataset) -> list[str]:
    """Names of the nodes of each body that touch and bear something else than the first of them; of
    its first contact node if none touches."""
    shown: list[str] = []
    for body in dict.fromkeys(trajectory.contact_body.values):
        normal = trajectory.normal_force[:, (trajectory.contact_body == body).values]
        names, forces = normal.contact.values, normal.values.T
        touching = np.flatnonzero((forces > 0.0).any(axis=1))
        first = touching[0] if touching.size else 0
        shown.append(names[first])
        for other in touching[1:]:
            apart = np.abs(forces[other] - forces[first]).mean()
            if apart > _MIRRORED * forces[first].mean():
                shown.append(names[other])
    return shown


def _panels_over_time(names: Sequence[str], *, groups: int) -> tuple[Figure, dict[str, Axes]]:
    """A figure with one panel of forces per name, in a column for each group if these are few."""
    several = 1 < groups <= _COLUMNS
    columns = groups if several else min(math.ceil(len(names) / _ROWS), _COLUMNS)
    rows = math.ceil(len(names) / columns)
    width = 7.5 if columns == 1 else 9.0
    row_height = np.clip(10.0 / rows, 0.75, 1.4)
    figure = Figure(figsize=(width, 1.1 + rows * row_height))
    panels = add_grid(figure, names, columns=columns)
    for panel in list(panels.values())[columns * (rows - 1) :]:
        panel.set_xlabel("time (s)")
    figure.supylabel("force (lbf)")
    return figure, panels
