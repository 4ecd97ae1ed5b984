"""The recorder of a Drake simulation: evenly spaced samples of its context."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from pydrake.systems.framework import Context, Diagram

from tetra_drake.physics.kinematics import interpolate_state
from tetra_drake.results.trajectory import assemble_dataset
from tetra_drake.robot.structure import Structure

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True)
class Sample:
    """What the context of a diagram holds at one time (s)."""

    time: float
    state: np.ndarray
    """[q; v] of the bodies."""
    misc: np.ndarray
    """Other continuous state, as of a live network."""
    discrete: tuple[np.ndarray, ...]

    @classmethod
    def of(cls, context: Context) -> Sample:
        """A copy of what the context holds."""
        continuous, discrete = context.get_continuous_state(), context.get_discrete_state()
        q, v = continuous.get_generalized_position(), continuous.get_generalized_velocity()
        return cls(
            time=context.get_time(),
            state=np.concatenate([q.CopyToVector(), v.CopyToVector()]),
            misc=continuous.get_misc_continuous_state().CopyToVector(),
            discrete=tuple(discrete.value(i).copy() for i in range(discrete.num_groups())),
        )

    def restore(self, context: Context) -> None:
        """Puts the sample into a context of the same diagram."""
        context.SetTime(self.time)
        continuous = context.get_mutable_continuous_state()
        q = continuous.get_mutable_generalized_position()
        q.SetFromVector(self.state[: q.size()])
        continuous.get_mutable_generalized_velocity().SetFromVector(self.state[q.size() :])
        continuous.get_mutable_misc_continuous_state().SetFromVector(self.misc)
        for group, values in enumerate(self.discrete):
            context.SetDiscreteState(group, values)


class Recorder:
    """Takes samples at given times from a simulation whose steps end anywhere.

    It only copies what the context holds, interpolates between the ends of a step, and leaves
    forces and lengths for later, so recording cannot change the simulation.
    """

    def __init__(self, times: np.ndarray) -> None:
        self._times = times
        self._samples: list[Sample] = []
        self._latest: Sample | None = None

    def after_step(self, context: Context) -> None:
        """Takes the samples that are due in the step that ends here."""
        before, after = self._latest, Sample.of(context)
        self._latest = after
        while len(self._samples) < len(self._times):
            time = float(self._times[len(self._samples)])
            if time > after.time:
                return
            self._samples.append(_between(before or after, after, time))

    def dataset(self, diagram: Diagram, structure: Structure) -> xarray.Dataset:
        """The samples with all that the diagram's output ports say of them."""
        return make_dataset(diagram, structure, self._samples)


def make_dataset(diagram: Diagram, structure: Structure, samples: list[Sample]) -> xarray.Dataset:
    """The samples with all that the diagram's output ports say of them; see assemble_dataset."""
    ports = ("state", "signals", "tensions", "lengths", "normal_forces", "friction_forces", "modes")
    columns: dict[str, list[np.ndarray]] = {port: [] for port in ports}
    context = diagram.CreateDefaultContext()
    for sample in samples:
        sample.restore(context)
        for port in ports:
            columns[port].append(diagram.GetOutputPort(port).Eval(context))
    table = {port: np.array(rows) for port, rows in columns.items()}
    times = np.array([sample.time for sample in samples])
    return assemble_dataset(structure, times=times, states=table.pop("state"), **table)


def _between(before: Sample, after: Sample, time: float) -> Sample:
    """The sample at a time (s) of the step from `before` to `after`, with its discrete state."""
    if time == after.time:
        return after
    step = after.time - before.time
    part = (time - before.time) / step
    state = interpolate_state(before.state, after.state, step, part)
    misc = before.misc + part * (after.misc - before.misc)
    return Sample(time=time, state=state, misc=misc, discrete=after.discrete)
