"""One tetrahedron sliding on the ground until it comes to rest (thesis Fig. 6).

It stands on its base triangle, one node ahead of the other two, and starts fast: a node that
sticks is braked within a millisecond, so that it takes 23 in/s to break one free. Writes
the block diagram and the figure, and prints when which node slips.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from settling_node import MakeTetrahedron, MakeTetrahedronDiagram, Motion, simulate

from tetra_drake.errors import InputError
from tetra_drake.figures.block_diagram import save_block_diagram
from tetra_drake.files import whole_file
from tetra_drake.robot import BASE, BOTTOM_LEFT, NODES, TOP, tetrahedron_inertia
from tetra_drake.scenario import Scenario, load_scenario
from tetra_drake.units import INCH, POUND_FORCE

INITIAL_SPEED = 30.0 * INCH
"""m/s, forward."""

DURATION = 0.1  # s

LEADING, TRAILING = TOP, BOTTOM_LEFT
"""The two nodes the figure shows; the third moves as the trailing one does."""


def slide(scenario: Scenario, *, speed: float, duration: float = DURATION) -> Motion:
    """Gives the tetrahedron, at rest on the ground, a forward `speed` (m/s)."""
    robot, ground = scenario.robot, scenario.ground
    mass = tetrahedron_inertia(MakeTetrahedron(scenario)).get_mass()
    depth = mass * robot.gravity / (len(BASE) * ground.stiffness)
    return simulate(scenario, height=-depth, velocity=[speed, 0.0, 0.0], duration=duration)


def intervals(motion: Motion, active: np.ndarray) -> list[tuple[float, float]]:
    """When `active`, (samples,), holds: starts and ends in s.

    A sample shows the modes of the step that ends there, so a mode begins one sample
    before it shows.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], active, [False]]).astype(int)))
    times = motion.times[np.maximum(edges - 1, 0)]
    return [(float(a), float(b)) for a, b in times.reshape(-1, 2)]


def slips(motion: Motion, node: int) -> list[tuple[float, float]]:
    """When the contact node slips along x: starts and ends in s."""
    return intervals(motion, motion.modes[:, node, 1] != 0.0)


def flights(motion: Motion, node: int) -> list[tuple[float, float]]:
    """When the contact node is off the ground: starts and ends in s."""
    return intervals(motion, motion.modes[:, node, 0] == 0.0)


def travel(motion: Motion, node: int) -> np.ndarray:
    """(samples,): how far the node has come along x, in m."""
    return motion.p_WN[:, node, 0] - motion.p_WN[0, node, 0]


def draw(motion: Motion, *, stiction_range: float) -> Figure:
    """Velocity, friction force and travel of two nodes: breaking free, and in the whole.

    The travel at which a node breaks free, `stiction_range`, is in m.
    """
    with style.context("tableau-colorblind10"):
        figure = Figure(figsize=(10, 7), layout="constrained")
        panels = figure.subplots(3, 2, sharex="col")
        for column, title, end in (
            (panels[:, 0], "breaking free", 2e-3),
            (panels[:, 1], "slipping and sticking again", 0.07),
        ):
            column[0].set_title(title)
            for node, line in ((LEADING, "-"), (TRAILING, "--")):
                _draw_node(column, motion, node, line)
            _mark_slips(column, motion)
            column[2].set_xlabel("time (ms)")
            column[2].set_xlim(0.0, 1e3 * end)
    speed = motion.v_WN[0, LEADING, 0] / INCH
    panels[0, 1].set_ylim(-1.0, 6.0)
    arrow = {"arrowstyle": "->"}
    panels[0, 1].annotate(f"from {speed:g} in/s", (0.3, 5.4), (4.0, 5.2), arrowprops=arrow)
    panels[2, 0].set_ylim(0.0, 8.0)
    panels[2, 0].axhline(
        1e3 * stiction_range / INCH, color="black", linestyle=":", label="stiction range"
    )
    panels[0, 0].set_ylabel("velocity (in/s)")
    panels[1, 0].set_ylabel("friction force (lbf)")
    panels[2, 0].set_ylabel("travel (0.001 in)")
    panels[0, 0].legend()
    panels[2, 0].legend(handles=panels[2, 0].lines[-1:])
    return figure


def _draw_node(column: Sequence[Axes], motion: Motion, node: int, line: str) -> None:
    milliseconds = 1e3 * motion.times
    label = "leading node" if node == LEADING else "trailing node"
    column[0].plot(milliseconds, motion.v_WN[:, node, 0] / INCH, line, label=label)
    column[1].plot(milliseconds, motion.friction_forces[:, node, 0] / POUND_FORCE, line)
    column[1].set_yscale("symlog", linthresh=1e-3)
    column[2].plot(milliseconds, 1e3 * travel(motion, node) / INCH, line)


def _mark_slips(column: Sequence[Axes], motion: Motion) -> None:
    for panel in column:
        panel.grid(alpha=0.4)
        for start, end in slips(motion, LEADING):
            panel.axvspan(1e3 * start, 1e3 * end, color="0.9", label="leading node slips")


def report(motion: Motion) -> str:
    """When each node slips and flies, and where the tetrahedron comes to rest."""
    lines = []
    for node in BASE:
        spans = {"slips": slips(motion, node), "is off the ground": flights(motion, node)}
        parts = [
            f"{what} from {1e3 * start:.1f} to {1e3 * end:.1f} ms"
            for what, times in spans.items()
            for start, end in times
        ]
        lines.append(f"{NODES[node]}: {', '.join(parts) or 'sticks throughout'}")
    speed = motion.v_WN[0, LEADING, 0] / INCH
    distance = travel(motion, LEADING)[-1] / INCH
    lines.append(
        f"from {speed:g} in/s to rest in {distance:.3f} in; thesis: 'breaks free of, and "
        "re-enters static friction before coming to a rest', without numbers"
    )
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Writes the pictures and prints the numbers."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", metavar="DIR", type=Path, default=Path(__file__).parent)
    options = parser.parse_args(arguments)
    scenario = load_scenario("thesis")
    motion = slide(scenario, speed=INITIAL_SPEED)
    diagram = MakeTetrahedronDiagram(scenario)
    try:
        save_block_diagram(diagram, options.out / "sliding_tetrahedron.svg")
        with whole_file(options.out / "sliding_tetrahedron.png") as file:
            figure = draw(motion, stiction_range=scenario.friction.stiction_range)
            figure.savefig(file, dpi=90)
    except InputError as error:
        parser.error(str(error))
    print(report(motion))
    return 0


if __name__ == "__main__":
    sys.exit(main())
