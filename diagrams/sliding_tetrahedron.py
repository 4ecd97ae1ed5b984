"""A tetrahedron sliding to rest: its nodes break free, slip, and stick again (thesis Figure 6).

    python diagrams/sliding_tetrahedron.py [--speed "20 in/s"] [--law "!Coulomb"] [--live]

The diagram is made by one_tetrahedron.py. The tetrahedron starts at 30 in/s. Stiction brakes it to
1 in/s within a millisecond and tips it. So its two trailing nodes lift off. The leading node
reaches the stiction range, 0.004 in, after 0.9 ms and breaks free. It slips for 49 ms, faster and
faster, while the tetrahedron falls back: friction in slip is three hundred times weaker than in
stick. The trailing nodes stick when they land. Then the leading node reverses its motion and sticks
again. Below 23 in/s no node breaks free.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
from block_diagram import OUT
from live import open_meshcat
from matplotlib.figure import Figure
from one_tetrahedron import BASE, LEADING, TRAILING, Samples, let_go, weight
from pydrake.geometry import Meshcat

from tetra_drake.errors import InputError
from tetra_drake.figures.style import SHADE, common_style, make_figure, save_figure
from tetra_drake.options import quantity
from tetra_drake.robot.measures import intervals
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.robot_tetrahedra import NODES
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.settings.units import INCH, POUND_FORCE

INITIAL_SPEED = 30.0 * INCH  # m/s


def slide(
    scenario: Scenario,
    *,
    speed: float = INITIAL_SPEED,
    duration: float = 0.1,
    meshcat: Meshcat | None = None,
) -> Samples:
    """Simulates a start at a forward `speed` (m/s), at the height where the ground bears the
    weight."""
    depth = weight(scenario) / (len(BASE) * scenario.ground.stiffness)
    velocity = [speed, 0.0, 0.0]
    return let_go(scenario, height=-depth, velocity=velocity, duration=duration, meshcat=meshcat)


def slips(motion: Samples, node: int) -> list[tuple[float, float]]:
    """Intervals (s) during which a contact node slips along x."""
    return intervals(motion.times, motion.modes[:, node, 1] != 0.0)


def flights(motion: Samples, node: int) -> list[tuple[float, float]]:
    """Intervals (s) during which a contact node is off the ground."""
    return intervals(motion.times, motion.modes[:, node, 0] == 0.0)


def travel(motion: Samples, node: int) -> np.ndarray:
    """Displacement of a node along x (samples,), in m."""
    return motion.p_WN[:, node, 0] - motion.p_WN[0, node, 0]


@common_style()
def draw(motion: Samples, *, stiction_range: float | None) -> Figure:
    """Draws velocity, friction and displacement of two nodes: at the start, and until rest."""
    figure, axes = make_figure(width_in=8.0, height_in=6.5, rows=3, columns=2, sharex="col")
    milliseconds = 1e3 * motion.times
    for node, label in ((LEADING, "leading node"), (TRAILING, "trailing node")):
        rows = (
            ("velocity (in/s)", motion.v_WN[:, node, 0] / INCH),
            ("friction force (lbf)", motion.friction_forces[:, node, 0] / POUND_FORCE),
            ("travel (0.001 in)", 1e3 * travel(motion, node) / INCH),
        )
        for (name, values), panels in zip(rows, axes, strict=True):
            panels[0].set_ylabel(name)
            for panel in panels:
                panel.plot(milliseconds, values, label=label)
    for panel in axes.flat:
        for start, end in slips(motion, LEADING):
            panel.axvspan(1e3 * start, 1e3 * end, color=SHADE, label="leading node slips")
    for panel in axes[1]:
        panel.set_yscale("symlog", linthresh=1e-3)
        panel.set_yticks([-10.0, -0.1, -1e-3, 0.0, 1e-3, 0.1], minor=False)
    if stiction_range is not None:
        limit = 1e3 * stiction_range / INCH
        line = axes[2, 0].axhline(limit, color="black", linestyle=":", label="stiction range")
        axes[2, 0].legend(handles=[line])
        axes[2, 0].set_ylim(0.0, 2.0 * limit)
        axes[0, 1].set_ylim(-2.0, 10.0)
    for column, (title, end) in enumerate((("breaking free", 2.0), ("the whole motion", 80.0))):
        axes[0, column].set_title(title)
        axes[2, column].set(xlim=(0.0, end), xlabel="time (ms)")
    axes[0, 0].legend()
    figure.align_ylabels()
    figure.suptitle("Friction on the nodes of a sliding tetrahedron (thesis Fig. 6)")
    return figure


def main(
    out: Path = OUT,
    *,
    speed: float = INITIAL_SPEED,
    slope: float = 0.0,
    law: str = "!ResetIntegrator",
    live: bool = False,
) -> None:
    """Simulates the motion, prints when which node slips, and writes the picture.

    The tetrahedron starts uphill on a `slope` (rad), with a law of friction as in a scenario file.
    With `live`, Meshcat shows it first.
    """
    ground = f"!Incline {{slope: {slope} rad}}" if slope else "!Flat"
    scenario = load_scenario("thesis").with_changes({"friction": law, "terrain": ground})
    motion = slide(scenario, speed=speed, meshcat=open_meshcat() if live else None)
    figure = draw(motion, stiction_range=getattr(scenario.friction, "stiction_range", None))
    save_figure(figure, out, "sliding_tetrahedron_motion", kinds=["svg"])
    for node in BASE:
        for what, spans in (("slips", slips(motion, node)), ("flies", flights(motion, node))):
            for start, end in spans:
                print(f"{NODES[node]} {what} from {1e3 * start:.1f} to {1e3 * end:.1f} ms")
    print(f"all come to rest after {travel(motion, LEADING)[-1] / INCH:.3f} in")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    speed = quantity("m/s", "10 in/s", least="-10 m/s", most="10 m/s")
    slope = quantity("rad", "5 deg", least="-45 deg", most="45 deg")
    parser.add_argument("--speed", type=speed, default=INITIAL_SPEED, help="such as '10 in/s'")
    parser.add_argument("--slope", type=slope, default=0.0, help="of the ground, such as '5 deg'")
    law = "friction of a scenario, such as '!Coulomb' (default: %(default)s)"
    parser.add_argument("--law", default="!ResetIntegrator", help=law)
    parser.add_argument("--live", action="store_true", help="show it in Meshcat while it runs")
    parser.add_argument("--out", type=Path, default=OUT, help="folder for the figures")
    try:
        main(**vars(parser.parse_args()))
    except InputError as error:
        sys.exit(f"sliding_tetrahedron.py: {error}")
