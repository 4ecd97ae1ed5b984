"""Loose bars that may touch each other: structures whose cables are slack."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from helpers.anchored import BAR, scenario_of
from tetra_drake.laws.capsules import HuntCrossley
from tetra_drake.laws.terrain import Flat, Nothing
from tetra_drake.robot.robot import Robot

RADIUS = 0.5 * BAR["diameter"]
"""Radius of a bar in m."""
STIFFNESS = 10_000.0
"""Stiffness of the contact of two bars in N/m."""

CROSSED = {"a0": "xy", "b0": "y", "a1": "xy", "b1": "y", "a2": "xy", "b2": "x"}
"""Anchors of two bars along x and one along y that hold them in place, but not in height. Without
friction the upper one would slide to the ends of the others, which give way more there."""

Ends = tuple[tuple[float, float, float], tuple[float, float, float]]
ACROSS: tuple[Ends, Ends] = (
    ((-0.1, 0.0, 0.0), (0.1, 0.0, 0.0)),
    ((0.0, -0.1, 0.02), (0.0, 0.1, 0.02)),
)
"""Two bars of 0.2 m that cross at their middles, 12 mm apart."""


def loose_bars(
    ends: Sequence[Ends],
    *,
    dissipation: float,
    gravity: float = 0.0,
    duration: float = 2.0,
    anchors: Mapping[str, str] = MappingProxyType({}),
) -> Robot:
    """A robot of bars between ends (m): a0 and b0, a1 and b1, and so on. They touch by the law of
    Hunt and Crossley, with a dissipation in s/m. Without gravity there is no ground."""
    nodes = {f"a{i}": list(pair[0]) for i, pair in enumerate(ends)}
    nodes |= {f"b{i}": list(pair[1]) for i, pair in enumerate(ends)}
    struts = {f"bar{i}": BAR | {"pairs": [[f"a{i}", f"b{i}"]]} for i in range(len(ends))}
    pairs = [["a0", f"a{i}"] for i in range(1, len(ends))]
    loose = {"pairs": pairs, "stiffness": 1.0, "damping": 0.0, "free_length": 99.0}
    tree = {"nodes": nodes, "struts": struts, "cables": {"loose": loose}, "gravity": gravity}
    changes = {"engine.tolerance": "1e-6 m/s", "engine.max_step": "1 ms"}
    changes |= {"simulation.sample_period": "1 ms", "terrain": Flat() if gravity else Nothing()}
    changes["strut_contact"] = HuntCrossley(stiffness=STIFFNESS, dissipation=dissipation)
    return Robot.of(scenario_of(tree | {"anchors": dict(anchors)}, duration, **changes))
