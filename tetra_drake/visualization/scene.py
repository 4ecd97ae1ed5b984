"""Meshcat scene of the robot: bodies, cables, floor, light and camera."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.geometry import Box, Cylinder, Meshcat, Rgba, Sphere
from pydrake.math import RigidTransform, RotationMatrix

from tetra_drake.laws.cable import PASSIVE
from tetra_drake.laws.contact import Ground
from tetra_drake.robot.bodies import strut_pose
from tetra_drake.robot.ground import ground_heights
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import Structure
from tetra_drake.settings.units import INCH, Units

if TYPE_CHECKING:
    import xarray

COLOURS = {
    "rear": "#27598f",
    "lead": "#86bbe0",
    "node": "#20262e",
    "stance": "#f57c00",
    "anchor": "#7b1fa2",
    "actuated": "#c2185b",
    "passive": "#009e73",
    "force": "#111111",
    "trace": "#5b6570",
    "floor": "#f3f4f5",
    "low": "#d6c6a6",
    "high": "#f7f4ec",
    "square": "#d5d8dc",
    "square_on_relief": "#bfb6a2",
    "dark_line": "#8b929b",
    "sky": "#eef2f6",
}
"""Colours of the scene. Bodies range from `rear` to `lead`, uneven ground from `low` to `high`. A
node on the ground has the colour `stance`, a node that the world holds the colour `anchor`."""
SLENDERNESS = 60.0
"""Length of the longest strut divided by the least drawn radius. Thinner struts are hard to see."""
THICKEST, THINNEST = 0.7, 0.15
"""Drawn radius of the cable with the highest tension, and least drawn radius of a cable, in radii
of a strut."""
FLOOR_MARGIN, UNEVEN_MARGIN = 4.5, 1.5
"""Margin of floor around the robot's path, in halves of the robot's length. Uneven ground has the
smaller one, because it needs much space in a page."""
MOST_POINTS = 5_000
"""Approximate largest number of points of uneven ground."""
MOST_SQUARES = 200_000
"""Largest number of squares of flat ground. On a larger floor, only its dark lines are drawn."""

_FINEST = 12  # points per square of uneven ground, at most
_BEND = 1e-6  # m; the ground is straight if second differences of heights are smaller
_WALL = 0.5 * INCH  # least height of the walls around uneven ground
_GAMMA = 2.2  # in browsers, colours of vertices are linear; all other colours are sRGB

FIELD_OF_VIEW, ASPECT = 30.0, 1.7
"""Vertical field of view of the camera in degrees, and assumed width / height of the window."""
VIEW_SLOPE = float(np.tan(np.deg2rad(FIELD_OF_VIEW) / 2))
"""Half the height of the camera's view at the distance 1."""

VIEW = -0.45, 1.0, -0.45
"""View direction of the camera: from the robot's right and front, down on it."""

AMBIENT, SUN = 1.6, 3.2
"""Intensities of the ambient light and of the light that casts shadows."""
TO_SUN = np.array([0.25, 0.35, 1.0])
"""Direction to the light that casts shadows."""


_SHADOWS = {"left": -1.2, "right": 1.2, "top": 1.2, "bottom": -1.2, "near": 1.0, "far": 8.0}
"""Limits of the space with shadows around the target of the light, in halves of the robot's
length."""


def add_robot(meshcat: Meshcat, structure: Structure) -> None:
    """Adds bodies (struts and nodes) and cables to the scene. They have no place yet:
    place_robot() moves them to their poses."""
    names, p_BN = structure.node_names, structure.p_BN
    strut_radius, node_radius = drawn_radii(structure)
    shades = _mixed("rear", "lead", np.linspace(0.0, 1.0, len(structure.bodies)))
    for (a, b), radius in zip(structure.struts, strut_radius, strict=True):
        body = structure.carriers[a]
        path = f"/robot/{structure.bodies[body]}/strut {names[a]} to {names[b]}"
        strut = Cylinder(radius, float(np.linalg.norm(p_BN[b] - p_BN[a])))
        meshcat.SetObject(path, strut, Rgba(*shades[body]))
        meshcat.SetTransform(path, strut_pose(p_BN[a], p_BN[b]))
    colours = node_colours(structure)
    for node, path in enumerate(node_paths(structure)):
        meshcat.SetObject(path, Sphere(node_radius[node]), rgba(colours[node]))
        meshcat.SetTransform(path, RigidTransform(p_BN[node]))
    for path in cable_paths(structure):
        meshcat.SetObject(path, Cylinder(1.0, 1.0), rgba(path.split("/")[2]))


def place_robot(
    meshcat: Meshcat, robot: Robot, frame: xarray.Dataset, *, per_newton: float
) -> None:
    """Moves bodies and cables to their poses in `frame`, one sample of a trajectory (`time` has
    length 1). Nodes on the ground get their colour. `per_newton` is the drawn radius of a cable per
    newton of tension (m/N)."""
    structure = robot.structure
    for body, name in enumerate(structure.bodies):
        turn = Quaternion(frame["q_WB"].values[0, body])
        position = frame["p_WB"].values[0, body]
        meshcat.SetTransform(f"/robot/{name}", RigidTransform(turn, position))
    p_WN, radii = frame["p_WN"].values[0], cable_radii(robot, frame, per_newton)[0]
    ends = p_WN[structure.segments.ends]
    for (p_WA, p_WB), path, radius in zip(ends, cable_paths(structure), radii, strict=True):
        matrix = np.eye(4)
        matrix[:3, :3] = RotationMatrix.MakeFromOneVector(p_WB - p_WA, 2).matrix()
        matrix[:3, :3] *= radius, radius, np.linalg.norm(p_WB - p_WA)
        matrix[:3, 3] = (p_WA + p_WB) / 2
        meshcat.SetTransform(path, matrix)
    paths, colours = node_paths(structure), node_colours(structure)
    for node, touches in zip(structure.contacts, frame["in_contact"].values[0], strict=True):
        colour = [*_rgb("stance" if touches else colours[node]), 1.0]
        meshcat.SetProperty(paths[node], "color", colour)


def node_paths(structure: Structure) -> list[str]:
    """Path of each node in the tree of Meshcat, such as "/robot/T1/node T1 top"."""
    named = zip(structure.body_of_node, structure.node_names, strict=True)
    return [f"/robot/{body}/node {name}" for body, name in named]


def node_colours(structure: Structure) -> list[str]:
    """Name in COLOURS of each node's colour while it does not touch the ground."""
    colours: list[str] = np.where(structure.held.any(axis=1), "anchor", "node").tolist()
    return colours


def cable_paths(structure: Structure) -> list[str]:
    """Path of each straight piece of a cable in the scene: below /cables/actuated or
    /cables/passive. The pieces of a routed cable are numbered."""
    pieces, paths = structure.segments.cable.tolist(), []
    for piece, cable in enumerate(pieces):
        kind = "passive" if structure.cables["signal"][cable] == PASSIVE else "actuated"
        number = f" {piece - pieces.index(cable) + 1}" if cable in structure.cable_rings else ""
        paths.append(f"/cables/{kind}/{structure.cable_names[cable]}{number}")
    return paths


def drawn_radii(structure: Structure) -> tuple[np.ndarray, np.ndarray]:
    """Drawn radii of struts (struts,) and nodes (nodes,), in m: their own, but at least
    least_drawn_radius() for a strut and 1.8 times as much for a node."""
    least = least_drawn_radius(structure)
    return structure.strut_radius.clip(min=least), structure.node_radius.clip(min=1.8 * least)


def least_drawn_radius(structure: Structure) -> float:
    """Drawn radius (m) of the thinnest strut: its own, but at least the longest strut's length
    divided by SLENDERNESS."""
    longest = structure.strut_table.length.max(initial=0.0)
    return max(structure.least_radius, float(longest) / SLENDERNESS)


def radius_per_newton(structure: Structure, tension: float) -> float:
    """Drawn radius of a cable per newton of tension (m/N). A cable with `tension` (N) is drawn with
    THICKEST times the radius of the thinnest strut."""
    return THICKEST * least_drawn_radius(structure) / max(tension, 1e-9)


def cable_radii(robot: Robot, frames: xarray.Dataset, per_newton: float) -> np.ndarray:
    """Drawn radii of the straight pieces of cables (frames, pieces) in m: proportional to tension,
    between a least and a greatest radius. Cables that an event has cut are not seen."""
    structure = robot.structure
    strut = least_drawn_radius(structure)
    least, most = THINNEST * strut, 1.3 * THICKEST * strut
    radii: np.ndarray = (per_newton * frames["tension"].values).clip(least, most)
    for phase in robot.phases[1:]:  # a radius of 0 would leave a cable without a direction
        intact = phase.robot.structure.cables["intact"].clip(1e-6)
        radii[frames["time"].values >= phase.begins] *= intact
    return radii[:, structure.segments.cable]


def set_surroundings(
    meshcat: Meshcat, robot: Robot, points: np.ndarray, *, seen: np.ndarray
) -> None:
    """Adds floor and light and sets the camera. Without ground there is no floor. The light casts
    shadows.

    The floor surrounds `points` (..., 3), such as all positions of the nodes over time. The camera
    sees nodes at all of `seen` (..., 3). Both are in the world frame, in m.
    Where contact nodes are drawn larger than they are, the floor is drawn lower than the ground by
    the least difference of radii, so that they do not seem to sink in.
    """
    thick = drawn_radii(robot.structure)[1].max() * np.vstack([np.eye(3), -np.eye(3)])
    seen = (seen.reshape(-1, 1, 3) + thick).reshape(-1, 3)
    middle = (seen.min(axis=0) + seen.max(axis=0)) / 2
    reach = float(np.linalg.norm(seen - middle, axis=1).max())
    if robot.scenario.terrain.is_ground:
        _add_floor(meshcat, robot, points, reach=reach)
    for part in ("top_color", "bottom_color"):
        meshcat.SetProperty("/Background/<object>", part, _rgb("sky").tolist())
    meshcat.SetProperty("/Cameras/default/rotated/<object>", "fov", FIELD_OF_VIEW)
    meshcat.SetCameraPose(camera_position(seen, middle), middle)
    lights = "PointLightPositiveX", "PointLightNegativeX", "SpotLight"
    for unused in ("/Grid", "/Axes", *(f"/Lights/{light}" for light in lights)):
        meshcat.SetProperty(unused, "visible", False)
    meshcat.SetProperty("/Lights/AmbientLight/<object>", "intensity", AMBIENT)
    settings = {
        "intensity": SUN,
        "position": (4.0 * reach * TO_SUN / np.linalg.norm(TO_SUN)).tolist(),
        "castShadow": True,
        "shadow.mapSize.width": 2048.0,
        "shadow.mapSize.height": 2048.0,
        **{f"shadow.camera.{side}": share * reach for side, share in _SHADOWS.items()},
        "shadow.bias": -0.0005,
        "shadow.normalBias": 0.002,
    }
    for name, value in settings.items():
        meshcat.SetProperty("/Lights/FillLight/<object>", name, value)


def _add_floor(meshcat: Meshcat, robot: Robot, points: np.ndarray, *, reach: float) -> None:
    """Adds the floor around `points` (..., 3) in m, with lines around its squares. `reach` is half
    of the robot's length (m); margins of the floor are multiples of it."""
    ground, units = robot.ground, robot.scenario.units
    x_y, side = points.reshape(-1, 3)[:, :2], units.squares * units.square
    margin = (FLOOR_MARGIN if ground.flat else UNEVEN_MARGIN) * reach
    low, high = x_y.min(axis=0) - margin, x_y.max(axis=0) + margin
    corners = np.array([np.floor(low / side), np.ceil(high / side)], dtype=int)  # on dark lines
    floor = floor_points(ground, units.squares * corners, units)
    contacts = robot.structure.contacts
    sunk = drawn_radii(robot.structure)[1][contacts] - robot.structure.contact_radius[contacts]
    floor[..., 2] -= max(0.0, sunk.min())
    if ground.flat:
        thickness = 0.002 * robot.structure.scale
        width, depth, _ = floor[-1, -1] - floor[0, 0]
        middle = (floor[-1, -1] + floor[0, 0]) / 2 - [0.0, 0.0, thickness / 2]
        meshcat.SetObject("/floor/slab", Box(width, depth, thickness), rgba("floor"))
        meshcat.SetTransform("/floor/slab", RigidTransform(middle))
    else:
        _add_relief(meshcat, floor, scale=robot.structure.scale)
    lines: dict[str, list[np.ndarray]] = {"squares": [], "dark": []}
    for axis in (0, 1):
        for line in np.moveaxis(floor, axis, 0):
            position = line[0, axis] / units.square
            if abs(position - round(position)) > 1e-6:
                continue
            # A straight line has pieces, too: some browsers lose lines that pass the camera.
            points = line[:: units.squares] if np.ptp(line[:, 2]) == 0.0 else line
            lines["squares" if round(position) % units.squares else "dark"].append(points)
    # Lines are a little above the floor. Otherwise the floor would hide parts of them.
    square = "square" if ground.flat else "square_on_relief"
    for name, lift, look in (("squares", 0.0002, square), ("dark", 0.0004, "dark_line")):
        raised = [line + np.array([0.0, 0.0, lift]) for line in lines[name]]
        if raised:
            start = np.vstack([line[:-1] for line in raised])
            end = np.vstack([line[1:] for line in raised])
            meshcat.SetLineSegments(f"/floor/{name}", start.T, end.T, rgba=rgba(look))


def floor_points(ground: Ground, corners: np.ndarray, units: Units) -> np.ndarray:
    """Points of the ground (rows, columns, 3) in m, between two corners.

    `corners` (2, 2) are the least and the greatest (x, y), as whole multiples of the side of a
    square (units.square). Rows are along x, columns along y. There are points at every line, or at
    every dark line on flat ground beyond MOST_SQUARES. Where the ground bends, there are points in
    between, as many as MOST_POINTS allows.
    """
    (x_low, y_low), (x_high, y_high) = corners
    side = units.square
    many = ground.flat and (x_high - x_low) * (y_high - y_low) > MOST_SQUARES
    every = units.squares if many else 1
    for finer in range(1 if ground.flat else _FINEST, 0, -1):
        rows = np.arange(x_low * finer, x_high * finer + 1, every)
        columns = np.arange(y_low * finer, y_high * finer + 1, every)
        x, y = np.meshgrid(rows / finer * side, columns / finer * side, indexing="ij")
        z = ground_heights(np.stack([x, y], axis=-1), ground)
        bend_along = np.abs(np.diff(z, 2, axis=0)).max(axis=1)
        bend_across = np.abs(np.diff(z, 2, axis=1)).max(axis=0)
        rows = np.flatnonzero((rows % finer == 0) | np.pad(bend_along > _BEND, 1))
        columns = np.flatnonzero((columns % finer == 0) | np.pad(bend_across > _BEND, 1))
        if len(rows) * len(columns) <= MOST_POINTS:
            break
    return np.stack([x, y, z], axis=-1)[np.ix_(rows, columns)]


def view_axes() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unit vectors (3,) of the camera in the world frame: to the right, up, and forward (the
    direction of view)."""
    forward = np.array(VIEW) / np.linalg.norm(VIEW)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    return right, np.cross(right, forward), forward


def camera_position(points: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Position (3,) of a camera that looks at `target` (3,) along VIEW and sees all `points`
    (points, 3). All are in the world frame, in m."""
    right, up, forward = view_axes()
    offset = points - target
    for_width = np.abs(offset @ right) / (ASPECT * VIEW_SLOPE) - offset @ forward
    for_height = np.abs(offset @ up) / VIEW_SLOPE - offset @ forward
    return target - 1.05 * max(for_width.max(), for_height.max()) * forward


def rgba(name: str) -> Rgba:
    """The opaque colour with this name in COLOURS."""
    return Rgba(*_rgb(name))


def _rgb(name: str) -> np.ndarray:
    return np.frombuffer(bytes.fromhex(COLOURS[name][1:]), dtype=np.uint8) / 255


def _mixed(first: str, second: str, share: np.ndarray) -> np.ndarray:
    """Mixtures (..., 3), RGB from 0 to 1, of two colours by their names in COLOURS. `share` (...),
    from 0 to 1, is the share of the second."""
    return _rgb(first) + share[..., np.newaxis] * (_rgb(second) - _rgb(first))


def _add_relief(meshcat: Meshcat, floor: np.ndarray, *, scale: float) -> None:
    """Adds the surface through the points of the floor (rows, columns, 3) in m, with walls around
    it. Higher points are lighter. `scale` is the robot's size (see Blueprint.scale); the height of
    the walls grows with it."""
    z = floor[..., 2]
    share = (z - z.min()) / max(np.ptp(z), 0.1 * INCH * scale)
    colours = _mixed("low", "high", share)
    around = ((1, 1), (1, 1), (0, 0))
    walls = np.pad(np.ones_like(z), 1) == 0.0
    vertices, colours = np.pad(floor, around, "edge"), np.pad(colours, around, "edge")
    vertices[walls, 2] = z.min() - _WALL * scale
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
