"""Draws of a scenario's disturbances: their seeds, their numbers, and the scenario changed by one.

Draws of evolution have the seeds (run's seed, trial, iteration, k), so that all gaits of an
iteration have the same. Those by which gaits are judged have seeds of their own, which no run has.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tetra_drake.scenario.common_sections import separate
from tetra_drake.scenario.scenario import Scenario

IterationSeed = tuple[int, int, int]
"""Seed of a run, number of a trial, number of an iteration."""


@dataclass(frozen=True)
class Draw:
    """The changes of one draw."""

    factors: Mapping[str, float]
    """Factors by the keys of `disturbances.spreads`."""
    moves: np.ndarray | None = None
    """(n, 3): the displacement of each body at t = 0, in m."""
    terrain_seed: int | None = None


def draw_disturbances(scenario: Scenario, seed: Sequence[int]) -> Draw:
    """The draw of a seed; none of its numbers depends on the scenario's values."""
    settings = scenario.disturbances
    if settings is None:
        return Draw({})
    factors = {}
    for joined, spread in settings.spreads.items():
        factors[joined] = 1.0 + _stream(seed, *separate(joined)).uniform(-spread, spread)
    moves = _stream(seed, "start").uniform(-1.0, 1.0, (scenario.robot.body_count, 3))
    moves[:, 2] = np.abs(moves[:, 2])  # not into the ground
    reach = settings.start * scenario.robot.size
    terrain_seed = int(_stream(seed, "terrain").integers(2**31))
    return Draw(
        factors=factors,
        moves=reach * moves if reach else None,
        terrain_seed=terrain_seed if hasattr(scenario.terrain, "seed") else None,
    )


def _stream(seed: Sequence[int], *names: str) -> np.random.Generator:
    """The random numbers by which a draw changes what has these names: the same ones whatever else
    is disturbed."""
    digest = hashlib.sha256(",".join(sorted(names)).encode()).digest()
    words = np.frombuffer(digest, dtype="<u4")
    return np.random.default_rng(np.random.SeedSequence(list(seed), spawn_key=words.tolist()))


def disturbed(scenario: Scenario, draw: Draw) -> Scenario:
    """A copy of the scenario changed by a draw, without disturbances of its own.

    Its values are not checked again: those of the largest changes are when a scenario is loaded.
    """
    numbers = scenario.numbers()
    changed = scenario.with_numbers(
        {
            key: factor * numbers[key]
            for joined, factor in draw.factors.items()
            for key in separate(joined)
        }
    )
    robot, terrain = changed.robot, changed.terrain
    if draw.moves is not None:
        offsets = draw.moves + (robot.offsets or np.zeros_like(draw.moves))
        robot = robot.model_copy(update={"offsets": offsets.tolist()})
    if draw.terrain_seed is not None:
        terrain = terrain.model_copy(update={"seed": draw.terrain_seed})
    return changed.with_sections(robot=robot, terrain=terrain, disturbances=None)


def draws_of_iteration(scenario: Scenario, seed: IterationSeed) -> list[Scenario]:
    """The scenario in each of its draws in an iteration of an evolution."""
    draws = [draw_disturbances(scenario, (*seed, k)) for k in range(scenario.draws)]
    return [disturbed(scenario, draw) for draw in draws]


def fresh_draws(scenario: Scenario, seed: int, count: int) -> list[Draw]:
    """Draws that no evolution has seen, whatever its seed."""
    return [draw_disturbances(scenario, fresh_seed(seed, k)) for k in range(count)]


def fresh_seed(seed: int, k: int) -> tuple[int, ...]:
    """The seed of a fresh draw: six numbers, the last not 0, so that it never equals one of
    evolution. Those have four, of which numpy splits the first in two above 2³², and pads with
    zeros."""
    return seed, k, 0, 0, 0, 1
