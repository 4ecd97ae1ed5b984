"""CMA-ES by pycma."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tetra_drake.scenario.optimizer_kinds import CmaEs

if TYPE_CHECKING:
    from bench import Problem, Solution


def solve(problem: Problem, seed: int) -> Solution:
    return problem.search(CmaEs(), seed)
