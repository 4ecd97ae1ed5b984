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

from tetra_drake.errors import InputError
from tetra_drake.figures.block_diagram import save_block_diagram
from tetra_drake.figures.contact import figure_06_sliding
from tetra_drake.figures.style import save_figure
from tetra_drake.parts.single_tetrahedron import MakeTetrahedronDiagram, Motion
from tetra_drake.parts.sliding_tetrahedron import LEADING, flights, slide, slips, travel
from tetra_drake.robot.structure import BASE, NODES
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.units import INCH


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
    motion = slide(scenario)
    figure = figure_06_sliding(motion, stiction_range=scenario.friction.stiction_range)
    try:
        diagram = MakeTetrahedronDiagram(scenario)
        save_block_diagram(diagram, options.out / "sliding_tetrahedron.svg")
        save_figure(figure, options.out, "figure_06", kinds=["svg"])
    except InputError as error:
        parser.error(str(error))
    print(report(motion))
    return 0


if __name__ == "__main__":
    sys.exit(main())
