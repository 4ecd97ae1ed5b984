"""Sampler of a Drake simulation: motion of a robot's diagram at given times."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from pydrake.systems.framework import Context, Diagram

from tetra_drake.laws.contact import MODE_COLUMNS
from tetra_drake.laws.kinematics import interpolate_state
from tetra_drake.results.trajectory import Motion, make_dataset
from tetra_drake.robot.robot import Robot

if TYPE_CHECKING:
    import xarray


class Sampler:
    """Samples of a simulation at given times. The integrator's steps need not end at these times.

    States are interpolated within a step; contact modes are taken at its end. Samples are evaluated
    in a Drake context of their own. So recording does not change the simulation.
    """

    def __init__(self, diagram: Diagram, times: np.ndarray, *, max_step: float) -> None:
        """Makes a sampler of a robot's diagram for a simulation that has not begun. `times`
        (samples,) in s ascend. The integrator's steps are at most `max_step` (s)."""
        self._diagram, self._times = diagram, times
        self._ahead = 2.0 * max_step  # Drake may stretch a step to reach its end
        self._bodies = slice(diagram.GetOutputPort("state").size())
        self._context = diagram.CreateDefaultContext()
        self._samples: list[Motion] = []
        self._next = 0
        """Index of the next sample's time."""
        self._latest: tuple[float, np.ndarray] | None = None
        """Time (s) and continuous state at the end of the latest step."""

    def follow(self, other: Sampler, context: Context) -> None:
        """Goes on as another sampler would, from the context of the diagram of a changed robot."""
        self._samples, self._next = other._samples, other._next
        self._latest = context.get_time(), context.get_continuous_state_vector().CopyToVector()

    def after_step(self, context: Context) -> None:
        """Takes the samples within the step that has just ended. `context` is the simulator's."""
        due = self._times[self._next :]
        end = context.get_time()
        if due.size == 0 or due[0] > end + self._ahead:
            self._latest = None  # no sample needs this state
            return
        after = context.get_continuous_state_vector().CopyToVector()
        start, before = self._latest or (end, after)
        self._latest = end, after
        for time in due[due <= end].tolist():
            state = after
            if time < end:
                part, bodies = (time - start) / (end - start), self._bodies
                state = before + part * (after - before)
                ends = before[bodies], after[bodies]
                state[bodies] = interpolate_state(*ends, end - start, part)
            self._context.SetTimeStateAndParametersFrom(context)
            self._context.SetTime(time)
            self._context.SetContinuousState(state)
            self._samples.append(motion_at(self._diagram, self._context))
            self._next += 1

    def motion(self) -> Motion:
        """The motion up to now, at the times of the samples."""
        return Motion.joined(self._samples)


def motion_at(diagram: Diagram, context: Context) -> Motion:
    """Motion at a single time, the time of `context`, from a robot's diagram."""
    ground = diagram.GetSubsystemByName("ground").GetMyContextFromRoot(context)
    modes = ground.get_discrete_state_vector().CopyToVector().reshape(-1, MODE_COLUMNS)
    return Motion(
        times=np.array([context.get_time()]),
        states=diagram.GetOutputPort("state").Eval(context)[np.newaxis],
        signals=diagram.GetOutputPort("signals").Eval(context)[np.newaxis],
        modes=modes[np.newaxis],
        drives=drives_at(diagram, context)[np.newaxis],
    )


def frame_of(robot: Robot, diagram: Diagram, context: Context) -> xarray.Dataset:
    """Trajectory with a single sample: the present state of a robot's diagram in a context."""
    return make_dataset(robot, motion_at(diagram, context))


def drives_at(diagram: Diagram, context: Context) -> np.ndarray:
    """States of the actuators (drives,) of a robot's diagram in a context; empty if its actuators
    have no states."""
    if not diagram.HasOutputPort("drives"):
        return np.zeros(0)
    drives: np.ndarray = diagram.GetOutputPort("drives").Eval(context)
    return drives
