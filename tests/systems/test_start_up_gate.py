"""The timer that starts the actuation."""

from __future__ import annotations

import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import InputPortIndex

from tetra_drake.systems import StartUpTimer

BEFORE, AFTER = InputPortIndex(1), InputPortIndex(2)


def selected_at(time: float, *, start_up: float) -> InputPortIndex:
    simulator = Simulator(StartUpTimer(start_up=start_up, before=BEFORE, after=AFTER))
    simulator.Initialize()
    simulator.AdvanceTo(time)
    simulator.AdvancePendingEvents()
    return simulator.get_system().GetOutputPort("selector").Eval(simulator.get_context())


@pytest.mark.parametrize(
    ("time", "selected"), [(0.0, BEFORE), (1.2499, BEFORE), (1.25, AFTER), (15.0, AFTER)]
)
def test_selects_the_signals_from_the_start_up_time_on(
    time: float, selected: InputPortIndex
) -> None:
    assert selected_at(time, start_up=1.25) == selected


def test_without_a_start_up_time_the_signals_are_on_at_once() -> None:
    assert selected_at(0.0, start_up=0.0) == AFTER
