"""The trajectory of a simulation: an xarray dataset with named dimensions, in SI units."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tetra_drake.files import write_whole
from tetra_drake.physics.cable import PASSIVE
from tetra_drake.robot.structure import NODES, Structure, node_positions, node_velocities

if TYPE_CHECKING:
    import xarray


DIMENSIONS = {
    "p_WN": ("time", "tetrahedron", "node", "axis"),
    "v_WN": ("time", "tetrahedron", "node", "axis"),
    "p_WB": ("time", "tetrahedron", "axis"),
    "q_WB": ("time", "tetrahedron", "quaternion"),
    "tension": ("time", "cable"),
    "length": ("time", "cable"),
    "signal": ("time", "oscillator"),
    "normal_force": ("time", "contact"),
    "friction_force": ("time", "contact", "horizontal"),
    "in_contact": ("time", "contact"),
    "friction_mode": ("time", "contact", "horizontal"),
}
"""Dimensions of each variable of a trajectory."""


def sample_times(duration: float, period: float) -> np.ndarray:
    """Evenly spaced times (s) from 0 to `duration`, as near to `period` apart as that allows."""
    return np.linspace(0.0, duration, max(1, round(duration / period)) + 1)


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
    """A trajectory from its columns, one row per sample; shapes are those of the diagram's ports.

    Dimensions: time, tetrahedron, node, cable, contact, oscillator, axis, horizontal, quaternion.
    Every variable has a `units` attribute. Coordinates along `cable`: cable_junction, cable_role
    (outer or inner) and cable_signal, the oscillator that drives the cable ("" if none); along
    `oscillator`: oscillator_junction and oscillator_side (1 left, -1 right, else 0).
    Forces and modes are those of the step in which, or at whose end, the sample lies.
    """
    import xarray

    bodies, contacts = len(structure.bodies), len(structure.contacts)
    modes = np.sign(modes).reshape(-1, contacts, 3).astype(np.int8)
    positions = np.array([node_positions(structure, state) for state in states])
    velocities = np.array([node_velocities(structure, state) for state in states])
    q = states[:, : 7 * bodies].reshape(-1, bodies, 7)
    node_shape = (-1, bodies, len(NODES), 3)
    slip = "0 sticks, +1 or -1 slips in that direction"
    variables = {
        "p_WN": (positions.reshape(node_shape), "m", "node position"),
        "v_WN": (velocities.reshape(node_shape), "m/s", "node velocity"),
        "p_WB": (q[..., 4:], "m", "position of the body's origin"),
        "q_WB": (q[..., :4], "1", "orientation of the body"),
        "tension": (tensions, "N", "cable tension"),
        "length": (lengths, "m", "cable length"),
        "signal": (signals, "N", "actuation signal"),
        "normal_force": (normal_forces, "N", "force along the normal of the ground"),
        "friction_force": (friction_forces.reshape(-1, contacts, 2), "N", "friction force"),
        "in_contact": (modes[..., 0], "1", "1 on the ground"),
        "friction_mode": (modes[..., 1:], "1", slip),
    }
    return xarray.Dataset(
        {
            name: (DIMENSIONS[name], values, {"units": unit, "long_name": meaning})
            for name, (values, unit, meaning) in variables.items()
        },
        coords={"time": ("time", times, {"units": "s"}), **labels(structure)},
    )


def labels(structure: Structure) -> dict[str, tuple[str, list[Any]]]:
    """By coordinate, but for the time, its dimension and its values."""
    oscillators = structure.actuation.names
    driving = ["" if i == PASSIVE else oscillators[i] for i in structure.cables["signal"]]
    contacts = [structure.node_names[node] for node in structure.contacts]
    return {
        "tetrahedron": ("tetrahedron", list(structure.bodies)),
        "node": ("node", list(NODES)),
        "cable": ("cable", list(structure.cable_names)),
        "contact": ("contact", contacts),
        "cable_junction": ("cable", [name.split()[0] for name in structure.cable_names]),
        "cable_role": ("cable", [name.split()[1] for name in structure.cable_names]),
        "cable_signal": ("cable", driving),
        "oscillator": ("oscillator", list(oscillators)),
        "oscillator_side": ("oscillator", list(structure.actuation.sides)),
        "oscillator_junction": ("oscillator", [name.split()[0] for name in oscillators]),
        "axis": ("axis", ["x", "y", "z"]),
        "horizontal": ("horizontal", ["x", "y"]),
        "quaternion": ("quaternion", ["w", "x", "y", "z"]),
    }


def save_dataset(dataset: xarray.Dataset, path: str | Path) -> None:
    """Writes the dataset as compressed netCDF (readable with xarray.open_dataset)."""
    encoding = {name: {"zlib": True, "complevel": 4} for name in dataset.data_vars}
    content = io.BytesIO()  # in memory, as HDF5 fails on a full disk with errors of its own
    dataset.to_netcdf(content, engine="h5netcdf", encoding=encoding)
    write_whole(path, content.getvalue())
