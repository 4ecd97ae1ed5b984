"""Optimisers with the interface ask/tell."""

from __future__ import annotations

import functools
import importlib

from tetra_drake.machine import check_package
from tetra_drake.optimizers.base import Evaluation as Evaluation
from tetra_drake.optimizers.base import MakeOptimizer
from tetra_drake.optimizers.cma_es import CmaEsOptimizer as CmaEsOptimizer
from tetra_drake.optimizers.generational import Generational as RandomSearchOptimizer  # noqa: F401
from tetra_drake.optimizers.quality_diversity import (
    QualityDiversityOptimizer as QualityDiversityOptimizer,
)
from tetra_drake.optimizers.steady_state import SteadyStateOptimizer as SteadyStateOptimizer
from tetra_drake.scenario.optimizer_kinds import OptimizerSettings, QualityDiversity


def optimizer_of(kind: OptimizerSettings) -> MakeOptimizer:
    """Function that makes an optimiser of the scenario's kind. Its module is imported on demand.

    Raises InputError if pyribs is missing.
    """
    if isinstance(kind, QualityDiversity):
        check_package("ribs", extra="qd", source="optimizer")
    make = getattr(importlib.import_module(kind.module), f"{kind.tag}Optimizer")
    return functools.partial(make, settings=kind)
