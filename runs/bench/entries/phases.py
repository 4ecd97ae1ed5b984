"""CMA-ES over phase oscillators of 2.16 N: a frequency and the lags between them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tetra_drake.scenario.optimizer_kinds import CmaEs

if TYPE_CHECKING:
    from bench import Problem, Solution

TASKS = ["walk", "climb", "rough", "payload", "damage", "efficient"]
CHANGES = {"cpg": "!Phase {gain: 2.16 N, amplitude: [1, 1], frequency: [0.3 Hz, 3 Hz]}"}


def solve(problem: Problem, seed: int) -> Solution:
    return problem.search(CmaEs(), seed)
