"""The gate that keeps the actuation off at first."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from tetra_drake.systems import StartUpGate


@pytest.mark.parametrize(
    ("time", "start_up", "is_open"),
    [(1.2499, 1.25, 0), (1.25, 1.25, 1), (0.0, 0.0, 1)],
)
def test_passes_signals_from_the_start_up_time_on(time, start_up, is_open):
    signals = np.array([1.0, -2.0])
    gate = StartUpGate(2, start_up=start_up)
    simulator = Simulator(gate)
    context = simulator.get_mutable_context()
    gate.GetInputPort("ungated").FixValue(context, signals)
    simulator.Initialize()
    simulator.AdvanceTo(time)
    simulator.AdvancePendingEvents()
    np.testing.assert_array_equal(gate.GetOutputPort("signals").Eval(context), is_open * signals)
