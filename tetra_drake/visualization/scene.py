"""The robot as a Meshcat scene: what is drawn, how it moves, the floor and the camera."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.geometry import Box, Cylinder, Meshcat, MeshcatCone, Rgba, Sphere
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from tetra_drake.physics.cable import PASSIVE
from tetra_drake.physics.contact import Ground
from tetra_drake.robot.bodies import strut_pose
from tetra_drake.robot.ground import ground_axes, ground_heights
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import Structure
from tetra_drake.scenario.units import INCH, POUND_FORCE

if TYPE_CHECKING:
    import xarray

COLOURS = {
    "actuated": "#d55e00",
    "passive_1": "#56b4e9",
    "passive_2": "#009e73",
    "passive_3": "#e69f00",
    "passive_4": "#f0e442",
    "normal": "#0072b2",
    "friction": "#cc79a7",
    "trace": "#222222",
    "forward": "#444444",
    "odd": "#5d6672",
    "even": "#b4bbc3",
    "floor": "#f2f1ec",
    "low": "#c4b080",
    "high": "#f6f3ea",
    "inch_on_relief": "#b5ad98",
    "inch": "#d3d2cb",
    "six_inches": "#8f8e87",
}
"""Colours of what is drawn (those of cables and forces are Okabe and Ito's, for colour-blind
people); neighbouring bodies alternate between odd and even. Uneven ground goes from low to
high."""

PASSIVE_COLOURS = "passive_1", "passive_2", "passive_3", "passive_4"
"""Colours of the groups of cables, in turn, for those cables that no oscillator drives."""

CABLE_RADIUS = 0.0003
"""Drawn radius of a cable, in m per N of tension."""

ARROW_LENGTH = 30.0 * INCH / POUND_FORCE
"""Length of a force's arrow in m per N: 6 in are 0.2 lbf."""

HIDDEN = 1e-4
"""Drawn force in N where there is none: a scale of 0, also a rounded one, would make matrices
singular."""

MARGIN, UNEVEN_MARGIN = 2, 6
"""Whole inches of floor around the robot's way; more where one wants to see where it goes."""

MOST_POINTS = 12_000
"""Largest number of points of uneven ground, about: they take some 0.8 MB of a page."""

_HAIRLINE = 0.0001  # m: the least drawn radius of a cable
_ARROW_WIDTH = 0.06  # m: a length above which an arrow grows no thicker
_FORWARD_LENGTH = 6.0 * INCH  # of the arrow on the floor that shows the direction of travel
_FINEST = 12  # points per inch of uneven ground, at most
_BEND = 1e-6  # m: a second difference of heights below which the ground is straight
_WALL = 0.25 * INCH  # height of the lowest wall around uneven ground
_RELIEF = 2.0  # steepness with which slopes are shaded, over the true one
_GAMMA = 2.2  # browsers take the colours of vertices as linear, others as sRGB

# Direction to the light that shades uneven ground: from behind the robot and its left.
_LIGHT = np.array([-0.5, 0.3, 0.8]) / np.linalg.norm([-0.5, 0.3, 0.8])

FIELD_OF_VIEW, ASPECT = 35.0, 1.7
"""Camera's degrees from top to bottom, and width over height of the window it is placed for."""

VIEW = -0.35, 1.0, -0.4
"""Direction in which the camera looks: from the robot's right and front, down on it."""


@dataclass(frozen=True)
class Track:
    """Motion of the object at a path of the scene over some frames."""

    path: str
    positions: np.ndarray
    """Positions (frames, 3) in m."""
    quaternions: np.ndarray | None = None
    """Rotations (frames, 4), w first; None for an object that keeps the axes of World."""
    scales: np.ndarray | None = None
    """Factors (frames, 3) along its axes; None for an object that keeps its size."""

    def matrix(self, frame: int) -> np.ndarray:
        """Transformation (4, 4), with scaling, of the object in one frame."""
        matrix = np.eye(4)
        if self.quaternions is not None:
            matrix[:3, :3] = RotationMatrix(Quaternion(self.quaternions[frame])).matrix()
        if self.scales is not None:
            matrix[:3, :3] *= self.scales[frame]
        matrix[:3, 3] = self.positions[frame]
        return matrix


def add_robot(meshcat: Meshcat, structure: Structure) -> None:
    """Adds the objects that tracks() move: bodies, cables, and arrows for forces."""
    _add_bodies(meshcat, structure)
    colours = cable_colours(structure)
    for kind, path in zip(cable_kinds(structure), _cable_paths(structure), strict=True):
        meshcat.SetObject(path, Cylinder(1.0, 1.0), rgba(colours[kind]))
    for node in structure.contacts:
        for kind in ("normal", "friction"):
            path = f"/forces/{kind}/{structure.node_names[node]}"
            _add_unit_arrow(meshcat, path, rgba(kind))


def tracks(robot: Robot, frames: xarray.Dataset) -> Iterator[Track]:
    """Tracks of all objects over `frames`, samples of a trajectory."""
    yield from _body_tracks(robot.structure, frames)
    yield from _cable_tracks(robot.structure, frames)
    yield from _force_tracks(robot, frames)


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


def set_surroundings(meshcat: Meshcat, robot: Robot, points: np.ndarray) -> None:
    """Sets floor, light and camera for a robot whose nodes stay around `points` (..., 3), in m.

    The floor is the ground lowered by the least radius of a node, as the ground acts on node
    centres.
    """
    ground = robot.ground
    corners = floor_corners(points, MARGIN if ground.flat else UNEVEN_MARGIN)
    floor = floor_points(ground, corners) - [0.0, 0.0, robot.structure.node_radius.min()]
    if ground.flat:
        _add_slab(meshcat, floor)
    else:
        _add_relief(meshcat, floor)
    _add_grid(meshcat, floor, inch="inch" if ground.flat else "inch_on_relief")
    for unused in ("/Grid", "/Axes"):
        meshcat.SetProperty(unused, "visible", False)
    meshcat.SetProperty("/Background/<object>", "top_color", [0.86, 0.9, 0.95])
    meshcat.SetProperty("/Background/<object>", "bottom_color", [1.0, 1.0, 1.0])
    meshcat.SetProperty("/Lights/AmbientLight/<object>", "intensity", 0.9)
    meshcat.SetProperty("/Cameras/default/rotated/<object>", "fov", FIELD_OF_VIEW)
    _add_forward_arrow(meshcat, floor)
    seen = np.vstack([points.reshape(-1, 3), floor.reshape(-1, 3)])
    if not ground.flat:
        below = floor.copy()
        below[..., 2] = _bottom(floor)
        seen = np.vstack([seen, below.reshape(-1, 3)])
    target = (seen.min(axis=0) + seen.max(axis=0)) / 2
    meshcat.SetCameraPose(camera_position(seen, target), target)


def floor_corners(points: np.ndarray, margin: int = MARGIN) -> np.ndarray:
    """Least and greatest x, y (2, 2) of the floor, in whole inches around `points` (..., 3)."""
    x_y = points.reshape(-1, 3)[:, :2] / INCH
    low, high = np.floor(x_y.min(axis=0)) - margin, np.ceil(x_y.max(axis=0)) + margin
    return np.array([low, high], dtype=int)


def floor_points(ground: Ground, corners: np.ndarray) -> np.ndarray:
    """Points (rows, columns, 3) in m of the ground between corners (2, 2) in whole inches.

    Rows along x, columns along y: at every inch, and between them where the ground bends, as
    finely as MOST_POINTS allows.
    """
    (x_low, y_low), (x_high, y_high) = corners
    for per_inch in range(1 if ground.flat else _FINEST, 0, -1):
        rows = np.arange(x_low * per_inch, x_high * per_inch + 1)
        columns = np.arange(y_low * per_inch, y_high * per_inch + 1)
        x, y = np.meshgrid(rows / per_inch * INCH, columns / per_inch * INCH, indexing="ij")
        z = ground_heights(np.stack([x, y], axis=-1), ground)
        bend_along = np.abs(np.diff(z, 2, axis=0)).max(axis=1)
        bend_across = np.abs(np.diff(z, 2, axis=1)).max(axis=0)
        rows = np.flatnonzero((rows % per_inch == 0) | np.pad(bend_along > _BEND, 1))
        columns = np.flatnonzero((columns % per_inch == 0) | np.pad(bend_across > _BEND, 1))
        if len(rows) * len(columns) <= MOST_POINTS:
            break
    return np.stack([x, y, z], axis=-1)[np.ix_(rows, columns)]


def camera_position(points: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Position from which a camera aimed at `target` (3,) sees all `points` (points, 3)."""
    forward = np.array(VIEW) / np.linalg.norm(VIEW)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    offset = points - target
    slope = np.tan(np.deg2rad(FIELD_OF_VIEW) / 2)
    for_width = np.abs(offset @ right) / (ASPECT * slope) - offset @ forward
    for_height = np.abs(offset @ up) / slope - offset @ forward
    margin = 1.05
    return target - margin * max(for_width.max(), for_height.max()) * forward


def rgba(name: str) -> Rgba:
    """Colour of this name in COLOURS, opaque."""
    return Rgba(*_rgb(name))


def _rgb(name: str) -> np.ndarray:
    return np.frombuffer(bytes.fromhex(COLOURS[name][1:]), dtype=np.uint8) / 255


def _add_bodies(meshcat: Meshcat, structure: Structure) -> None:
    """Adds struts and nodes below the paths of their bodies, in the frames of these."""
    names, p_BN = structure.node_names, structure.p_BN
    paths = [f"/robot/{structure.bodies[body]}" for body in structure.carriers]
    colours = [rgba("even" if body % 2 else "odd") for body in structure.carriers]
    for (a, b), radius in zip(structure.struts, structure.strut_radius, strict=True):
        path = f"{paths[a]}/strut {names[a]} to {names[b]}"
        strut = Cylinder(radius, float(np.linalg.norm(p_BN[b] - p_BN[a])))
        meshcat.SetObject(path, strut, colours[a])
        meshcat.SetTransform(path, strut_pose(p_BN[a], p_BN[b]))
    for node, radius in enumerate(structure.node_radius):
        path = f"{paths[node]}/node {names[node]}"
        meshcat.SetObject(path, Sphere(radius), colours[node])
        meshcat.SetTransform(path, RigidTransform(p_BN[node]))


def cable_kinds(structure: Structure) -> list[str]:
    """Kind of each cable: "actuated", or such as "passive outer", with its group."""
    cables = zip(structure.cables["signal"], structure.cable_groups, strict=True)
    return ["actuated" if signal != PASSIVE else f"passive {group}" for signal, group in cables]


def cable_colours(structure: Structure) -> dict[str, str]:
    """Name in COLOURS of each kind of cable that the structure has."""
    passive = [f"passive {group}" for group in dict.fromkeys(structure.cable_groups)]
    colours = {"actuated": "actuated", **dict(zip(passive, itertools.cycle(PASSIVE_COLOURS)))}
    kinds = cable_kinds(structure)
    return {kind: colour for kind, colour in colours.items() if kind in kinds}


def _cable_paths(structure: Structure) -> list[str]:
    named = zip(cable_kinds(structure), structure.cable_names, strict=True)
    return [f"/cables/{kind}/{name}" for kind, name in named]


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


def _body_tracks(structure: Structure, frames: xarray.Dataset) -> Iterator[Track]:
    q_WB = frames["q_WB"].values
    q_WB = q_WB / np.linalg.norm(q_WB, axis=-1, keepdims=True)
    for body, name in enumerate(structure.bodies):
        yield Track(f"/robot/{name}", frames["p_WB"].values[:, body], q_WB[:, body])


def _cable_tracks(structure: Structure, frames: xarray.Dataset) -> Iterator[Track]:
    """Unit cylinders scaled to reach from node to node, with radii proportional to tension."""
    p_WN = frames["p_WN"].values
    radius = (CABLE_RADIUS * frames["tension"].values).clip(min=_HAIRLINE)
    for c, (cable, path) in enumerate(zip(structure.cables, _cable_paths(structure), strict=True)):
        p_WA, p_WB = p_WN[:, cable["node_a"]], p_WN[:, cable["node_b"]]
        length = np.linalg.norm(p_WB - p_WA, axis=1)
        yield Track(
            path,
            (p_WA + p_WB) / 2,
            aligning_quaternions(p_WB - p_WA),
            np.column_stack([radius[:, c], radius[:, c], length]),
        )


def _force_tracks(robot: Robot, frames: xarray.Dataset) -> Iterator[Track]:
    """Unit arrows on the contact nodes, scaled to the forces there, along the ground's normal and
    in its tangent plane."""
    p_WN = frames["p_WN"].values
    normal, friction = frames["normal_force"].values, frames["friction_force"].values
    for c, node in enumerate(robot.structure.contacts):
        name = robot.structure.node_names[node]
        force = np.append(friction[:, c], np.zeros((len(friction), 1)), axis=1)
        size = np.linalg.norm(force, axis=1)
        upright = None
        if not robot.ground.flat:
            axes = ground_axes(p_WN[:, node], robot.ground)
            upright = aligning_quaternions(normal[:, c, np.newaxis] * axes[:, 2])
            force = np.einsum("fi,fij->fj", force, axes)
        scales = _arrow_scales(normal[:, c])
        yield Track(f"/forces/normal/{name}", p_WN[:, node], upright, scales)
        quaternions = aligning_quaternions(force)
        yield Track(f"/forces/friction/{name}", p_WN[:, node], quaternions, _arrow_scales(size))


def _arrow_scales(sizes: np.ndarray) -> np.ndarray:
    """Scales (frames, 3) of the unit arrow for forces of these sizes (frames,), in N."""
    length = ARROW_LENGTH * sizes.clip(min=HIDDEN)
    width = length.clip(max=_ARROW_WIDTH)
    return np.column_stack([width, width, length])


def _add_slab(meshcat: Meshcat, floor: np.ndarray) -> None:
    """A slab whose top is the flat floor (rows, columns, 3), in m."""
    thickness = 0.002
    width, depth, _ = floor[-1, -1] - floor[0, 0]
    middle = (floor[-1, -1] + floor[0, 0]) / 2
    meshcat.SetObject("/floor/slab", Box(width, depth, thickness), rgba("floor"))
    meshcat.SetTransform("/floor/slab", RigidTransform(middle - [0.0, 0.0, thickness / 2]))


def _add_relief(meshcat: Meshcat, floor: np.ndarray) -> None:
    """The surface through the floor's points (rows, columns, 3), the lighter the higher, with
    shaded slopes, and walls around it."""
    x, y, z = np.moveaxis(floor, -1, 0)
    slopes = _RELIEF * np.array(np.gradient(z, x[:, 0], y[0]))
    normal = np.stack([*-slopes, np.ones_like(z)], axis=-1)
    lit = (normal @ _LIGHT / np.linalg.norm(normal, axis=-1) / _LIGHT[2]).clip(0.6, 1.2)
    share = (z - z.min()) / max(np.ptp(z), 0.1 * INCH)
    low, high = _rgb("low"), _rgb("high")
    colours = (low + share[..., np.newaxis] * (high - low)) * lit[..., np.newaxis]
    around = ((1, 1), (1, 1), (0, 0))
    walls = np.pad(np.ones_like(z), 1) == 0.0
    vertices, colours = np.pad(floor, around, "edge"), np.pad(colours, around, "edge")
    vertices[walls, 2] = _bottom(floor)
    colours[walls] *= 0.5
    index = np.arange(walls.size, dtype=np.int32).reshape(walls.shape)
    a, b = index[:-1, :-1].ravel(), index[1:, :-1].ravel()
    c, d = index[1:, 1:].ravel(), index[:-1, 1:].ravel()
    meshcat.SetTriangleColorMesh(
        "/floor/relief",
        vertices.reshape(-1, 3).T,
        np.column_stack([a, b, c, a, c, d]).reshape(-1, 3).T,
        ((colours.clip(0.0, 1.0) * 255).round() / 255).reshape(-1, 3).T ** _GAMMA,
    )


def _bottom(floor: np.ndarray) -> float:
    """Height (m) at which the walls around uneven floor end."""
    return float(floor[..., 2].min()) - _WALL


def _add_grid(meshcat: Meshcat, floor: np.ndarray, *, inch: str) -> None:
    """Lines along and across the floor (rows, columns, 3), of colour `inch` at every inch."""
    inches: list[np.ndarray] = []
    six_inches: list[np.ndarray] = []
    for axis in (0, 1):
        for line in np.moveaxis(floor, axis, 0):
            place = line[0, axis] / INCH
            if abs(place - round(place)) > 1e-6:
                continue
            straight = np.ptp(line[:, 2]) == 0.0
            points = line[[0, -1]] if straight else line
            (six_inches if round(place) % 6 == 0 else inches).append(points)
    # Lines float a little, else the floor shows through them.
    _add_lines(meshcat, "/floor/inch", inches, lift=0.0002, colour=rgba(inch))
    _add_lines(meshcat, "/floor/six_inches", six_inches, lift=0.0004, colour=rgba("six_inches"))


def _add_lines(
    meshcat: Meshcat, path: str, lines: Sequence[np.ndarray], *, lift: float, colour: Rgba
) -> None:
    """Lines through points (points, 3), raised by `lift`, in m."""
    raised = [line + np.array([0.0, 0.0, lift]) for line in lines]
    start = np.vstack([line[:-1] for line in raised])
    end = np.vstack([line[1:] for line in raised])
    meshcat.SetLineSegments(path, start.T, end.T, rgba=colour)


def _add_forward_arrow(meshcat: Meshcat, floor: np.ndarray) -> None:
    """An arrow on the floor (rows, columns, 3), in the middle of its right side, along x."""
    _add_unit_arrow(meshcat, "/floor/forward", rgba("forward"))
    y = floor[0, 0, 1] + INCH
    row = floor[:, np.abs(floor[0, :, 1] - y).argmin()]
    start = (floor[0, 0, 0] + floor[-1, 0, 0] - _FORWARD_LENGTH) / 2
    way = np.linspace(0.0, 1.0, 25)
    z = np.interp(start + way * _FORWARD_LENGTH, row[:, 0], row[:, 2])
    rise = z[-1] - z[0]
    lift = (z - z[0] - way * rise).max()  # onto what is between its ends
    forward = Track(
        "/floor/forward",
        np.array([[start, y, z[0] + lift]]),
        aligning_quaternions(np.array([[1.0, 0.0, rise / _FORWARD_LENGTH]])),
        np.full((1, 3), _FORWARD_LENGTH),
    )
    meshcat.SetTransform(forward.path, forward.matrix(0))
