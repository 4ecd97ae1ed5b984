"""The thesis's Figures 19 and 20: the forces in the cables and on the ground."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from tetra_drake.figures.style import OKABE_ITO, SHADE, common_style, make_figure
from tetra_drake.results.measures import actuated_cable, intervals, off_ground, share_of_time
from tetra_drake.robot.structure import BOTTOM_LEFT, NODES, TIP
from tetra_drake.scenario.units import POUND_FORCE

if TYPE_CHECKING:
    import xarray

SECONDS = 5.0
"""How much of the end of a trajectory Fig. 20 shows, so that single steps can be read."""

_FIRST: Any = {"color": OKABE_ITO["blue"], "linestyle": "-"}
_SECOND: Any = {"color": OKABE_ITO["vermillion"], "linestyle": (0, (4, 1.2))}


@common_style()
def figure_19_signal_and_tension(trajectory: xarray.Dataset) -> Figure:
    """The signals and the tension of the cables that they drive.

    The thesis's Fig. 19: both in lbf over time in s, a panel for each junction, which shows the
    left one of its two actuated cables (the right one is its mirror image).
    """
    junctions = trajectory.junction.values
    rows = len(junctions)
    figure, panels = make_figure(
        width_in=7.5, height_in=1.0 + 1.35 * rows, rows=rows, sharex=True, sharey=True
    )
    for panel, junction in zip(panels[:, 0], junctions, strict=True):
        tension = trajectory.tension.sel(cable=actuated_cable(junction)) / POUND_FORCE
        signal = trajectory.signal.sel(junction=junction) / POUND_FORCE
        panel.plot(trajectory.time, tension, **_FIRST)
        panel.plot(trajectory.time, signal, **_SECOND)
        panel.set_ylabel(f"{junction}\n(lbf)")
    panels[-1, 0].set_xlabel("time (s)")
    _add_legend(
        figure,
        Line2D([], [], label="cable tension", **_FIRST),
        Line2D([], [], label="signal", **_SECOND),
    )
    swing = np.ptp(trajectory.signal.values, axis=0).max() / POUND_FORCE
    figure.suptitle(
        "Signals and tensions of actuated cables (Fig. 19)\n"
        f"largest signal: {swing:.2f} lbf peak to peak (thesis: one pound)"
    )
    return figure


@common_style()
def figure_20_ground_forces(trajectory: xarray.Dataset, *, seconds: float = SECONDS) -> Figure:
    """Normal force and friction on each tetrahedron at the end of the walk.

    The thesis's Fig. 20: both in lbf over time in s, a panel for the bottom left node of each
    tetrahedron (the right one is its mirror image) and one for the tip of the lead; friction
    is along x, positive forward. Shaded is when the node bears no normal force,
    whose share of the time shown is given.
    """
    end = trajectory.sel(time=slice(trajectory.time[-1] - seconds, None))
    bodies = trajectory.tetrahedron.values
    contacts = [f"{body} {NODES[BOTTOM_LEFT]}" for body in bodies] + [f"{bodies[-1]} {NODES[TIP]}"]
    rows = len(contacts)
    figure, panels = make_figure(
        width_in=7.5, height_in=1.0 + 1.35 * rows, rows=rows, sharex=True, sharey=True
    )
    for panel, contact in zip(panels[:, 0], contacts, strict=True):
        _draw_contact(panel, end.sel(contact=contact))
        panel.set_ylabel(f"{contact.replace('_', ' ')}\n(lbf)")
    panels[-1, 0].set_xlabel("time (s)")
    _add_legend(
        figure,
        Line2D([], [], label="normal force", **_FIRST),
        Line2D([], [], label="friction force along x", **_SECOND),
        Patch(color=SHADE, label="no normal force"),
    )
    figure.suptitle("Forces of the ground on each tetrahedron (Fig. 20)")
    return figure


def _draw_contact(panel: Axes, node: xarray.Dataset) -> None:
    normal = node.normal_force / POUND_FORCE
    friction = node.friction_force.sel(horizontal="x") / POUND_FORCE
    off = off_ground(node)
    for start, end in intervals(node.time.values, off.values):
        panel.axvspan(start, end, color=SHADE, linewidth=0.0)
    panel.plot(node.time, normal, **_FIRST)
    panel.plot(node.time, friction, **_SECOND)
    panel.set_title(
        f"off the ground {100 * share_of_time(off):.0f} % of the time shown", loc="right"
    )


def _add_legend(figure: Figure, *handles: Artist) -> None:
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
