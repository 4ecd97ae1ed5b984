"""The thesis's Figures 5 and 6: a tetrahedron alone on the ground."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tetra_drake import thesis
from tetra_drake.figures.style import OKABE_ITO, SHADE, common_style, make_figure
from tetra_drake.parts.settling_node import NODE, first_contact
from tetra_drake.parts.single_tetrahedron import Motion
from tetra_drake.parts.sliding_tetrahedron import LEADING, TRAILING, flights, slips, travel
from tetra_drake.scenario.units import INCH, POUND_FORCE


@common_style()
def figure_05_settling(settling: Motion, bouncing: Motion) -> Figure:
    """Displacement and normal force of one node while a tetrahedron settles on the ground.

    The thesis's Fig. 5: height in thousandths of an inch, zero where the node's centre
    touches, and normal force in lbf over time in ms. `bouncing`, the same impact without weight, is
    the one that Eq. 2's restitution is about.
    """
    figure, panels = make_figure(width_in=7.0, height_in=5.0, rows=2, sharex=True)
    above, below = panels[:, 0]
    for motion, label, style in (
        (settling, "settling under its weight", {"color": OKABE_ITO["blue"]}),
        (bouncing, "without weight", {"color": OKABE_ITO["vermillion"], "linestyle": "--"}),
    ):
        milliseconds = 1e3 * motion.times
        above.plot(milliseconds, 1e3 * motion.p_WN[:, NODE, 2] / INCH, label=label, **style)
        below.plot(milliseconds, motion.normal_forces[:, NODE] / POUND_FORCE, **style)
    depths = 1e3 * settling.p_WN[:, NODE, 2] / INCH
    # Without weight it flies away: the axis shows the settling.
    swing = np.ptp(depths) or 1.0
    above.set_ylim(depths.min() - 0.2 * swing, depths.max() + 0.4 * swing)
    above.axhline(0.0, color="black", linewidth=0.8)
    above.set_ylabel("height of the node (0.001 in)")
    above.legend(loc="upper right")
    below.set_ylabel("normal force (lbf)")
    below.set_xlabel("time (ms)")
    figure.suptitle(f"Ground contact of a settling node (Fig. 5)\n{_settling_note(bouncing)}")
    return figure


def _settling_note(bouncing: Motion) -> str:
    impact, rebound = first_contact(bouncing)
    restitution = "none" if math.isnan(rebound) else f"{rebound / impact:.2f}"
    return (
        f"impact at {impact / INCH:.3f} in/s (thesis: about "
        f"{thesis.SETTLING_IMPACT_SPEED_IN_S:g}); restitution, without weight, {restitution} "
        f"(thesis: {thesis.SETTLING_RESTITUTION:g})"
    )


@common_style()
def figure_06_sliding(motion: Motion, *, stiction_range: float) -> Figure:
    """Velocity, friction force and travel of two nodes of a sliding tetrahedron.

    The thesis's Fig. 6 shows velocity (in/s) and friction force (lbf, here on a scale that is
    linear only near 0) over time (ms). On the left the leading node breaks free,
    on the right it slips and sticks again; `stiction_range` (m) is the travel at
    which a node breaks free.
    """
    figure, panels = make_figure(width_in=8.0, height_in=6.5, rows=3, columns=2, sharex="col")
    times = slips(motion, LEADING)
    free = times[0][0] if times else 1e-3
    nodes = (LEADING, TRAILING)
    ends = [end for node in nodes for _, end in slips(motion, node) + flights(motion, node)]
    stuck = max(ends, default=motion.times[-1])
    column: list[Axes]
    for column, title, end in (
        (list(panels[:, 0]), "breaking free", 2.2 * free),
        (list(panels[:, 1]), "the whole motion", min(1.4 * stuck, motion.times[-1])),
    ):
        column[0].set_title(title)
        column[2].set_xlabel("time (ms)")
        column[2].set_xlim(0.0, 1e3 * end)
        for node, label, style in (
            (LEADING, "leading node", {"color": OKABE_ITO["blue"]}),
            (TRAILING, "trailing node", {"color": OKABE_ITO["vermillion"], "linestyle": "--"}),
        ):
            _draw_node(column, motion, node, label=label, **style)
        _mark_slips(column, times)
    _limit(panels, motion, free=free, stiction_range=stiction_range)
    _mark_flight(panels[1, 0], motion)
    for panel, label in zip(
        panels[:, 0], ("velocity (in/s)", "friction force (lbf)", "travel (0.001 in)"), strict=True
    ):
        panel.set_ylabel(label)
    panels[0, 0].legend(loc="upper right")
    panels[2, 0].legend(handles=panels[2, 0].lines[-1:], loc="upper left")
    figure.align_ylabels()
    figure.suptitle(
        f"Friction on the nodes of a sliding tetrahedron (Fig. 6)\n{_sliding_note(motion)}"
    )
    return figure


def _draw_node(
    column: Sequence[Axes], motion: Motion, node: int, *, label: str, **style: Any
) -> None:
    milliseconds = 1e3 * motion.times
    for panel, values in zip(
        column,
        (
            motion.v_WN[:, node, 0] / INCH,
            motion.friction_forces[:, node, 0] / POUND_FORCE,
            1e3 * travel(motion, node) / INCH,
        ),
        strict=True,
    ):
        panel.plot(milliseconds, values, label=label, **style)


def _mark_slips(column: Sequence[Axes], times: list[tuple[float, float]]) -> None:
    for panel in column:
        for start, end in times:
            panel.axvspan(
                1e3 * start,
                1e3 * end,
                color=SHADE,
                linewidth=0.0,
                label="leading node slips",
            )


def _mark_flight(panel: Axes, motion: Motion) -> None:
    """Says why there is no friction at the trailing node."""
    for start, end in flights(motion, TRAILING):
        end = min(end, panel.get_xlim()[1] / 1e3)
        if start < end:
            place = (1e3 * (start + end) / 2, 0.0)
            panel.annotate(
                "trailing node off the ground",
                place,
                (0, 4),
                textcoords="offset points",
                ha="center",
            )


def _limit(panels: np.ndarray, motion: Motion, *, free: float, stiction_range: float) -> None:
    """Axes that show what matters: the start is far faster, and friction then far greater."""
    for panel in panels[1]:
        panel.set_yscale("symlog", linthresh=1e-3)
        panel.set_yticks([-10.0, -0.1, -1e-3, 0.0, 1e-3, 0.1], minor=False)
    after = motion.v_WN[motion.times >= free][:, [LEADING, TRAILING], 0] / INCH
    least, most = after.min(), after.max()
    margin = 0.15 * (most - least)
    panels[0, 1].set_ylim(least - margin, most + 2.5 * margin)
    panels[0, 1].annotate(
        f"from {motion.v_WN[0, LEADING, 0] / INCH:g} in/s",
        xy=(0.005, most + 1.5 * margin),
        xycoords=("axes fraction", "data"),
        xytext=(25, 0),
        textcoords="offset points",
        va="center",
        arrowprops={"arrowstyle": "->"},
    )
    panels[2, 0].set_ylim(0.0, 2e3 * stiction_range / INCH)
    panels[2, 0].axhline(
        1e3 * stiction_range / INCH, color="black", linestyle=":", label="stiction range"
    )


def _sliding_note(motion: Motion) -> str:
    distance = travel(motion, LEADING)[-1] / INCH
    return (
        f"it slides {distance:.3f} in (thesis: a node breaks free, sticks again and comes to rest; "
        "no numbers)"
    )
