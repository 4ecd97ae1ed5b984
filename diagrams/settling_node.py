"""One tetrahedron let go from just above the ground (thesis Fig. 5).

It stands on its base triangle, so that the three nodes it lands on share its weight and move
alike. Writes the block diagram and the figure, and prints impact speed and restitution
beside the thesis's.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from pathlib import Path

from tetra_drake import thesis
from tetra_drake.errors import InputError
from tetra_drake.figures.block_diagram import save_block_diagram
from tetra_drake.figures.contact import figure_05_settling
from tetra_drake.figures.style import save_figure
from tetra_drake.parts.settling_node import NODE, bounce, first_contact, settle
from tetra_drake.parts.single_tetrahedron import MakeTetrahedronDiagram, Motion, weight
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.units import INCH


def report(scenario: Scenario, settling: Motion, bouncing: Motion) -> str:
    """Impact speed, restitution and final load, the thesis's beside ours."""
    impact, rebound = first_contact(settling)
    speed, speed_after = first_contact(bouncing)
    linear = 1.0 - scenario.ground.velocity_correction * speed
    load = settling.normal_forces[-1].sum() / weight(scenario)
    depth = -settling.p_WN[-1, NODE, 2]
    after = "it does not leave the ground again" if math.isnan(rebound) else "it leaves it again"
    return (
        f"impact speed {impact / INCH:.3f} in/s "
        f"(thesis: about {thesis.SETTLING_IMPACT_SPEED_IN_S:g}); {after}; it rests "
        f"{depth / INCH:.5f} in deep on {load:.3f} of its weight\n"
        f"restitution without weight {speed_after / speed:.3f} "
        f"(Eq. 2, e = 1 - alpha v: {linear:.3f}; thesis: {thesis.SETTLING_RESTITUTION:g})"
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Writes the pictures and prints the numbers."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", metavar="DIR", type=Path, default=Path(__file__).parent)
    options = parser.parse_args(arguments)
    scenario = load_scenario("thesis")
    settling, bouncing = settle(scenario), bounce(scenario)
    figure = figure_05_settling(settling, bouncing)
    try:
        save_block_diagram(MakeTetrahedronDiagram(scenario), options.out / "settling_node.svg")
        save_figure(figure, options.out, "figure_05", kinds=["svg"])
    except InputError as error:
        parser.error(str(error))
    print(report(scenario, settling, bouncing))
    return 0


if __name__ == "__main__":
    sys.exit(main())
