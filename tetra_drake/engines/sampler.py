"""Sampler of a Drake simulation: samples of its context at given times."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from pydrake.systems.framework import Context, Diagram

from tetra_drake.laws.contact import MODE_COLUMNS
from tetra_drake.laws.kinematics import interpolate_state
from tetra_drake.results.trajectory import Motion, make_dataset
from tetra_drake.robot.robot import Robot

if TYPE_CHECKING:
    import xarray


class Sample(NamedTuple):
    """State of a diagram at one time (s)."""

    time: float
    continuous: np.ndarray
    """Continuous state: [q; v] of the bodies, then other state, such as a live network's."""
    discrete: tuple[np.ndarray, ...]

    @classmethod
    def of(cls, context: Context) -> Sample:
        """The state in a context, copied."""
        discrete = context.get_discrete_state()
        return cls(
            context.get_time(),
            context.get_continuous_state_vector().CopyToVector(),
            tuple(discrete.value(i).copy() for i in range(discrete.num_groups())),
        )


class Sampler:
    """Samples of a simulation at given times, where no step has to end.

    States are interpolated within a step; modes are those at its end. Forces and lengths are
    computed after the simulation. So recording does not change it.
    """

    def __init__(self, diagram: Diagram, times: np.ndarray, *, max_step: float) -> None:
        """`times` (s) of the samples ascend. Steps are at most `max_step` (s)."""
        self._diagram, self._times = diagram, times
        self._ahead = 2.0 * max_step  # Drake may stretch a step to reach its end
        self._bodies = slice(diagram.GetOutputPort("state").size())
        self._samples: list[Sample] = []
        self._latest: Sample | None = None

    def follow(self, other: Sampler) -> None:
        """Goes on with copies of another sampler's samples."""
        self._samples, self._latest = other._samples.copy(), other._latest

    def after_step(self, context: Context) -> None:
        """Takes the samples within the step that has just ended."""
        due = self._times[len(self._samples) :]
        if due.size == 0 or due[0] > context.get_time() + self._ahead:
            self._latest = None  # no sample needs this state
            return
        after = Sample.of(context)
        before, self._latest = self._latest or after, after
        step, bodies = after.time - before.time, self._bodies
        for time in due[due <= after.time].tolist():
            if time == after.time:
                self._samples.append(after)
                continue
            part = (time - before.time) / step
            state = before.continuous + part * (after.continuous - before.continuous)
            ends = before.continuous[bodies], after.continuous[bodies]
            state[bodies] = interpolate_state(*ends, step, part)
            self._samples.append(Sample(time, state, after.discrete))

    def motion(self) -> Motion:
        """The motion up to now, at the times of the samples."""
        return motion_of(self._diagram, self._samples)


def motion_of(diagram: Diagram, samples: Sequence[Sample]) -> Motion:
    """Motion of a robot from samples of its diagram."""
    state, signals = diagram.GetOutputPort("state"), diagram.GetOutputPort("signals")
    context = diagram.CreateDefaultContext()
    ground = diagram.GetSubsystemByName("ground").GetMyContextFromRoot(context)
    rows = []
    for sample in samples:
        context.SetTime(sample.time)
        context.SetContinuousState(sample.continuous)
        for group, values in enumerate(sample.discrete):
            context.SetDiscreteState(group, values)
        modes = ground.get_discrete_state_vector().CopyToVector().reshape(-1, MODE_COLUMNS)
        row = {
            "times": sample.time,
            "states": state.Eval(context),
            "signals": signals.Eval(context),
            "modes": modes,
            "drives": drives_at(diagram, context),
        }
        rows.append(row)
    return Motion(**{name: np.array([row[name] for row in rows]) for name in rows[0]})


def frame_of(robot: Robot, diagram: Diagram, context: Context) -> xarray.Dataset:
    """Trajectory of a single sample: a robot's diagram in a context."""
    return make_dataset(robot, motion_of(diagram, [Sample.of(context)]))


def drives_at(diagram: Diagram, context: Context) -> np.ndarray:
    """States of the actuators (drives,) of a robot's diagram in a context; empty without states."""
    if not diagram.HasOutputPort("drives"):
        return np.zeros(0)
    drives: np.ndarray = diagram.GetOutputPort("drives").Eval(context)
    return drives
