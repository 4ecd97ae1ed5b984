"""Random draws of a scenario's disturbances, and the scenarios that they change.

In evolution, draw k has the seed (run's seed, trial, iteration, k), so all gaits of an iteration
have the same draws. Draws for judging gaits have other seeds, which no evolution uses.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tetra_drake.scenario.events import Event
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.settings.quantities import separate
from tetra_drake.settings.section import value_at

IterationSeed = tuple[int, int, int]
"""Seed of an iteration's draws: seed of the run, number of the trial, number of the iteration."""


@dataclass(frozen=True)
class Draw:
    """One set of random changes of robot and surroundings."""

    factors: Mapping[str, float]
    """Factor of the number at each key of `disturbances.spreads`."""
    moves: np.ndarray | None = None
    """Displacement of each body at t = 0 (n, 3), in m."""
    terrain_seed: int | None = None
    sensing_seed: int | None = None
    events: tuple[Event, ...] = ()
    """Events in addition to the scenario's: cables that break."""


def draw_disturbances(scenario: Scenario, seed: Sequence[int]) -> Draw:
    """The draw (set of random changes) that a seed, a few integers, gives for the scenario's
    `disturbances` and its `sensing`. Without them it changes nothing. Its factors do not depend on
    the scenario's numbers."""
    settings = scenario.disturbances
    sensing_seed = int(stream(seed, "sensing").integers(2**31)) if scenario.sensing else None
    if settings is None:
        return Draw({}, sensing_seed=sensing_seed)
    factors = {}
    for joined, spread in settings.spreads.items():
        factors[joined] = 1.0 + stream(seed, *separate(joined)).uniform(-spread, spread)
    moves = stream(seed, "start").uniform(-1.0, 1.0, (scenario.robot.body_count, 3))
    moves[:, 2] = np.abs(moves[:, 2])  # not into the ground
    events: tuple[Event, ...] = ()
    if (cuts := settings.cuts) is not None:
        names = scenario.whole_cables
        chosen = sorted(stream(seed, "cuts").choice(len(names), cuts.count, replace=False))
        events = (Event(at=cuts.at, cut=[names[number] for number in chosen]),)
    reach = settings.start * scenario.robot.size
    terrain_seed = int(stream(seed, "terrain").integers(2**31))
    return Draw(
        factors=factors,
        moves=reach * moves if reach else None,
        terrain_seed=terrain_seed if hasattr(scenario.terrain, "seed") else None,
        sensing_seed=sensing_seed,
        events=events,
    )


def stream(seed: Sequence[int], *names: str) -> np.random.Generator:
    """Random generator for the disturbance or the tolerance of the scenario keys `names`, or for
    "start", "terrain", "sensing" or "cuts". Its numbers do not depend on what else is random."""
    digest = hashlib.sha256(",".join(sorted(names)).encode()).digest()
    words = np.frombuffer(digest, dtype="<u4")
    return np.random.default_rng(np.random.SeedSequence(list(seed), spawn_key=words.tolist()))


def disturbed(scenario: Scenario, draw: Draw) -> Scenario:
    """A copy of the scenario with the changes of a draw, and without `disturbances`.

    The values are not checked: the largest changes were checked when the scenario was loaded.
    """
    tree = scenario.model_dump()
    factors = [(key, x) for joined, x in draw.factors.items() for key in separate(joined)]
    values: dict[str, Any] = {key: x * value_at(tree, key) for key, x in factors}
    if draw.moves is not None:
        offsets = draw.moves + (scenario.robot.offsets or np.zeros_like(draw.moves))
        values["robot.offsets"] = offsets.tolist()
    if draw.terrain_seed is not None:
        values["terrain.seed"] = draw.terrain_seed
    if draw.sensing_seed is not None and scenario.sensing is not None:
        values["sensing.seed"] = draw.sensing_seed
    changed = scenario.with_numbers(values)
    return changed.with_sections(events=[*changed.events, *draw.events], disturbances=None)


def draws_of_iteration(scenario: Scenario, seed: IterationSeed) -> list[Scenario]:
    """The disturbed scenarios of one iteration of an evolution, one per draw (set of random
    changes). Every gait of the iteration is simulated on each. `seed` has the seed of the run and
    the numbers of trial and iteration."""
    draws = [draw_disturbances(scenario, (*seed, k)) for k in range(scenario.draw_count)]
    return [disturbed(scenario, draw) for draw in draws]


def fresh_draws(scenario: Scenario, seed: int, count: int) -> list[Draw]:
    """`count` draws (sets of random changes) of disturbances, to test evolved gaits on. The same
    `seed` gives the same draws. No evolution uses them, whatever its seed."""
    return [draw_disturbances(scenario, fresh_seed(seed, k)) for k in range(count)]


def fresh_seed(seed: int, k: int) -> tuple[int, ...]:
    """Seed of draw k in fresh_draws(): six numbers, the last 1.

    No draw of an evolution has such a seed. Its seeds have four numbers (five after numpy splits a
    large first one). Numpy pads them with zeros, so the sixth number is 0 there.
    """
    return seed, k, 0, 0, 0, 1
