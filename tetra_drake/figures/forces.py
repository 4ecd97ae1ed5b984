"""Figures of forces: in the actuated cables and on the ground."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from tetra_drake.figures.style import OKABE_ITO, SHADE, common_style, legend_below, make_figure
from tetra_drake.formatting import fixed
from tetra_drake.results.measures import intervals, off_ground, share_of_time
from tetra_drake.scenario.units import POUND_FORCE

_FIRST: Any = {"color": OKABE_ITO["blue"], "linestyle": "-"}
_SECOND: Any = {"color": OKABE_ITO["vermillion"], "linestyle": (0, (4, 1.2))}


@common_style()
def signals_and_tensions(trajectory: xarray.Dataset) -> Figure:
    """Actuation signals and the tension of a cable that each drives (lbf) over time (s).

    One panel per junction. A signal drives a left and a right cable, mirror images of each other;
    the left one is shown.
    """
    forces = trajectory[["signal", "tension"]] / POUND_FORCE
    figure, panels = _panels_over_time(forces.junction.values)
    for junction, panel in panels.items():
        driven = np.flatnonzero(forces.cable_signal == junction)[0]
        panel.plot(forces.time, forces.tension[:, driven], **_FIRST)
        panel.plot(forces.time, forces.signal.sel(junction=junction), **_SECOND)
    legend_below(figure, {"cable tension": _FIRST, "signal": _SECOND})
    swing = np.ptp(forces.signal.values, axis=0).max()
    figure.suptitle(
        f"Signals and tensions of actuated cables\nlargest signal: {fixed(swing)} lbf peak to peak"
    )
    return figure


@common_style()
def ground_forces(trajectory: xarray.Dataset, *, seconds: float = 5.0) -> Figure:
    """Normal force and friction along x (lbf) over the last `seconds` of time (s).

    One panel per tetrahedron, for its bottom left node (the right one is its mirror image), and
    one for each other contact node. Shaded: intervals without normal force.
    """
    end = trajectory.sel(time=slice(trajectory.time[-1] - seconds, None))
    forces = end[["normal_force", "friction_force"]] / POUND_FORCE
    shown = [name for name in end.contact.values if not name.endswith(" bottom_right")]
    figure, panels = _panels_over_time(shown)
    for contact, panel in panels.items():
        node, off = forces.sel(contact=contact), off_ground(end.sel(contact=contact))
        for interval in intervals(off.time.values, off.values):
            panel.axvspan(*interval, color=SHADE, linewidth=0.0)
        panel.plot(node.time, node.normal_force, **_FIRST)
        panel.plot(node.time, node.friction_force.sel(horizontal="x"), **_SECOND)
        share = fixed(100 * share_of_time(off), 0)
        panel.set_title(f"off the ground {share} % of the time shown", loc="right")
    lines = {"normal force": _FIRST, "friction force along x": _SECOND}
    legend_below(figure, lines, Patch(color=SHADE, label="no normal force"))
    figure.suptitle("Forces of the ground on each tetrahedron")
    return figure


def _panels_over_time(names: Sequence[str]) -> tuple[Figure, dict[str, Axes]]:
    """A figure with one panel of forces per name, one below the other."""
    height = 1.0 + 1.35 * len(names)
    figure, panels = make_figure(
        width_in=7.5, height_in=height, rows=len(names), sharex=True, sharey=True
    )
    for name, panel in zip(names, panels[:, 0], strict=True):
        panel.set_ylabel(f"{name.replace('_', ' ')}\n(lbf)")
    panel.set_xlabel("time (s)")
    return figure, dict(zip(names, panels[:, 0], strict=True))
