"""A tetrahedron sliding to rest under each reading of the thesis's friction (thesis Figure 6).

    python diagrams/sliding_tetrahedron.py [--speed "20 in/s"] [--law "!Coulomb"] [--live]

The diagram is made by one_tetrahedron.py. The tetrahedron starts at 30 in/s. Stiction brakes it to
1 in/s within a millisecond and tips it. So its two trailing nodes lift off. The leading node
reaches the stiction range, 0.004 in, after 0.9 ms and breaks free. What then happens depends on the
reading:

- `reset: range`, the text's: the deflection becomes 0, and the node sticks again at once. It rests
  after 0.005 in. A faster start, at 100 in/s, breaks free five times: the deflection is a sawtooth.
- `reset: reversal` and `never`: the node slips for 49 ms, faster and faster, while the tetrahedron
  falls back, because friction in slip is three hundred times weaker than in stick. It sticks again
  when it reverses its motion.

Below 23 in/s no node breaks free.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
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

INITIAL_SPEED, FAST = 30.0 * INCH, 100.0 * INCH  # m/s
READINGS = ("range", "reversal", "never")
"""Values of `friction.reset`."""


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


def deflections(motion: Samples, node: int) -> np.ndarray:
    """Deflection of the bristle of a contact node along x (samples,), in m; NaN while the node
    slips, which keeps the deflection, and in the air."""
    stuck = motion.p_WN[:, node, 0] - motion.stick_points[:, node]
    holds = (motion.modes[:, node, 0] != 0.0) & (motion.modes[:, node, 1] == 0.0)
    return np.where(holds, stuck, np.nan)


@common_style()
def draw(motions: Mapping[str, Samples]) -> Figure:
    """Draws velocity and friction of two nodes and the bristle of the leading one, a column per
    motion. The time axis is logarithmic, so that it shows the first contact and the rest."""
    figure, axes = make_figure(
        width_in=3.0 * len(motions) + 2.0,
        height_in=6.5,
        rows=3,
        columns=len(motions),
    )
    for (title, motion), panels in zip(motions.items(), axes.T, strict=True):
        milliseconds = 1e3 * motion.times
        for node, label in ((LEADING, "leading node"), (TRAILING, "trailing node")):
            panels[0].plot(milliseconds, motion.v_WN[:, node, 0] / INCH, label=label)
            panels[1].plot(milliseconds, motion.friction_forces[:, node, 0] / POUND_FORCE)
        panels[2].plot(milliseconds, 1e3 * deflections(motion, LEADING) / INCH)
        for panel in panels:
            for start, end in slips(motion, LEADING):
                panel.axvspan(1e3 * start, 1e3 * end, color=SHADE, label="leading node slips")
            panel.set(xscale="log", xlim=(0.02, 80.0))
        panels[0].set_yscale("symlog", linthresh=1.0)
        panels[1].set_yscale("symlog", linthresh=1e-3)
        panels[2].set_ylim(-0.5, 5.0)
        panels[0].set_title(title)
        panels[2].set_xlabel("time (ms)")
    rows = ("velocity (in/s)", "friction force (lbf)", "deflection (0.001 in)")
    for panel, name in zip(axes[:, 0], rows, strict=True):
        panel.set_ylabel(name)
    axes[0, 0].legend()
    figure.align_ylabels()
    figure.suptitle("Friction on the nodes of a sliding tetrahedron (thesis Fig. 6)")
    return figure


def main(
    out: Path = OUT,
    *,
    speed: float | None = None,
    slope: float = 0.0,
    law: str | None = None,
    live: bool = False,
) -> None:
    """Simulates the motion, prints when which node slips, and writes the picture.

    The tetrahedron starts uphill on a `slope` (rad), with a law of friction as in a scenario file,
    or with each of the READINGS. With `live`, Meshcat shows it first.
    """
    ground = f"!Incline {{slope: {slope} rad}}" if slope else "!Flat"
    level = load_scenario("thesis").with_changes({"terrain": ground})
    starts = {f"reset: {reset}": ({"friction.reset": reset}, speed) for reset in READINGS}
    if speed is None:
        starts["reset: range, at 100 in/s"] = {"friction.reset": "range"}, FAST
    if law is not None:
        starts = {law: ({"friction": law}, speed)}
    motions = {}
    for name, (changes, first) in starts.items():
        scenario, first = level.with_changes(changes), first or INITIAL_SPEED
        meshcat = open_meshcat() if live else None
        motions[name] = motion = slide(scenario, speed=first, meshcat=meshcat)
        for node in BASE:
            for what, spans in (("slips", slips(motion, node)), ("flies", flights(motion, node))):
                for start, end in spans:
                    print(f"{NODES[node]} {what} from {1e3 * start:.1f} to {1e3 * end:.1f} ms")
        print(f"{name}: all come to rest after {travel(motion, LEADING)[-1] / INCH:.3f} in")
    save_figure(draw(motions), out, "sliding_tetrahedron_motion", kinds=["svg"])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    speed = quantity("m/s", "10 in/s", least="-10 m/s", most="10 m/s")
    slope = quantity("rad", "5 deg", least="-45 deg", most="45 deg")
    parser.add_argument("--speed", type=speed, help="such as '10 in/s'")
    parser.add_argument("--slope", type=slope, default=0.0, help="of the ground, such as '5 deg'")
    law = "friction of a scenario, such as '!Coulomb' (default: each reading of the thesis)"
    parser.add_argument("--law", help=law)
    parser.add_argument("--live", action="store_true", help="show it in Meshcat while it runs")
    parser.add_argument("--out", type=Path, default=OUT, help="folder for the figures")
    try:
        main(**vars(parser.parse_args()))
    except InputError as error:
        sys.exit(f"sliding_tetrahedron.py: {error}")
