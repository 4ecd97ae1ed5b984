"""Numbers of lanes that tests compile kernels for."""

import math

import pytest

from tetra_drake.engines.compiled.lane_engine import lanes_for

WIDEST = lanes_for(math.inf)
"""As many lanes as fit this processor: four or eight."""

WIDTHS = [WIDEST, pytest.param(4 if WIDEST == 8 else 8, marks=pytest.mark.slow)]
"""The widest, and the other number, whose kernels only the slow tests compile."""
