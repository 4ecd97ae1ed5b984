"""Pictures of a robot as arrays of pixels, drawn by Matplotlib, without a browser."""

from __future__ import annotations

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from tetra_drake.laws.cable import PASSIVE
from tetra_drake.robot.ground import ground_heights
from tetra_drake.robot.robot import Robot
from tetra_drake.visualization.scene import (
    ASPECT,
    COLOURS,
    FLOOR_MARGIN,
    THICKEST,
    VIEW_SLOPE,
    camera_position,
    drawn_radii,
    view_axes,
)

_HEIGHT, _DPI = 400, 100
"""Height of a picture in pixels, and pixels per inch. The width is ASPECT times the height."""
_SQUARES = np.arange(-30, 31)
"""Lines of the floor on each axis, in squares from the robot."""


def picture(robot: Robot, p_WN: np.ndarray) -> np.ndarray:
    """RGB picture (height, width, 3), 0 to 255, of a robot with its nodes at p_WN (nodes, 3) in the
    world frame, in m. The camera follows the robot, and looks from the same side as in a replay."""
    structure = robot.structure
    around = structure.p_WN - structure.p_WN.mean(axis=0)
    camera = p_WN.mean(axis=0) + camera_position(1.2 * around, np.zeros(3))
    struts, nodes = drawn_radii(structure)
    drawn = []
    if robot.scenario.terrain.is_ground:
        reach, least = float(np.linalg.norm(around, axis=1).max()), robot.scenario.units.square
        side = least * np.ceil(FLOOR_MARGIN * reach / _SQUARES[-1] / least)
        x, y = side * (_SQUARES + np.round(p_WN.mean(axis=0)[:2, np.newaxis] / side))
        floor = np.zeros((y.size, x.size, 3))
        floor[..., :2] = np.stack(np.meshgrid(x, y), axis=-1)
        floor[..., 2] = ground_heights(floor[..., :2], robot.ground)
        seen, depth = _seen(floor, camera)
        seen[depth < 0.1 * reach] = np.nan  # behind the camera
        lines = [*seen, *seen.swapaxes(0, 1)]
        drawn.append(LineCollection(lines, colors=COLOURS["dark_line"], linewidths=0.5))
        below = p_WN[structure.struts]
        below[..., 2] = ground_heights(below[..., :2], robot.ground)
        shadows, depth = _seen(below, camera)
        thick = _widths(struts, depth)
        drawn.append(LineCollection(list(shadows), colors=COLOURS["square"], linewidths=thick))

    pieces = structure.segments
    is_driven = structure.cables["signal"][pieces.cable] != PASSIVE
    cables = np.where(is_driven, COLOURS["actuated"], COLOURS["passive"])
    points = np.tile(np.arange(len(p_WN))[:, np.newaxis], 2)  # round caps are spheres
    ends, depth = _seen(p_WN[np.vstack([structure.struts, pieces.ends, points])], camera)
    colours = [COLOURS["rear"]] * len(struts), cables, [COLOURS["node"]] * len(nodes)
    radii = np.concatenate([struts, np.full(len(cables), 0.5 * THICKEST * struts.min()), nodes])
    order = np.argsort(-depth.mean(axis=1))
    colour, width = np.concatenate(colours)[order], _widths(radii, depth)[order]
    drawn.append(LineCollection(list(ends[order]), colors=colour, linewidths=width))

    size = ASPECT * _HEIGHT / _DPI, _HEIGHT / _DPI
    canvas = FigureCanvasAgg(Figure(size, dpi=_DPI, facecolor=COLOURS["sky"]))
    axes = canvas.figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(-ASPECT * VIEW_SLOPE, ASPECT * VIEW_SLOPE), ylim=(-VIEW_SLOPE, VIEW_SLOPE))
    axes.axis("off")
    for collection in drawn:  # matplotlib keeps the order of equals
        collection.set(capstyle="round")
        axes.add_collection(collection, autolim=False)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def _seen(points: np.ndarray, camera: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Projections (..., 2) of points (..., 3), to the right and up, onto the plane at the distance
    1 before the camera; and distances (...) of the points from the camera along the view. Points
    and `camera` (3,) are positions in the world frame, in m."""
    right, up, forward = view_axes()
    offset = points - camera
    depth = offset @ forward
    return np.stack([offset @ right, offset @ up], axis=-1) / depth[..., np.newaxis], depth


def _widths(radii: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """Widths (lines,) on the picture, in points of 1/72 in, of cylinders with these radii (m).
    `depth` (lines, 2) has the distances (m) of their ends from the camera along the view."""
    return np.asarray(72.0 * _HEIGHT / _DPI * radii / VIEW_SLOPE / depth.mean(axis=1))
