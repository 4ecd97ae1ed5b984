"""CMA-MAE by pyribs, the best of a map of gaits that differ."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tetra_drake.scenario.optimizer_kinds import QualityDiversity

if TYPE_CHECKING:
    from bench import Problem, Solution


def solve(problem: Problem, seed: int) -> Solution:
    if problem.task.name != "roll":
        return problem.search(QualityDiversity(), seed)
    measures = {"lateral_drift": [0.0, 2.0], "clearance": [0.0, 0.2]}
    return problem.search(QualityDiversity(measures=measures), seed)
