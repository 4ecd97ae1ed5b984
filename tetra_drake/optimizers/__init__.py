"""Optimisers with the interface ask/tell."""

from __future__ import annotations

import functools

from tetra_drake.machine import check_package
from tetra_drake.optimizers.base import Evaluation as Evaluation
from tetra_drake.optimizers.base import MakeOptimizer
from tetra_drake.optimizers.cma_es import CmaEsOptimizer as CmaEsOptimizer
from tetra_drake.optimizers.generational import Generational as RandomSearchOptimizer  # noqa: F401
from tetra_drake.optimizers.steady_state import SteadyStateOptimizer as SteadyStateOptimizer
from tetra_drake.scenario.optimizer_kinds import OptimizerSettings
from tetra_drake.settings.plugins import part_of


def optimizer_of(kind: OptimizerSettings) -> MakeOptimizer:
    """Function that makes an optimiser of the scenario's kind. Its module is imported on demand.

    Raises InputError if a package that it needs is missing.
    """
    if kind.package:
        check_package(kind.package, extra=kind.extra, source="optimizer")
    return functools.partial(part_of(kind, f"{kind.tag}Optimizer"), settings=kind)
