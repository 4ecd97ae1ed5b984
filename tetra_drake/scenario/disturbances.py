"""Draws of a scenario's disturbances, and the scenario changed by one."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter

import numpy as np

from tetra_drake.scenario.schema import Scenario, separate


@dataclass(frozen=True)
class Draw:
    """What one draw changes."""

    factors: Mapping[str, float]
    """By the keys of `disturbances.spreads`."""
    moves: np.ndarray | None = None
    """(n, 3): the displacement of each tetrahedron at t = 0, in m."""
    terrain_seed: int | None = None


def draw_disturbances(scenario: Scenario, seed: Sequence[int]) -> Draw:
    """The draw of a seed; none of its numbers depends on the scenario's values."""
    settings, generator = scenario.disturbances, np.random.default_rng(list(seed))
    if settings is None:
        return Draw({})
    # All that can be drawn is drawn, so that no change of one setting changes another's numbers.
    moves = generator.uniform(-1.0, 1.0, (scenario.robot.tetrahedra, 3))
    terrain_seed = int(generator.integers(2**31))
    moves[:, 2] = np.abs(moves[:, 2])  # not into the ground
    reach = settings.start * scenario.robot.spacing
    sizes = {key: generator.uniform(-size, size) for key, size in settings.spreads.items()}
    return Draw(
        factors={key: 1.0 + size for key, size in sizes.items()},
        moves=reach * moves if reach else None,
        terrain_seed=terrain_seed if settings.terrain else None,
    )


def disturbed(scenario: Scenario, draw: Draw) -> Scenario:
    """A copy of the scenario changed by a draw, without disturbances of its own.

    Its values are not checked again: those of the largest changes are when a scenario is loaded.
    """
    sections = {name: copy.copy(section) for name, section in vars(scenario).items()}
    changed = dataclasses.replace(scenario, **sections | {"disturbances": None})
    for joined, factor in draw.factors.items():
        for key in separate(joined):
            section, _, name = key.partition(".")
            setattr(getattr(changed, section), name, factor * attrgetter(key)(scenario))
    if draw.moves is not None:
        offsets = scenario.robot.offsets or np.zeros_like(draw.moves)
        changed.robot.offsets = (draw.moves + offsets).tolist()
    if draw.terrain_seed is not None:
        setattr(changed.terrain, "seed", draw.terrain_seed)  # noqa: B010 (kinds with a seed only)
    return changed
