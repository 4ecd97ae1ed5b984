"""Switch that keeps the actuation off until the start-up time, as a Diagram."""

from __future__ import annotations

import numpy as np
from pydrake.common.value import AbstractValue, Value
from pydrake.systems.framework import (
    Context,
    Diagram,
    DiagramBuilder,
    DiscreteValues,
    InputPortIndex,
)
from pydrake.systems.primitives import ConstantVectorSource, PortSwitch

from tetra_drake.systems.scalar_conversion import ConvertibleSystem

_LONGER_THAN_ANY_SIMULATION = 1e9  # s; the period of an event that happens once


class StartUpGate(Diagram):
    """Switch whose output is zero before the start-up time, and equals its input from then on.

    | port    | in, out | shape | unit | meaning                                              |
    |---------|---------|-------|------|------------------------------------------------------|
    | ungated | in      | (m,)  | N    | signals of the m oscillators                         |
    | signals | out     | (m,)  | N    | zeros before `start_up` (s), then equal to `ungated` |

    `size` is the number m of signals. The thesis switches the signals in the same way (listing
    B.1). An event at the start-up time switches Drake's PortSwitch. So an integration step ends
    exactly at the jump. Without events no Python code runs.
    """

    def __init__(self, size: int, *, start_up: float) -> None:
        super().__init__()
        builder = DiagramBuilder()
        switch = builder.AddNamedSystem("switch", PortSwitch(size))
        off, on = switch.DeclareInputPort("off"), switch.DeclareInputPort("on")
        zeros = builder.AddNamedSystem("zeros", ConstantVectorSource(np.zeros(size)))
        timer = _Timer(start_up=start_up, before=off.get_index(), after=on.get_index())
        builder.AddNamedSystem("timer", timer)
        builder.Connect(zeros.get_output_port(), off)
        builder.Connect(timer.get_output_port(), switch.get_port_selector_input_port())
        builder.ExportInput(on, "ungated")
        builder.ExportOutput(switch.get_output_port(), "signals")
        builder.BuildInto(self)


class _Timer(ConvertibleSystem):
    """Selector of the input port that a PortSwitch passes on. The discrete state (1,) is 0 before
    the time `start_up` (s), then 1.

    | port     | in, out | type           | meaning                                                |
    |----------|---------|----------------|--------------------------------------------------------|
    | selector | out     | InputPortIndex | `before` until the time `start_up`, `after` from then  |
    """

    def __init__(self, *, start_up: float, before: InputPortIndex, after: InputPortIndex) -> None:
        super().__init__()

        # Drake never frees a system whose abstract port calls a bound method.
        def select(context: Context, output: AbstractValue) -> None:
            started = context.get_discrete_state_vector().value()[0] != 0.0
            output.set_value(after if started else before)

        self.DeclareDiscreteState([0.0 if start_up > 0.0 else 1.0])
        before_any, sources = Value(InputPortIndex(0)), {self.xd_ticket()}
        self.DeclareAbstractOutputPort("selector", before_any.Clone, select, sources)
        if start_up > 0.0:
            period = _LONGER_THAN_ANY_SIMULATION
            self.DeclarePeriodicDiscreteUpdateEvent(period, start_up, self._start)

    def _start(self, context: Context, values: DiscreteValues) -> None:
        values.set_value([1.0])
