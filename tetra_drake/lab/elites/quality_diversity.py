"""Quality-diversity search with CMA-MAE from pyribs: a map of gaits over two metrics."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence

import numpy as np

from tetra_drake.errors import InputError
from tetra_drake.optimizers.base import Evaluation, Iteration
from tetra_drake.optimizers.generational import Generational, Matrix
from tetra_drake.scenario import optimizer_kinds as kinds
from tetra_drake.scenario.metrics import METRICS

FLOOR = 0.0
"""Fitness that a gait must exceed to enter the map; the initial threshold of every cell."""

LEARNING_RATE = 0.01
"""Learning rate of CMA-MAE: a better gait raises its cell's threshold by this share of the
difference."""

EMITTERS = 4
"""Number of emitters; each is a CMA-ES that proposes vectors."""

BATCH = 15
"""Number of vectors per emitter and iteration."""

COMPILED = "_transform_and_check_sol", "_calc_cov_update"
"""Functions of pyribs's CMA-ES that numba compiles."""

SIGMA = 0.5
"""Initial standard deviation. An emitter starts at a random gait and restarts at one of the map."""


class QualityDiversityOptimizer(Generational[kinds.QualityDiversity]):
    """Optimiser that fills a map of gaits, by CMA-MAE.

    The map is a grid over two metrics, the measures; pyribs calls it archive. Several emitters,
    each a CMA-ES, propose a part of each batch. The archive rates a vector by the difference
    between its fitness and the threshold of its cell.

    A vector that failed or lacks a measure never enters the map; it is rated below all others. The
    emitters learn nothing from a batch of such vectors. If a measure is infinite or NaN for all
    gaits of a batch, and the map is empty, tell() raises InputError.

    The report also has `elites`: the number of cells with a gait.
    """

    def __post_init__(self) -> None:
        from ribs.archives import GridArchive
        from ribs.emitters import EvolutionStrategyEmitter
        from ribs.emitters.opt import CMAEvolutionStrategy

        super().__post_init__()
        for name in COMPILED:
            # pyribs compiles them for seconds in each process, where numba does not keep them.
            with contextlib.suppress(AttributeError, RuntimeError):
                getattr(CMAEvolutionStrategy, name).enable_caching()
        self._roots: Matrix = np.empty((0, self._ranges.size))
        """Roots of the points that were drawn last; see Ranges.from_roots()."""
        self._archive = GridArchive(
            solution_dim=self._ranges.size,
            dims=self.settings.cells,
            ranges=[(low, high) for low, high in self.settings.measures.values()],
            threshold_min=FLOOR,
            learning_rate=LEARNING_RATE,
            seed=int(self.generator.integers(2**63)),
        )
        self._emitters = [
            EvolutionStrategyEmitter(
                self._archive,
                x0=self._ranges.roots(self._ranges.random(1, self.generator))[0],
                sigma0=SIGMA,
                ranker="imp",
                selection_rule="mu",
                restart_rule="basic",
                batch_size=BATCH,
                seed=int(self.generator.integers(2**63)),
            )
            for _ in range(EMITTERS)
        ]

    def _draw(self) -> Matrix:
        self._roots = np.concatenate([emitter.ask() for emitter in self._emitters])
        return self._ranges.from_roots(self._roots)

    def tell(self, evaluations: Sequence[Evaluation]) -> Iteration:
        """Adds the batch that ask() returned last to the archive (the map); `evaluations` are in
        the same order. The emitters learn from it, unless the trial's end cut it short. Returns the
        report on the batch."""
        objective = np.array([evaluation.fitness for evaluation in evaluations], dtype=float)
        rows = [[e.metrics.get(name) for name in self.settings.measures] for e in evaluations]
        measures = np.array(rows, dtype=float)  # None becomes NaN
        if self._archive.empty:
            completed = measures[[bool(e.metrics) for e in evaluations]]
            for name, values in zip(self.settings.measures, completed.T, strict=True):
                if values.size and not np.isfinite(values).any():
                    found = f"is infinite or undefined for all of {values.size} gaits"
                    problem = f"{found} ({METRICS[name].note}); the map would stay empty"
                    raise InputError("scenario", f"optimizer.measures.{name}", problem)
        enters = np.isfinite(objective) & np.isfinite(measures).all(axis=1)
        if enters.any():
            added = self._archive.add(
                solution=self._roots[: len(objective)][enters],
                objective=objective[enters],
                measures=measures[enters],
            )
            if not self._archive.empty and len(objective) == len(self._roots):
                status, value = np.zeros(len(objective), np.int32), np.zeros(len(objective))
                status[enters], value[enters] = added["status"], added["value"]
                value[~enters] = np.min(added["value"]) - 1.0
                objective[~enters] = np.min(objective[enters])
                measures[~enters] = measures[enters][0]  # unused by the emitters
                for i, emitter in enumerate(self._emitters):
                    batch = slice(i * BATCH, (i + 1) * BATCH)
                    emitter.tell(
                        solution=self._roots[batch],
                        objective=objective[batch],
                        measures=measures[batch],
                        add_info={"status": status[batch], "value": value[batch]},
                    )
        self._report = {"elites": len(self._archive)}
        return super().tell(evaluations)
