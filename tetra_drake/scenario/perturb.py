"""Scenarios that differ a little: scaled values, displaced starts."""

from __future__ import annotations

from collections.abc import Iterable
from operator import attrgetter

import numpy as np

from tetra_drake.scenario.schema import Scenario


def scaled(scenario: Scenario, keys: Iterable[str], factor: float) -> Scenario:
    """The scenario with the values of dotted keys multiplied by `factor`."""
    return scenario.with_changes({key: attrgetter(key)(scenario) * factor for key in keys})


def displaced(scenario: Scenario, *, percent: float, seed: int) -> Scenario:
    """The scenario with every tetrahedron displaced at t = 0, drawn at random with `seed`.

    Forward or back, sideways, and up, each by up to `percent` of the spacing.
    """
    reach = percent / 100.0 * scenario.robot.spacing
    moves = np.random.default_rng(seed).uniform(-reach, reach, (scenario.robot.tetrahedra, 3))
    moves[:, 2] = np.abs(moves[:, 2])  # not into the ground
    return scenario.with_changes({"robot.offsets": moves})
