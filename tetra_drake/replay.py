"""A recorded trajectory as one HTML page that plays it in any browser, with no server."""

from __future__ import annotations

import html
import logging
import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.geometry import (
    Box,
    Cylinder,
    Meshcat,
    MeshcatAnimation,
    MeshcatCone,
    MeshcatParams,
    Rgba,
    Sphere,
)
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from tetra_drake.files import write_whole
from tetra_drake.physics.cable import PASSIVE
from tetra_drake.robot import (
    BOTTOM_LEFT,
    BOTTOM_RIGHT,
    NODES,
    STRUTS,
    TIP,
    MakeStructure,
    Structure,
    strut_pose,
)
from tetra_drake.scenario import Scenario
from tetra_drake.units import INCH

if TYPE_CHECKING:
    import xarray

FRAMES_PER_SECOND = 25.0
"""Key frames per second of motion, at most; 15 s then make a page of 6 MB."""

TICKS_PER_SECOND = 100_000
"""Resolution of a key frame's time: Meshcat counts in integers."""

COLOURS = {
    "actuated": "#d55e00",
    "outer": "#56b4e9",
    "inner": "#009e73",
    "normal": "#0072b2",
    "friction": "#cc79a7",
    "trace": "#222222",
    "odd": "#5d6672",
    "even": "#b4bbc3",
    "floor": "#f2f1ec",
    "inch": "#d3d2cb",
    "six_inches": "#8f8e87",
}
"""What is drawn in which colour (those of cables and forces after Okabe and Ito, who chose
them for colour-blind people); neighbouring tetrahedra alternate between odd and even."""

LEGEND = {
    "actuated": "actuated cable",
    "outer": "passive outer cable",
    "inner": "passive inner cable",
    "normal": "normal force",
    "friction": "friction force",
    "trace": "path of the bottom nodes",
}

CABLE_RADIUS = 0.0004, 0.0002
"""Drawn radius of a cable: m without tension, and m more for each N."""

ARROW_LENGTH = 0.15
"""Length of a force's arrow in m for each N."""

HIDDEN = 1e-6
"""Scale of an arrow without force; at 0 its matrices would be singular."""

FIELD_OF_VIEW, ASPECT = 35.0, 1.5
"""Of the camera: degrees top to bottom, and the narrowest window that still shows all."""

VIEW = -0.35, 1.0, -0.4
"""The direction the camera looks in: from the robot's right and front, down on it."""


def save_replay(
    path: str | Path, *, scenario: Scenario, trajectory: xarray.Dataset, title: str
) -> None:
    """Writes the page that replays a trajectory (see trajectory.make_dataset).

    Every key frame is a sample of the trajectory, at that sample's time; nothing is
    simulated again. Browsers show at their own rate what lies between two key frames.

    Raises InputError if `path` cannot be written.
    """
    structure = MakeStructure(scenario.robot, scenario.cables)
    times = trajectory["time"].values
    frames = trajectory.isel(time=frame_samples(times))
    meshcat = _quiet_meshcat()
    film = _Film(meshcat, frames["time"].values)
    _add_tetrahedra(film, structure, frames)
    _add_cables(film, structure, frames)
    _add_forces(film, structure, frames)
    film.publish()
    p_WN = trajectory["p_WN"].values
    _add_traces(meshcat, structure, p_WN)
    _add_floor(meshcat, floor_corners(p_WN), height=-structure.node_radius)
    _set_view(meshcat, p_WN)
    write_whole(path, _with_title(meshcat.StaticHtml(), title))


def frame_samples(times: np.ndarray, rate: float = FRAMES_PER_SECOND) -> np.ndarray:
    """Indices of the samples to show: those nearest to `rate` instants a second.

    `times` (samples,) in s, ascending; the first and the last sample are always shown.
    """
    if len(times) == 1:
        return np.array([0])
    instants = np.linspace(times[0], times[-1], int((times[-1] - times[0]) * rate) + 1)
    after = np.searchsorted(times, instants).clip(min=1)
    before = after - 1
    nearest = np.where(instants - times[before] <= times[after] - instants, before, after)
    return np.unique(nearest)


def body_poses(structure: Structure, p_WN: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """R_WB (..., 3, 3) and p_WB (..., 3) of bodies whose nodes are at p_WN (..., 4, 3), in m.

    The best fit (Kabsch), which is exact as the nodes are fixed in the body.
    """
    centre_B, centre_W = structure.p_BN.mean(axis=0), p_WN.mean(axis=-2)
    spread = np.swapaxes(p_WN - centre_W[..., np.newaxis, :], -1, -2)
    U, _, Vt = np.linalg.svd(spread @ (structure.p_BN - centre_B))
    U[..., 2] *= np.sign(np.linalg.det(U @ Vt))[..., np.newaxis]  # a rotation, never a reflection
    R_WB = U @ Vt
    return R_WB, centre_W - R_WB @ centre_B


def aligning_quaternions(directions: np.ndarray) -> np.ndarray:
    """Unit quaternions (..., 4), w first, that turn the z axis to `directions` (..., 3).

    By the shortest arc, so that a direction that moves smoothly turns smoothly. A zero
    direction, and straight down, where that arc is not unique, get some rotation.
    """
    length = np.linalg.norm(directions, axis=-1)
    x, y, z = np.moveaxis(directions, -1, 0)
    q = np.stack([length + z, -y, x, np.zeros_like(x)], axis=-1)
    q[length == 0.0] = (1.0, 0.0, 0.0, 0.0)
    norm = np.linalg.norm(q, axis=-1, keepdims=True)
    down = norm[..., 0] <= 1e-9 * length
    q[down], norm[down] = (0.0, 1.0, 0.0, 0.0), 1.0
    return q / norm


class _Film:
    """Objects of a Meshcat scene and their key frames, one for each of `times` (s)."""

    def __init__(self, meshcat: Meshcat, times: np.ndarray) -> None:
        self.meshcat = meshcat
        self._animation = MeshcatAnimation(frames_per_second=TICKS_PER_SECOND)
        self._ticks = np.rint((times - times[0]) * TICKS_PER_SECOND).astype(int).tolist()

    def pose(self, path: str, quaternions: np.ndarray, positions: np.ndarray) -> None:
        """Key frames of a pose: quaternions (frames, 4), w first, and positions (frames, 3)."""
        poses = [
            RigidTransform(Quaternion(q), p) for q, p in zip(quaternions, positions, strict=True)
        ]
        self.meshcat.SetTransform(path, poses[0])
        for tick, X in zip(self._ticks, poses, strict=True):
            self._animation.SetTransform(tick, path, X)

    def vector(self, path: str, name: str, values: np.ndarray) -> None:
        """Key frames (frames, 3) of the property "position" or "scale"."""
        rows = values.tolist()
        self.meshcat.SetProperty(path, name, rows[0])
        for tick, row in zip(self._ticks, rows, strict=True):
            self._animation.SetProperty(tick, path, name, row)

    def publish(self) -> None:
        """Hands the key frames to Meshcat; nothing can be added afterwards."""
        self.meshcat.SetAnimation(self._animation)


def _add_tetrahedra(film: _Film, structure: Structure, frames: xarray.Dataset) -> None:
    """Struts and nodes, one folder for each body."""
    R_WB, p_WB = body_poses(structure, frames["p_WN"].values)
    for i, body in enumerate(structure.bodies):
        path = f"/robot/{body}"
        colour = _rgba("even" if i % 2 else "odd")
        for a, b in STRUTS:
            strut = f"{path}/strut_{NODES[a]}_{NODES[b]}"
            length = float(np.linalg.norm(structure.p_BN[b] - structure.p_BN[a]))
            film.meshcat.SetObject(strut, Cylinder(structure.strut_radius, length), colour)
            film.meshcat.SetTransform(strut, strut_pose(structure, (a, b)))
        for name, p_BNi in zip(NODES, structure.p_BN, strict=True):
            film.meshcat.SetObject(f"{path}/{name}", Sphere(structure.node_radius), colour)
            film.meshcat.SetTransform(f"{path}/{name}", RigidTransform(p_BNi))
        quaternions = np.array([RotationMatrix(R).ToQuaternion().wxyz() for R in R_WB[:, i]])
        film.pose(path, quaternions, p_WB[:, i])


def _add_cables(film: _Film, structure: Structure, frames: xarray.Dataset) -> None:
    """Unit cylinders scaled to reach from node to node, thicker the more they pull."""
    p_WN = frames["p_WN"].values.reshape(frames.sizes["time"], -1, 3)
    slack_radius, radius_per_newton = CABLE_RADIUS
    radius = slack_radius + radius_per_newton * frames["tension"].values.clip(min=0.0)
    for c, (cable, name) in enumerate(zip(structure.cables, structure.cable_names, strict=True)):
        p_WA, p_WB = p_WN[:, cable["node_a"]], p_WN[:, cable["node_b"]]
        kind = _cable_kind(cable)
        path = f"/cables/{kind}/{name}"
        film.meshcat.SetObject(path, Cylinder(1.0, 1.0), _rgba(kind))
        film.pose(path, aligning_quaternions(p_WB - p_WA), (p_WA + p_WB) / 2)
        length = np.linalg.norm(p_WB - p_WA, axis=1)
        film.vector(path, "scale", np.column_stack([radius[:, c], radius[:, c], length]))


def _cable_kind(cable: np.void) -> str:
    if cable["signal"] != PASSIVE:
        return "actuated"
    return "inner" if cable["node_a"] % len(NODES) == TIP else "outer"


def _add_forces(film: _Film, structure: Structure, frames: xarray.Dataset) -> None:
    """An arrow for the normal and one for the friction force on each contact node."""
    p_WN = frames["p_WN"].values.reshape(frames.sizes["time"], -1, 3)
    normal = np.zeros((*frames["normal_force"].shape, 3))
    normal[..., 2] = frames["normal_force"].values
    friction = np.zeros_like(normal)
    friction[..., :2] = frames["friction_force"].values
    for c, node in enumerate(structure.contacts):
        name = structure.node_names[node]
        for kind, force in (("normal", normal[:, c]), ("friction", friction[:, c])):
            path = f"/forces/{kind}/{name}"
            _add_unit_arrow(film.meshcat, path, _rgba(kind))
            length = ARROW_LENGTH * np.linalg.norm(force, axis=1).clip(min=HIDDEN)
            film.vector(path, "scale", np.repeat(length[:, np.newaxis], 3, axis=1))
            if kind == "normal":  # upright as it was made
                film.vector(path, "position", p_WN[:, node])
            else:
                film.pose(path, aligning_quaternions(force), p_WN[:, node])


def _add_unit_arrow(meshcat: Meshcat, path: str, colour: Rgba) -> None:
    """An arrow 1 m long from the origin of `path` along its z axis."""
    head, shaft_radius, head_radius = 0.25, 0.025, 0.07
    meshcat.SetObject(f"{path}/shaft", Cylinder(shaft_radius, 1.0 - head), colour)
    meshcat.SetTransform(f"{path}/shaft", RigidTransform([0.0, 0.0, (1.0 - head) / 2]))
    meshcat.SetObject(f"{path}/head", MeshcatCone(head, head_radius, head_radius), colour)
    # The cone's own tip is at its origin, and it opens along its z axis.
    meshcat.SetTransform(
        f"{path}/head", RigidTransform(RollPitchYaw(np.pi, 0.0, 0.0), [0.0, 0.0, 1.0])
    )


def _add_traces(meshcat: Meshcat, structure: Structure, p_WN: np.ndarray) -> None:
    """The whole paths of all bottom nodes; p_WN (samples, bodies, 4, 3) in m."""
    for i, body in enumerate(structure.bodies):
        for node in (BOTTOM_LEFT, BOTTOM_RIGHT):
            path = f"/traces/{body} {NODES[node]}"
            meshcat.SetLine(path, p_WN[:, i, node].T, rgba=_rgba("trace"))


def floor_corners(p_WN: np.ndarray) -> np.ndarray:
    """Least and greatest x, y (2, 2) of the floor, in whole inches around all p_WN (..., 3)."""
    margin = 2
    x_y = p_WN.reshape(-1, 3)[:, :2] / INCH
    low, high = np.floor(x_y.min(axis=0)) - margin, np.ceil(x_y.max(axis=0)) + margin
    return np.array([low, high], dtype=int)


def _add_floor(meshcat: Meshcat, corners: np.ndarray, *, height: float) -> None:
    """A slab with its top at z = height (m), and on it a grid of inches."""
    low, high = corners
    thickness, lift = 0.002, 0.0002  # lines float a little, else the slab shows through them
    (width, depth), middle = (high - low) * INCH, (high + low) / 2 * INCH
    meshcat.SetObject("/floor/slab", Box(width, depth, thickness), _rgba("floor"))
    meshcat.SetTransform("/floor/slab", RigidTransform([*middle, height - thickness / 2]))
    lines: dict[str, list[np.ndarray]] = {"inch": [], "six_inches": []}
    for axis in (0, 1):
        for inch in range(low[axis], high[axis] + 1):
            line = corners.copy()
            line[:, axis] = inch
            lines["six_inches" if inch % 6 == 0 else "inch"].append(line)
    for rank, (kind, some) in enumerate(lines.items(), start=1):
        level = np.full((1, len(some)), height + rank * lift)
        start, end = (np.vstack([np.array(some)[:, i].T * INCH, level]) for i in (0, 1))
        meshcat.SetLineSegments(f"/floor/{kind}", start, end, rgba=_rgba(kind))


def _set_view(meshcat: Meshcat, p_WN: np.ndarray) -> None:
    """Light background, and a camera that sees all nodes p_WN (..., 3) of all samples."""
    for unused in ("/Grid", "/Axes"):
        meshcat.SetProperty(unused, "visible", False)
    meshcat.SetProperty("/Background/<object>", "top_color", [0.86, 0.9, 0.95])
    meshcat.SetProperty("/Background/<object>", "bottom_color", [1.0, 1.0, 1.0])
    meshcat.SetProperty("/Cameras/default/rotated/<object>", "fov", FIELD_OF_VIEW)
    points = p_WN.reshape(-1, 3)
    target = (points.min(axis=0) + points.max(axis=0)) / 2
    meshcat.SetCameraPose(camera_position(points, target), target)


def camera_position(points: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Where a camera aimed at `target` (3,) sees all `points` (points, 3) with some margin."""
    forward = np.array(VIEW) / np.linalg.norm(VIEW)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    offset = points - target
    slope = np.tan(np.deg2rad(FIELD_OF_VIEW) / 2)
    for_width = np.abs(offset @ right) / (ASPECT * slope) - offset @ forward
    for_height = np.abs(offset @ up) / slope - offset @ forward
    margin = 1.1
    return target - margin * max(for_width.max(), for_height.max()) * forward


def _rgba(name: str) -> Rgba:
    red, green, blue = (value / 255 for value in bytes.fromhex(COLOURS[name][1:]))
    return Rgba(red, green, blue, 1.0)


def _quiet_meshcat() -> Meshcat:
    """A Meshcat that does not announce its server, which is gone before anyone could visit."""
    logger = logging.getLogger("drake")
    level = logger.level
    logger.setLevel(logging.WARNING)
    try:
        return Meshcat(MeshcatParams(host="localhost", port=0))
    finally:
        logger.setLevel(level)


_HEADING = """
<div style="position: fixed; left: 16px; top: 12px; right: 270px; pointer-events: none;
    font-family: sans-serif; color: #222">
  <h1 style="margin: 0; font-size: 20px; font-weight: 600">{title}</h1>
  <p style="margin: 6px 0; font-size: 13px">Grid: 1 in, darker lines every 6 in. The thicker a
    cable, the more it pulls. Open Controls: play and pause; Scene hides forces or cables.</p>
  <ul style="margin: 0; padding: 0; list-style: none; font-size: 13px">{legend}</ul>
</div>
"""

_LEGEND_ITEM = """
    <li><span style="display: inline-block; width: 22px; height: 4px; margin: 3px 8px 3px 0;
      background: {colour}"></span>{meaning}</li>"""


def _with_title(page: str, title: str) -> str:
    """Meshcat's page with a title, and over the scene a heading and a legend."""
    escaped = html.escape(title)
    legend = "".join(
        _LEGEND_ITEM.format(colour=COLOURS[name], meaning=meaning)
        for name, meaning in LEGEND.items()
    )
    heading = _HEADING.format(title=escaped, legend=legend)
    # Functions, as backslashes in a replacement text would mean something.
    page = re.sub(r"<title>.*?</title>", lambda _: f"<title>{escaped}</title>", page, count=1)
    return re.sub(r"<body[^>]*>", lambda tag: tag[0] + heading, page, count=1)
