"""Figures of forces: in the actuated cables and on the ground."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from tetra_drake.figures.style import OKABE_ITO, SHADE, common_style, make_figure
from tetra_drake.formatting import fixed
from tetra_drake.results.measures import intervals, off_ground, share_of_time
from tetra_drake.scenario.units import POUND_FORCE

if TYPE_CHECKING:
    import xarray

_FIRST: Any = {"color": OKABE_ITO["blue"], "linestyle": "-"}
_SECOND: Any = {"color": OKABE_ITO["vermillion"], "linestyle": (0, (4, 1.2))}


@common_style()
def signals_and_tensions(trajectory: xarray.Dataset) -> Figure:
    """Actuation signals and the tension of a cable that each drives (lbf) over time (s).

    One panel per junction. A signal drives a left and a right cable, mirror images of each other;
    the left one is shown.
    """
    figure, panels = _panels([str(name) for name in trajectory.junction.values])
    for junction, panel in panels.items():
        driven = np.flatnonzero(trajectory.cable_signal.values == junction)[0]
        panel.plot(trajectory.time, trajectory.tension[:, driven] / POUND_FORCE, **_FIRST)
        panel.plot(
            trajectory.time, trajectory.signal.sel(junction=junction) / POUND_FORCE, **_SECOND
        )
    _add_legend(
        figure,
        Line2D([], [], label="cable tension", **_FIRST),
        Line2D([], [], label="signal", **_SECOND),
    )
    swing = np.ptp(trajectory.signal.values, axis=0).max() / POUND_FORCE
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
    names = [str(name) for name in trajectory.contact.values]
    figure, panels = _panels([name for name in names if not name.endswith(" bottom_right")])
    for contact, panel in panels.items():
        _draw_contact(panel, end.sel(contact=contact))
    _add_legend(
        figure,
        Line2D([], [], label="normal force", **_FIRST),
        Line2D([], [], label="friction force along x", **_SECOND),
        Patch(color=SHADE, label="no normal force"),
    )
    figure.suptitle("Forces of the ground on each tetrahedron")
    return figure


def _draw_contact(panel: Axes, node: xarray.Dataset) -> None:
    off = off_ground(node)
    for start, end in intervals(node.time.values, off.values):
        panel.axvspan(start, end, color=SHADE, linewidth=0.0)
    panel.plot(node.time, node.normal_force / POUND_FORCE, **_FIRST)
    panel.plot(node.time, node.friction_force.sel(horizontal="x") / POUND_FORCE, **_SECOND)
    share = fixed(100 * share_of_time(off), 0)
    panel.set_title(f"off the ground {share} % of the time shown", loc="right")


def _panels(names: list[str]) -> tuple[Figure, dict[str, Axes]]:
    """A figure with one panel per name, one below the other, over time."""
    rows = len(names)
    figure, panels = make_figure(
        width_in=7.5, height_in=1.0 + 1.35 * rows, rows=rows, sharex=True, sharey=True
    )
    for name, panel in zip(names, panels[:, 0], strict=True):
        panel.set_ylabel(f"{name.replace('_', ' ')}\n(lbf)")
    panels[-1, 0].set_xlabel("time (s)")
    return figure, dict(zip(names, panels[:, 0], strict=True))


def _add_legend(figure: Figure, *handles: Artist) -> None:
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
