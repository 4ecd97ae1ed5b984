"""Quality-diversity through pyribs: CMA-MAE."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tetra_drake.optimizers.base import Evaluation, Iteration
from tetra_drake.optimizers.generational import Generational, Matrix
from tetra_drake.robot.gait import ParameterSpace, Vector
from tetra_drake.scenario import optimizer_kinds as kinds
from tetra_drake.scenario.settings import EvolutionSection

INSTALL = 'pip install "tetra_drake[qd]"'

FLOOR = 0.0
"""The fitness that gaits on the map exceed: the level of all cells at the start."""

LEARNING_RATE = 0.01
"""Share of the way to a better gait's fitness by which it raises the level of its cell."""

EMITTERS = 4
"""Runs of CMA-ES side by side."""

BATCH = 15
"""Vectors of each emitter in an iteration."""

SIGMA = 0.5
"""Standard deviation at the start; starts are random gaits, later gaits of the map."""


class QualityDiversity(Generational):
    """Emitters that draw a part of each batch each, and an archive that says how far each vector is
    above the level of its cell.

    A failure, or what lacks a measure, never enters the archive; it counts as farther below than
    all others. Reports besides elites, the number of cells with a gait.
    """

    def __init__(
        self,
        space: ParameterSpace,
        evolution: EvolutionSection,
        generator: np.random.Generator,
        settings: kinds.QualityDiversity | None = None,
    ) -> None:
        from ribs.archives import GridArchive
        from ribs.emitters import EvolutionStrategyEmitter

        super().__init__(space, evolution, generator)
        self._settings = settings = settings or kinds.QualityDiversity()
        self._roots: Matrix = np.empty((0, self._ranges.size))
        """Roots of the points drawn last; see Ranges.from_roots()."""
        self._told: dict[str, Any] = {}
        self._added: dict[str, Any] = {}
        self._archive = GridArchive(
            solution_dim=self._ranges.size,
            dims=settings.cells,
            ranges=[(low, high) for low, high in settings.measures.values()],
            threshold_min=FLOOR,
            learning_rate=LEARNING_RATE,
            seed=self._seed(),
        )
        self._emitters = [
            EvolutionStrategyEmitter(
                self._archive,
                x0=self._ranges.roots(self._random(1))[0],
                sigma0=SIGMA,
                ranker="imp",
                selection_rule="mu",
                restart_rule="basic",
                batch_size=BATCH,
                seed=self._seed(),
            )
            for _ in range(EMITTERS)
        ]

    def _seed(self) -> int:
        return int(self._generator.integers(2**63))

    def _draw(self) -> Matrix:
        self._roots = np.concatenate([emitter.ask() for emitter in self._emitters])
        return self._ranges.from_roots(self._roots)

    def tell(self, evaluations: Sequence[Evaluation]) -> Iteration:
        """Takes a batch."""
        names = self._settings.measures
        wanted = np.array(
            [[each.fitness, *map(each.metrics.get, names)] for each in evaluations], dtype=float
        )
        known = np.isfinite(wanted).all(axis=1)
        self._told = dict(
            zip(("objective", "measures"), (wanted[:, 0], wanted[:, 1:]), strict=True)
        )
        self._added = {"status": np.zeros(len(known), np.int32), "value": np.zeros(len(known))}
        if known.any():
            chosen = {key: values[known] for key, values in self._told.items()}
            added = self._archive.add(solution=self._roots[: len(known)][known], **chosen)
            for key, values in added.items():
                self._added[key][known] = values
            self._added["value"][~known] = np.min(added["value"]) - 1.0
            self._told["objective"][~known] = np.min(chosen["objective"])
            self._told["measures"][~known] = chosen["measures"][0]  # no emitter looks at them
        return super().tell(evaluations)

    def _learn(self, fitnesses: Vector) -> None:
        if self._archive.empty:
            return
        told = {"solution": self._roots, **self._told}
        for i, emitter in enumerate(self._emitters):
            own = slice(i * BATCH, (i + 1) * BATCH)
            added = {key: values[own] for key, values in self._added.items()}
            emitter.tell(**{key: values[own] for key, values in told.items()}, add_info=added)

    def _state(self) -> Mapping[str, Any]:
        return {"elites": len(self._archive)}
