"""The sampler of a Drake simulation: evenly spaced samples of its context."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from pydrake.systems.framework import Context, Diagram

from tetra_drake.physics.kinematics import interpolate_state
from tetra_drake.results.trajectory import assemble_dataset
from tetra_drake.robot.structure import Structure

if TYPE_CHECKING:
    import xarray


class Sample(NamedTuple):
    """What the context of a diagram holds at one time (s)."""

    time: float
    continuous: np.ndarray
    """[q; v] of the bodies, then other continuous state, as of a live network."""
    discrete: tuple[np.ndarray, ...]

    @classmethod
    def of(cls, context: Context) -> Sample:
        """A copy of what the context holds."""
        discrete = context.get_discrete_state()
        return cls(
            context.get_time(),
            context.get_continuous_state_vector().CopyToVector(),
            tuple(discrete.value(i).copy() for i in range(discrete.num_groups())),
        )


class Sampler:
    """Takes samples at given times from a simulation whose steps end anywhere.

    It only copies what the context holds, interpolates between the ends of a step, and leaves
    forces and lengths for later, so recording cannot change the simulation.
    """

    def __init__(self, structure: Structure, times: np.ndarray) -> None:
        self._structure, self._times = structure, times
        self.samples: list[Sample] = []
        self._latest: Sample | None = None

    def after_step(self, context: Context) -> None:
        """Takes the samples that are due in the step that ends here."""
        after = Sample.of(context)
        before, self._latest = self._latest or after, after
        for time in self._times[len(self.samples) :]:
            if time > after.time:
                return
            self.samples.append(self._between(before, after, float(time)))

    def _between(self, before: Sample, after: Sample, time: float) -> Sample:
        """The sample at a time (s) of a step, with the discrete state of its end."""
        if time == after.time:
            return after
        step, bodies = after.time - before.time, slice(13 * len(self._structure.bodies))
        part = (time - before.time) / step
        state = before.continuous + part * (after.continuous - before.continuous)
        ends = before.continuous[bodies], after.continuous[bodies]
        state[bodies] = interpolate_state(*ends, step, part)
        return Sample(time, state, after.discrete)


def make_dataset(diagram: Diagram, structure: Structure, samples: list[Sample]) -> xarray.Dataset:
    """The samples with all that the diagram's output ports say of them; see assemble_dataset."""
    ports = ("state", "signals", "tensions", "lengths", "normal_forces", "friction_forces", "modes")
    table = evaluate_ports(diagram, samples, ports)
    times = np.array([sample.time for sample in samples])
    return assemble_dataset(structure, times=times, states=table.pop("state"), **table)


def evaluate_ports(
    diagram: Diagram, samples: Sequence[Sample], ports: Sequence[str]
) -> dict[str, np.ndarray]:
    """The values (samples, size) of output ports of the diagram, by their names."""
    columns: dict[str, list[np.ndarray]] = {port: [] for port in ports}
    context = diagram.CreateDefaultContext()
    for sample in samples:
        context.SetTime(sample.time)
        context.SetContinuousState(sample.continuous)
        for group, values in enumerate(sample.discrete):
            context.SetDiscreteState(group, values)
        for port in ports:
            columns[port].append(diagram.GetOutputPort(port).Eval(context))
    return {port: np.array(rows) for port, rows in columns.items()}
