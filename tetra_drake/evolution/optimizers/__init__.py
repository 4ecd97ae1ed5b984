"""Optimisers behind ask/tell."""

from __future__ import annotations

import functools

from tetra_drake.evolution.optimizers.base import MakeOptimizer
from tetra_drake.evolution.optimizers.cma_es import CmaEs
from tetra_drake.evolution.optimizers.differential_evolution import DifferentialEvolution
from tetra_drake.evolution.optimizers.random_search import RandomSearch
from tetra_drake.evolution.optimizers.steady_state import SteadyState
from tetra_drake.scenario import optimizers as kinds


def optimizer_of(kind: kinds.OptimizerKind) -> MakeOptimizer:
    """What makes the optimiser that a scenario asks for."""
    if isinstance(kind, kinds.CmaEs):
        return functools.partial(CmaEs, own=kind)
    if isinstance(kind, kinds.DifferentialEvolution):
        return functools.partial(DifferentialEvolution, own=kind)
    return RandomSearch if isinstance(kind, kinds.RandomSearch) else SteadyState
