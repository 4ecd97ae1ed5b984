"""The best of 120 travelling sines of 2.16 N, without an optimiser."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sine import grid, oscillators

if TYPE_CHECKING:
    from bench import Problem, Solution

TASKS = ["walk", "climb", "rough", "payload", "damage", "efficient"]
CHANGES = {"cpg": oscillators(2.16)}


def solve(problem: Problem, seed: int) -> Solution:
    sines = grid(problem.space)
    found = problem.evaluate(sines)
    return max(zip(found, sines, strict=True), key=lambda one: one[0].fitness)[1]
