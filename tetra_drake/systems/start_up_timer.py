"""The timer that keeps the actuation off at first."""

from __future__ import annotations

from pydrake.common.value import AbstractValue, Value
from pydrake.systems.framework import Context, DiscreteValues, InputPortIndex, LeafSystem

_LONGER_THAN_ANY_SIMULATION = 1e9  # s; Drake has no one-time event, so its period is long


class StartUpTimer(LeafSystem):
    """Tells a PortSwitch to change over at the start-up time (thesis listing B.1).

    .. pydrake_system::

        name: StartUpTimer
        output_ports:
        - selector

    | port     | type           | meaning                                         |
    |----------|----------------|-------------------------------------------------|
    | selector | InputPortIndex | `before` until the start-up, `after` from then on |

    The time is kept in a discrete state that an event sets, so an integration step ends exactly
    at the jump and none smears it.
    """

    def __init__(self, *, start_up: float, before: InputPortIndex, after: InputPortIndex) -> None:
        super().__init__()

        # Drake never frees a system whose abstract port calls a bound method.
        def calc_selector(context: Context, output: AbstractValue) -> None:
            started = context.get_discrete_state_vector().value()[0] != 0.0
            output.set_value(after if started else before)

        self.DeclareDiscreteState([0.0 if start_up > 0.0 else 1.0])
        self.DeclareAbstractOutputPort(
            "selector",
            alloc=lambda: Value(InputPortIndex(0)),
            calc=calc_selector,
            prerequisites_of_calc={self.xd_ticket()},
        )
        if start_up > 0.0:
            self.DeclarePeriodicDiscreteUpdateEvent(
                period_sec=_LONGER_THAN_ANY_SIMULATION, offset_sec=start_up, update=self._switch
            )

    def _switch(self, context: Context, values: DiscreteValues) -> None:
        values.set_value([1.0])
