"""Controllers in discrete time, as LeafSystems: the signals are held between updates."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from pydrake.systems.framework import Context, DiscreteValues, EventStatus, LeafSystem

from tetra_drake.laws.cable import CABLE_FORCE_COLUMNS
from tetra_drake.laws.contact import GROUND_FORCE_COLUMNS
from tetra_drake.robot.readings import Readings
from tetra_drake.robot.robot import Robot
from tetra_drake.systems.attachment import DeclareOutput

Law = Callable[[float, Readings], npt.ArrayLike]
"""Function from the time (s) and the readings of a robot to its signals (m,) in N."""


class HeldSignals(LeafSystem):
    """Source of a robot's signals, which holds them until new ones are set.

    | port          | shape         | unit | meaning                                               |
    |---------------|---------------|------|-------------------------------------------------------|
    | signals       | (m,)          | N    | signals of the cables                                 |

    The signals change as the actions of engines.simulation.Simulation do: linearly, within one
    `cpg.listing_step`. Only at t = 0 they are set at once. The discrete state is the signals before
    the change (m,) and after it (m,), and the time (s) of its beginning. At the start both are the
    robot's first signals. The output depends on state and time alone, so there is no
    algebraic loop.
    """

    def __init__(self, robot: Robot) -> None:
        super().__init__()
        self._size, self._change = robot.structure.signals, robot.scenario.cpg.listing_step
        self.DeclareDiscreteState(np.concatenate([robot.first_signals, robot.first_signals, [0.0]]))
        tickets = {self.xd_ticket(), self.time_ticket()}
        DeclareOutput(self, "signals", self._size, HeldSignals._signals, tickets)

    def Hold(self, context: Context, signals: np.ndarray) -> None:
        """Sets the signals (m,) in N that are held from now on. `context` is the system's own, and
        is changed. After t = 0 they are reached within one `cpg.listing_step`."""
        context.SetDiscreteState(self._state_from_now(context, signals))

    def _state_from_now(self, context: Context, signals: np.ndarray) -> np.ndarray:
        """New discrete state, for a change to `signals` (m,) in N that begins now."""
        now = context.get_time()
        before = self._signals(context) if now > 0.0 else signals
        return np.concatenate([before, signals, [now]])

    def _signals(self, context: Context) -> np.ndarray:
        state = context.get_discrete_state_vector().value()
        before, after = state[: self._size], state[self._size : -1]
        left = 1.0 - (context.get_time() - state[-1]) / self._change
        return after - left * (after - before) if left > 0.0 else after


class SampledController(HeldSignals):
    """Controller of a robot: a function that sets the held signals in each control period.

    | port          | shape         | unit | meaning                                               |
    |---------------|---------------|------|-------------------------------------------------------|
    | state         | (13*n,)       | SI   | [q; v] of n free bodies, from the plant               |
    | cable_forces  | (7 cables,)   | SI   | table of laws.cable, row by row, from the cables      |
    | ground_forces | (3 contacts,) | N    | table of laws.contact, row by row, from the ground    |
    | signals       | (m,)          | N    | signals of the cables; see HeldSignals                |

    The state is updated at multiples of the period, from t = 0 on. Steps of the simulation also end
    where a change of the signals ends.
    """

    def __init__(self, robot: Robot, law: Law, *, period: float) -> None:
        """Controller that calls `law` once in each `period` (s). `law` gets the time (s) and the
        robot's Readings, and returns the signals (m,) in N."""
        super().__init__(robot)
        self._law, self._structure = law, robot.structure
        cables, contacts = len(robot.structure.cables), len(robot.structure.contacts)
        self._state = self.DeclareVectorInputPort("state", 13 * len(robot.structure.bodies))
        self._cables = self.DeclareVectorInputPort("cable_forces", CABLE_FORCE_COLUMNS * cables)
        self._ground = self.DeclareVectorInputPort("ground_forces", GROUND_FORCE_COLUMNS * contacts)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
        self.DeclarePeriodicPublishEvent(period, self._change, lambda _: None)  # ends a step

    def _update(self, context: Context, values: DiscreteValues) -> EventStatus:
        readings = Readings.of(
            self._structure,
            time=context.get_time(),
            state=self._state.Eval(context),
            cable_forces=self._cables.Eval(context).reshape(-1, CABLE_FORCE_COLUMNS),
            ground_forces=self._ground.Eval(context).reshape(-1, GROUND_FORCE_COLUMNS),
        )
        signals = np.asarray(self._law(context.get_time(), readings), dtype=float)
        values.set_value(self._state_from_now(context, signals))
        return EventStatus.Succeeded()
