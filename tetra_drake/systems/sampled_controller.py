"""Controller in discrete time, as a LeafSystem: the signals are held between updates."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from pydrake.systems.framework import Context, DiscreteValues, EventStatus

from tetra_drake.laws.cable import CABLE_FORCE_COLUMNS
from tetra_drake.laws.contact import GROUND_FORCE_COLUMNS
from tetra_drake.robot.readings import Readings
from tetra_drake.robot.robot import Robot
from tetra_drake.systems.attachment import DeclareOutput
from tetra_drake.systems.scalar_conversion import ConvertibleSystem

Law = Callable[[float, Readings], npt.ArrayLike]
"""Function from the time (s) and the readings of a robot to its signals (m,) in N."""


class SampledController(ConvertibleSystem):
    """Controller of a robot: a function that sets its signals in each control period.

    | port          | in, out | shape         | unit | meaning                                     |
    |---------------|---------|---------------|------|---------------------------------------------|
    | state         | in      | (13*n,)       | SI   | [q; v] of n free bodies, from the plant     |
    | cable_forces  | in      | (7*cables,)   | SI   | from the port of CableNetwork: per cable    |
    |               |         |               |      | direction (3), length, tension, derivative  |
    |               |         |               |      | of the tension by the rate, rate of length  |
    | ground_forces | in      | (3*contacts,) | N    | from the port of GroundContact: per contact |
    |               |         |               |      | node friction along t1 and t2, normal force |
    | signals       | out     | (m,)          | N    | actuator signals, one per group of driven   |
    |               |         |               |      | cables                                      |

    The function gets the inputs as Readings. It is called at multiples of the period, from t = 0
    on. The output changes linearly from the old signals to the new ones, within one network step,
    the scenario's `cpg.listing_step` (s), and then holds them. Only at t = 0 it changes at once.
    Commands and the actions of lab.stepping.simulation.Simulation act in the same way. Steps of the
    simulation also end where a change ends.

    The discrete state (2m + 1,) is the m signals before the latest change, the m signals after it,
    and the time (s) of its beginning. At the start both are the robot's first signals. The output
    depends on state and time alone, so there is no algebraic loop.
    """

    def __init__(self, robot: Robot, law: Law, *, period: float) -> None:
        """Makes a controller that calls `law` once in each `period` (s). `law` gets the time (s)
        and the robot's Readings, and returns the signals (m,) in N."""
        super().__init__()
        self._law, self._structure = law, robot.structure
        self._size, self._change = robot.structure.signals, robot.scenario.cpg.listing_step
        self.DeclareDiscreteState(np.concatenate([robot.first_signals, robot.first_signals, [0.0]]))
        tickets = {self.xd_ticket(), self.time_ticket()}
        DeclareOutput(self, "signals", self._size, SampledController._signals, tickets)
        cables, contacts = len(robot.structure.cables), len(robot.structure.contacts)
        self._state = self.DeclareVectorInputPort("state", 13 * len(robot.structure.bodies))
        self._cables = self.DeclareVectorInputPort("cable_forces", CABLE_FORCE_COLUMNS * cables)
        self._ground = self.DeclareVectorInputPort("ground_forces", GROUND_FORCE_COLUMNS * contacts)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
        # Ends a step. At t = 0 nothing changes.
        self.DeclarePeriodicPublishEvent(period, period + self._change, lambda _: None)

    def _signals(self, context: Context) -> np.ndarray:
        state = context.get_discrete_state_vector().value()
        before, after = state[: self._size], state[self._size : -1]
        left = 1.0 - (context.get_time() - state[-1]) / self._change
        return after - left * (after - before) if left > 0.0 else after

    def _update(self, context: Context, values: DiscreteValues) -> EventStatus:
        now = context.get_time()
        readings = Readings.of(
            self._structure,
            time=now,
            state=self._state.Eval(context),
            cable_forces=self._cables.Eval(context).reshape(-1, CABLE_FORCE_COLUMNS),
            ground_forces=self._ground.Eval(context).reshape(-1, GROUND_FORCE_COLUMNS),
        )
        signals = np.asarray(self._law(now, readings), dtype=float)
        before = self._signals(context) if now > 0.0 else signals
        values.set_value(np.concatenate([before, signals, [now]]))
        return EventStatus.Succeeded()
