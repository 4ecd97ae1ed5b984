"""Random parameters, the best counts."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tetra_drake.scenario.optimizer_kinds import RandomSearch

if TYPE_CHECKING:
    from bench import Problem, Solution


def solve(problem: Problem, seed: int) -> Solution:
    return problem.search(RandomSearch(), seed)
