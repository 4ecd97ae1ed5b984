"""A tetrahedron let go just above the ground: impact and settling of its nodes (thesis Figure 5).

    python diagrams/settling_node.py

The diagram is made by one_tetrahedron.py. Three nodes share the weight and move in the same way.

An impact at a low speed v has the restitution e = 1 - alpha v (thesis Eq. 2), if weight is
neglected. Here the weight alone presses the nodes 0.0006 in into the ground, four times deeper than
the impact. The nodes never leave the ground again. Therefore the impact is repeated without
gravity.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import numpy as np
from block_diagram import OUT, save_block_diagram
from matplotlib.figure import Figure
from one_tetrahedron import TRAILING, Samples, let_go, make_diagram

from tetra_drake.figures.style import common_style, make_figure, save_figure
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.settings.units import INCH, POUND_FORCE

IMPACT_SPEED = 0.12 * INCH  # m/s, as in the thesis
THESIS_RESTITUTION = 0.9
DURATION = 0.04  # s


def settle(scenario: Scenario) -> Samples:
    """Simulates a fall from rest. It reaches the ground with IMPACT_SPEED."""
    height = IMPACT_SPEED**2 / (2.0 * scenario.robot.gravity)
    return let_go(scenario, height=height, velocity=[0.0, 0.0, 0.0], duration=DURATION)


def bounce(scenario: Scenario, *, speed: float = IMPACT_SPEED) -> Samples:
    """Simulates an impact at `speed` (m/s) without gravity, 0.3 ms after the start."""
    weightless = scenario.with_changes({"robot.gravity": 0.0})
    velocity = [0.0, 0.0, -speed]
    return let_go(weightless, height=3e-4 * speed, velocity=velocity, duration=DURATION)


def contact_speeds(motion: Samples) -> tuple[float, float]:
    """Speeds (m/s) of a node when it first touches the ground, and when it leaves it. The second is
    NaN if it never leaves."""
    height, rate = motion.p_WN[:, TRAILING, 2], motion.v_WN[:, TRAILING, 2]
    first = int(np.argmax(height <= 0.0))
    above = np.flatnonzero(height[first:] > 0.0)
    return -float(rate[first]), float(rate[first + above[0]]) if above.size else math.nan


def velocity_correction(scenario: Scenario) -> float:
    """Coefficient alpha of Eq. 2 (s/m): the ground's damping is 3/2 alpha times its stiffness."""
    return scenario.ground.damping / (1.5 * scenario.ground.stiffness)


@common_style()
def draw(settling: Samples, bouncing: Samples) -> Figure:
    """Draws height and normal force of one node over time."""
    figure, axes = make_figure(width_in=7.0, height_in=5.0, rows=2, sharex=True)
    above, below = axes[:, 0]
    for motion, label in ((settling, "settling under its weight"), (bouncing, "without weight")):
        milliseconds = 1e3 * motion.times
        above.plot(milliseconds, 1e3 * motion.p_WN[:, TRAILING, 2] / INCH, label=label)
        below.plot(milliseconds, motion.normal_forces[:, TRAILING] / POUND_FORCE)
    above.axhline(0.0, color="black", linestyle="-", linewidth=0.8)
    # Without weight it flies away.
    above.set(ylim=(-1.1, 0.5), ylabel="height of the node (0.001 in)")
    above.legend(loc="upper right")
    below.set(ylabel="normal force (lbf)", xlabel="time (ms)")
    figure.suptitle("Ground contact of a settling node (thesis Fig. 5)")
    return figure


def main(out: Path = OUT) -> None:
    """Simulates both impacts, prints their numbers and writes the pictures."""
    scenario = load_scenario("thesis")
    save_block_diagram(make_diagram(scenario), out / "one_tetrahedron.svg")
    settling, bouncing = settle(scenario), bounce(scenario)
    save_figure(draw(settling, bouncing), out, "settling_node_motion", kinds=["svg"])

    speed, rebound = contact_speeds(bouncing)
    linear = 1.0 - velocity_correction(scenario) * speed
    print(f"impact at {contact_speeds(settling)[0] / INCH:.3f} in/s (thesis: about 0.12)")
    print(f"at rest {-settling.p_WN[-1, TRAILING, 2] / INCH:.5f} in deep")
    print(f"restitution without weight {rebound / speed:.3f} (thesis: {THESIS_RESTITUTION:g})")
    print(f"the same by Eq. 2, 1 - alpha v: {linear:.3f}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", nargs="?", type=Path, default=OUT)
    main(parser.parse_args().out)
