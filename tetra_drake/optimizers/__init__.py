"""Optimisers with the interface ask/tell."""

from __future__ import annotations

import functools
from typing import Any

from tetra_drake.machine import check_package
from tetra_drake.optimizers.base import MakeOptimizer
from tetra_drake.optimizers.cma_es import CmaEsOptimizer
from tetra_drake.optimizers.generational import Generational
from tetra_drake.optimizers.quality_diversity import QualityDiversityOptimizer
from tetra_drake.optimizers.steady_state import SteadyStateOptimizer
from tetra_drake.scenario import optimizer_kinds as kinds

OPTIMIZERS: dict[type, Any] = {
    kinds.SteadyState: SteadyStateOptimizer,
    kinds.CmaEs: CmaEsOptimizer,
    kinds.RandomSearch: Generational,
    kinds.QualityDiversity: QualityDiversityOptimizer,
}
"""Class of optimiser by kind. Its constructor takes the arguments of MakeOptimizer and
`settings`."""


def optimizer_of(kind: kinds.OptimizerKind) -> MakeOptimizer:
    """Function that makes an optimiser of the scenario's kind.

    Raises InputError if pyribs is missing.
    """
    if isinstance(kind, kinds.QualityDiversity):
        check_package("ribs", extra="qd", source="optimizer")
    return functools.partial(OPTIMIZERS[type(kind)], settings=kind)
