"""The thesis's evolutionary algorithm."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tetra_drake.scenario.optimizer_kinds import SteadyState

if TYPE_CHECKING:
    from bench import Problem, Solution


def solve(problem: Problem, seed: int) -> Solution:
    return problem.search(SteadyState(), seed)
