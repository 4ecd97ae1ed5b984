"""A recorded simulation as an xarray dataset."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from pydrake.systems.framework import Context, Diagram

from tetra_drake.files import whole_file
from tetra_drake.robot.structure import NODES, Structure, node_positions, node_velocities

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True)
class Sample:
    """What the context of a diagram holds at one time (s)."""

    time: float
    continuous: np.ndarray
    discrete: tuple[np.ndarray, ...]

    @classmethod
    def of(cls, context: Context) -> Sample:
        """A copy of what the context holds."""
        discrete = context.get_discrete_state()
        return cls(
            time=context.get_time(),
            continuous=context.get_continuous_state_vector().CopyToVector(),
            discrete=tuple(discrete.value(i).copy() for i in range(discrete.num_groups())),
        )

    def restore(self, context: Context) -> None:
        """Puts the sample back into a context of the same diagram."""
        context.SetTime(self.time)
        context.SetContinuousState(self.continuous)
        for group, values in enumerate(self.discrete):
            context.SetDiscreteState(group, values)


class Recorder:
    """Keeps states of a simulation as its steps end, at most one each `period` (s).

    It only copies what the context holds: forces and lengths are worked out afterwards,
    so recording cannot change the simulation. The first and the last state are kept.
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self._due = 0.0
        self._samples: list[Sample] = []
        self._latest: Sample | None = None

    def after_step(self, context: Context) -> None:
        """Takes a sample, which stays if one is due."""
        self._latest = Sample.of(context)
        if self._latest.time >= self._due:
            self._samples.append(self._latest)
            self._due = self._period * (np.floor(self._latest.time / self._period) + 1.0)

    def samples(self) -> list[Sample]:
        """All samples, in order of time."""
        samples = list(self._samples)
        if self._latest is not None and self._latest is not samples[-1]:
            samples.append(self._latest)
        # Events at a boundary (AdvanceTo, start-up) show one time twice; the later one holds.
        return [
            sample
            for sample, after in zip(samples, [*samples[1:], None], strict=True)
            if after is None or after.time > sample.time
        ]


def make_dataset(diagram: Diagram, structure: Structure, samples: list[Sample]) -> xarray.Dataset:
    """The samples with all that the diagram's output ports say of them.

    Forces and modes are those of the step that ends at the sample: a mode change due there
    shows in the next one. See assemble_dataset.
    """
    ports = ("state", "signals", "tensions", "lengths", "normal_forces", "friction_forces", "modes")
    columns: dict[str, list[np.ndarray]] = {port: [] for port in ports}
    context = diagram.CreateDefaultContext()
    for sample in samples:
        sample.restore(context)
        for port in ports:
            columns[port].append(diagram.GetOutputPort(port).Eval(context))
    table = {port: np.array(rows) for port, rows in columns.items()}
    return assemble_dataset(
        structure,
        times=np.array([sample.time for sample in samples]),
        states=table.pop("state"),
        **table,
    )


def assemble_dataset(
    structure: Structure,
    *,
    times: np.ndarray,
    states: np.ndarray,
    signals: np.ndarray,
    tensions: np.ndarray,
    lengths: np.ndarray,
    normal_forces: np.ndarray,
    friction_forces: np.ndarray,
    modes: np.ndarray,
) -> xarray.Dataset:
    """A trajectory from its columns, a row a sample, in the order of the diagram's ports.

    Dimensions: time, tetrahedron, node, cable, contact, junction, axis, horizontal. SI values,
    with a `units` attribute each.
    """
    import xarray

    bodies, contacts = len(structure.bodies), len(structure.contacts)
    modes = modes.reshape(-1, contacts, 3)
    friction = friction_forces.reshape(-1, contacts, 2)
    positions = np.array([node_positions(structure, state) for state in states])
    velocities = np.array([node_velocities(structure, state) for state in states])
    node_dims = ("time", "tetrahedron", "node", "axis")
    node_shape = (-1, bodies, len(NODES), 3)
    variables = {
        "p_WN": (node_dims, positions.reshape(node_shape), "m", "node position"),
        "v_WN": (node_dims, velocities.reshape(node_shape), "m/s", "node velocity"),
        "tension": (("time", "cable"), tensions, "N", "cable tension"),
        "length": (("time", "cable"), lengths, "m", "cable length"),
        "signal": (("time", "junction"), signals, "N", "actuation signal"),
        "normal_force": (("time", "contact"), normal_forces, "N", "upward force"),
        "friction_force": (("time", "contact", "horizontal"), friction, "N", "friction force"),
        "in_contact": (("time", "contact"), modes[..., 0].astype(np.int8), "1", "1 on the ground"),
        "friction_mode": (
            ("time", "contact", "horizontal"),
            modes[..., 1:].astype(np.int8),
            "1",
            "0 sticks, +1 or -1 slips in that direction",
        ),
    }
    names = np.array(structure.node_names)
    return xarray.Dataset(
        {
            name: (dims, values, {"units": unit, "long_name": meaning})
            for name, (dims, values, unit, meaning) in variables.items()
        },
        coords={
            "time": ("time", times, {"units": "s"}),
            "tetrahedron": list(structure.bodies),
            "node": list(NODES),
            "cable": list(structure.cable_names),
            "contact": names[structure.contacts].tolist(),
            "junction": [f"{a}-{b}" for a, b in itertools.pairwise(structure.bodies)],
            "axis": ["x", "y", "z"],
            "horizontal": ["x", "y"],
        },
    )


def save_dataset(dataset: xarray.Dataset, path: str | Path) -> None:
    """Writes the dataset as compressed netCDF (readable with xarray.open_dataset)."""
    encoding = {name: {"zlib": True, "complevel": 4} for name in dataset.data_vars}
    with whole_file(path) as temporary:
        dataset.to_netcdf(temporary, engine="h5netcdf", encoding=encoding)
