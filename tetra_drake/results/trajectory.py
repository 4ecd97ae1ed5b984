"""Trajectory of a simulation: an xarray dataset with named dimensions, in SI units."""

from __future__ import annotations

import functools
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tetra_drake.files import write_whole
from tetra_drake.laws import cable
from tetra_drake.laws.actuator import has_drive, wound
from tetra_drake.laws.contact import STICK_POINT
from tetra_drake.laws.forces import forces_of_motion
from tetra_drake.laws.kinematics import P_WN, V_WN
from tetra_drake.robot.robot import Phase, Robot
from tetra_drake.robot.structure import Structure, with_origins

if TYPE_CHECKING:
    import xarray


VARIABLES = {
    "p_WN": (("time", "node", "axis"), "m", "node position"),
    "v_WN": (("time", "node", "axis"), "m/s", "node velocity"),
    "p_WB": (("time", "body", "axis"), "m", "position of the body's origin"),
    "q_WB": (("time", "body", "quaternion"), "1", "orientation of the body"),
    "tension": (("time", "cable"), "N", "cable tension"),
    "length": (("time", "cable"), "m", "cable length"),
    "free_length": (("time", "cable"), "m", "free length of the cable"),
    "signal": (("time", "oscillator"), "N", "actuation signal"),
    "normal_force": (("time", "contact"), "N", "force along the normal of the ground"),
    "friction_force": (("time", "contact", "horizontal"), "N", "friction force"),
    "in_contact": (("time", "contact"), "1", "1 on the ground"),
    "friction_mode": (("time", "contact", "horizontal"), "1", "mode of friction"),
}
"""Dimensions, unit and meaning of each variable of a trajectory."""

_FLAGS = {
    "in_contact": {0: "off_ground", 1: "on_ground"},
    "friction_mode": {-1: "slips_negative", 0: "no_slip", 1: "slips_positive"},
}
"""Meaning of each value of the variables `in_contact` and `friction_mode`."""


def sample_times(duration: float, period: float) -> np.ndarray:
    """Evenly spaced times (s) from 0 to `duration`. The spacing is as close to `period` as
    possible."""
    return np.linspace(0.0, duration, max(1, round(duration / period)) + 1)


@dataclass(frozen=True)
class Motion:
    """Motion of a robot at k times, as an engine returns it; SI units."""

    times: np.ndarray
    """Times (k,), ascending."""
    states: np.ndarray
    """States [q; v] of the bodies (k, 13 n)."""
    signals: np.ndarray
    """Actuation signals (k, m)."""
    modes: np.ndarray
    """Modes of the contact nodes (k, contacts, MODE_COLUMNS) during the step that contains the
    time, or ends there; see laws.contact."""
    drives: np.ndarray
    """States of the actuators (k, drives); see laws.actuator."""
    ground_forces: np.ndarray | None = None
    """Forces of the ground along t1, t2 and n (k, contacts, 3), if the engine has its own law of
    contact. None if they follow from states and modes."""

    def at(self, times: np.ndarray) -> Motion:
        """The motion at `times` (s), which must be among its own times: rows are selected, nothing
        is interpolated."""
        return self.rows(np.searchsorted(self.times, times))

    def rows(self, rows: np.ndarray | slice) -> Motion:
        """The motion at some of its times, by their indices."""
        given = {name: table for name, table in vars(self).items() if table is not None}
        return Motion(**{name: table[rows] for name, table in given.items()})

    @classmethod
    def joined(cls, parts: Sequence[Motion]) -> Motion:
        """The motion of several parts, one after the other."""
        first = {name: table for name, table in vars(parts[0]).items() if table is not None}
        return cls(**{name: np.concatenate([vars(part)[name] for part in parts]) for name in first})

    def by_phase(self, robot: Robot) -> list[tuple[Phase, Motion]]:
        """The motion between the events of the robot's scenario, each part with its robot. At the
        time of an event, the robot is still the one before."""
        begins = [phase.begins for phase in robot.phases[1:]]
        ends = np.searchsorted(self.times, begins, side="right")
        rows = np.split(np.arange(len(self.times)), ends)
        return [(phase, self.rows(its)) for phase, its in zip(robot.phases, rows, strict=True)]

    def first_states(self, robot: Robot) -> np.ndarray:
        """States [q; v] (k, 13 n) of the frames that the bodies have at t = 0, whose origins are
        their centres of mass then, before any event."""
        parts = self.by_phase(robot)
        return np.concatenate([with_origins(part.states, -phase.p_BC) for phase, part in parts])


def make_dataset(robot: Robot, motion: Motion) -> xarray.Dataset:
    """Makes a trajectory, an xarray dataset: the motion at all of its times, with the lengths and
    forces that follow from it.

    Dimensions: time, body, node, cable, contact, oscillator, axis, horizontal, quaternion. A
    contact is a node that the ground can touch. Every variable has a `units` attribute; modes have
    CF's `flag_values` and `flag_meanings`. Velocities have single precision, other numbers
    double precision. Further coordinates:

    - node_body and contact_body: the body of a node or contact.
    - cable_bodies: the two bodies that a cable joins, such as "T1-T2".
    - cable_group and cable_signal: the cable's group, and the oscillator that drives it ("" if
      none).
    - oscillator_side: 1 on the left, -1 on the right, 0 in the middle.

    Each coordinate can select, for example tension.sel(cable_bodies="T2-T3").
    """
    import xarray

    structure, bodies = robot.structure, len(robot.structure.bodies)
    poses = motion.first_states(robot)[:, : 7 * bodies].reshape(-1, bodies, 7)
    parts = [
        forces_of_motion(phase.robot.model, part.states, part.modes, part.signals, part.drives)
        for phase, part in motion.by_phase(robot)
    ]
    nodes, cable_forces, ground_forces = map(np.concatenate, zip(*parts, strict=True))
    if motion.ground_forces is not None:
        ground_forces = motion.ground_forces
    free_lengths = np.tile(structure.cables["free_length"], (len(motion.times), 1))
    actuator, driven = robot.model.actuator, np.sort(robot.driven)
    if has_drive(actuator):  # winches change the free lengths
        free_lengths[:, driven] = wound(actuator, motion.drives, free_lengths[:, driven])
    modes = np.sign(motion.modes[:, :, :STICK_POINT])
    values = {
        "p_WN": nodes[..., P_WN : P_WN + 3],
        "v_WN": nodes[..., V_WN : V_WN + 3],
        "p_WB": poses[..., 4:],
        "q_WB": poses[..., :4],
        "tension": cable_forces[..., cable.TENSION],
        "length": cable_forces[..., cable.LENGTH],
        "free_length": free_lengths,
        "signal": motion.signals,
        "normal_force": ground_forces[..., 2],
        "friction_force": ground_forces[..., :2],
        "in_contact": modes[..., 0],
        "friction_mode": modes[..., 1:],
    }
    data: dict[str, Any] = {}
    for name, (dimensions, unit, meaning) in VARIABLES.items():
        kind: Any = np.float32 if name == "v_WN" else np.float64
        attributes: dict[str, Any] = {"units": unit, "long_name": meaning}
        if flags := _FLAGS.get(name):
            kind = np.int8
            attributes["flag_values"] = np.array(list(flags), dtype=kind)
            attributes["flag_meanings"] = " ".join(flags.values())
        # The values are a copy, because a view would keep a whole table in memory.
        data[name] = dimensions, np.array(values[name], dtype=kind), attributes
    data["friction_mode"][2]["long_name"] = robot.scenario.friction.modes
    clock = {"units": "s", "long_name": "time since the start"}
    data["time"] = "time", motion.times, clock, {"_FillValue": None}
    named = tuple((name, along, *values) for name, (along, values) in labels(structure).items())
    return xarray.Dataset(data, coords=_coordinates(named))


@functools.lru_cache(maxsize=32)
def _coordinates(named: tuple[tuple[Any, ...], ...]) -> xarray.Coordinates:
    """Coordinates of a dataset with their indexes. `named` has a tuple for each: name, dimension,
    then the labels along it. They are cached, because making them takes half of the time of
    make_dataset()."""
    import xarray

    given = {name: (along, list(values)) for name, along, *values in named}
    return with_indexes(xarray.Dataset(coords=given)).coords


def with_indexes(dataset: xarray.Dataset) -> xarray.Dataset:
    """A dataset with an index for each coordinate, so that sel() finds its labels. Use it after
    reading a file, because files do not keep indexes."""
    from tetra_drake.results.label_index import LabelIndex

    for name in dataset.coords.keys() - dataset.xindexes.keys():
        dataset = dataset.set_xindex(str(name), LabelIndex)
    return dataset


def labels(structure: Structure) -> dict[str, tuple[str, list[Any]]]:
    """Coordinates of a trajectory of a structure, except time. Key: the name; value: the dimension,
    and the labels along it."""
    oscillators, cables = structure.oscillators, structure.cables
    driving = ["" if i == cable.PASSIVE else oscillators[i] for i in cables["signal"]]
    body_of_node = list(structure.body_of_node)
    joined = [f"{body_of_node[a]}-{body_of_node[b]}" for a, b in cables[["node_a", "node_b"]]]
    contacts = structure.contacts
    return {
        "body": ("body", list(structure.bodies)),
        "node": ("node", list(structure.node_names)),
        "node_body": ("node", body_of_node),
        "contact": ("contact", [structure.node_names[node] for node in contacts]),
        "contact_body": ("contact", [body_of_node[node] for node in contacts]),
        "cable": ("cable", list(structure.cable_names)),
        "cable_bodies": ("cable", joined),
        "cable_group": ("cable", list(structure.cable_groups)),
        "cable_signal": ("cable", driving),
        "oscillator": ("oscillator", list(oscillators)),
        "oscillator_side": ("oscillator", list(structure.sides)),
        "axis": ("axis", ["x", "y", "z"]),
        "horizontal": ("horizontal", ["x", "y"]),
        "quaternion": ("quaternion", ["w", "x", "y", "z"]),
    }


def save_dataset(dataset: xarray.Dataset, path: str | Path) -> None:
    """Writes a dataset as compressed netCDF, for xarray.open_dataset()."""
    encoding = {name: {"zlib": True, "complevel": 4} for name in dataset.data_vars}
    content = io.BytesIO()  # in memory: on a full disk, HDF5 raises other errors
    dataset.to_netcdf(content, engine="h5netcdf", encoding=encoding)
    write_whole(path, content.getvalue())
