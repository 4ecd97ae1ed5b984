"""The trajectory of a simulation: an xarray dataset with named dimensions, in SI units."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tetra_drake.files import whole_file
from tetra_drake.physics.cable import PASSIVE
from tetra_drake.robot.structure import NODES, Structure, node_positions, node_velocities

if TYPE_CHECKING:
    import xarray


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
    friction = friction_forces.reshape(-1, contacts, 2)
    positions = np.array([node_positions(structure, state) for state in states])
    velocities = np.array([node_velocities(structure, state) for state in states])
    q = states[:, : 7 * bodies].reshape(-1, bodies, 7)
    oscillators = structure.actuation.names
    driving = ["" if i == PASSIVE else oscillators[i] for i in structure.cables["signal"]]
    slip = "0 sticks, +1 or -1 slips in that direction"
    horizontal = ("time", "contact", "horizontal")
    node_dims = ("time", "tetrahedron", "node", "axis")
    node_shape = (-1, bodies, len(NODES), 3)
    variables = {
        "p_WN": (node_dims, positions.reshape(node_shape), "m", "node position"),
        "v_WN": (node_dims, velocities.reshape(node_shape), "m/s", "node velocity"),
        "p_WB": (("time", "tetrahedron", "axis"), q[..., 4:], "m", "position of the body's origin"),
        "q_WB": (("time", "tetrahedron", "quaternion"), q[..., :4], "1", "orientation of the body"),
        "tension": (("time", "cable"), tensions, "N", "cable tension"),
        "length": (("time", "cable"), lengths, "m", "cable length"),
        "signal": (("time", "oscillator"), signals, "N", "actuation signal"),
        "normal_force": (
            ("time", "contact"),
            normal_forces,
            "N",
            "force along the normal of the ground",
        ),
        "friction_force": (horizontal, friction, "N", "friction force"),
        "in_contact": (("time", "contact"), modes[..., 0], "1", "1 on the ground"),
        "friction_mode": (horizontal, modes[..., 1:], "1", slip),
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
            "cable_junction": ("cable", [name.split()[0] for name in structure.cable_names]),
            "cable_role": ("cable", [name.split()[1] for name in structure.cable_names]),
            "cable_signal": ("cable", driving),
            "oscillator": list(oscillators),
            "oscillator_side": ("oscillator", structure.actuation.sides),
            "oscillator_junction": ("oscillator", [name.split()[0] for name in oscillators]),
            "axis": ["x", "y", "z"],
            "horizontal": ["x", "y"],
            "quaternion": ["w", "x", "y", "z"],
        },
    )


def save_dataset(dataset: xarray.Dataset, path: str | Path) -> None:
    """Writes the dataset as compressed netCDF (readable with xarray.open_dataset)."""
    encoding = {name: {"zlib": True, "complevel": 4} for name in dataset.data_vars}
    with whole_file(path) as temporary:
        dataset.to_netcdf(temporary, engine="h5netcdf", encoding=encoding)
