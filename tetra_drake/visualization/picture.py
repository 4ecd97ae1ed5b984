"""Pictures of a robot as arrays of pixels, drawn by Matplotlib, without a browser."""

from __future__ import annotations

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from tetra_drake.physics.cable import PASSIVE
from tetra_drake.robot.ground import ground_heights
from tetra_drake.robot.robot import Robot
from tetra_drake.visualization.scene import (
    ASPECT,
    COLOURS,
    FIELD_OF_VIEW,
    MARGIN,
    THICKEST,
    camera_position,
    drawn_radii,
    view_axes,
)

_HEIGHT, _DPI = 400, 100
"""Height of a picture in pixels, and pixels per inch. The width is ASPECT times the height."""
_SQUARES = np.arange(-30, 31)
"""Lines of the floor on each axis, in squares from the robot."""


class Camera:
    """Camera that follows a robot, and looks from the same side as in a replay."""

    def __init__(self, robot: Robot) -> None:
        structure, self._robot = robot.structure, robot
        around = structure.p_WN - structure.p_WN.mean(axis=0)
        self._reach = float(np.linalg.norm(around, axis=1).max())
        self._offset = camera_position(1.2 * around, np.zeros(3))
        side, wanted = robot.scenario.units.square, MARGIN * self._reach / _SQUARES[-1]
        self._side = side * np.ceil(wanted / side)  # of a square of the floor
        struts, nodes = drawn_radii(structure)
        is_driven = structure.cables["signal"] != PASSIVE
        cables = np.where(is_driven, COLOURS["actuated"], COLOURS["passive"])
        self._lines = np.vstack([structure.struts, structure.cable_ends])
        self._radii = np.append(struts, np.full(len(cables), 0.5 * THICKEST * struts.min()))
        self._radii, self._struts = np.append(self._radii, nodes), len(struts)
        colours = [COLOURS["rear"]] * len(struts), cables, [COLOURS["node"]] * len(nodes)
        self._colours = np.concatenate(colours)
        high = float(np.tan(np.deg2rad(FIELD_OF_VIEW) / 2))
        self._points = 72.0 * _HEIGHT / _DPI / (2.0 * high)  # per unit of width / distance
        size = ASPECT * _HEIGHT / _DPI, _HEIGHT / _DPI
        self._canvas = FigureCanvasAgg(Figure(size, dpi=_DPI, facecolor=COLOURS["sky"]))
        axes = self._canvas.figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set(xlim=(-ASPECT * high, ASPECT * high), ylim=(-high, high))
        axes.axis("off")
        drawn = [LineCollection([], zorder=order, capstyle="round") for order in range(3)]
        for lines in drawn:
            axes.add_collection(lines, autolim=False)
        self._floor, self._shadows, self._body = drawn
        self._floor.set(color=COLOURS["dark_line"], linewidth=0.5)
        self._shadows.set(color=COLOURS["square"])

    def picture(self, p_WN: np.ndarray) -> np.ndarray:
        """Picture (height, width, 3) of the robot with its nodes at p_WN (nodes, 3) in m."""
        camera = p_WN.mean(axis=0) + self._offset
        if self._robot.scenario.terrain.is_ground:
            self._draw_floor(p_WN, camera)
        nodes = np.tile(np.arange(len(p_WN))[:, np.newaxis], 2)
        ends, depth = _seen(p_WN[np.vstack([self._lines, nodes])], camera)
        depth = depth.mean(axis=1)
        order = np.argsort(-depth)
        self._body.set(
            segments=ends[order],
            color=self._colours[order],
            linewidth=(2.0 * self._points * self._radii / depth)[order],
        )
        self._canvas.draw()
        return np.asarray(self._canvas.buffer_rgba())[..., :3].copy()

    def _draw_floor(self, p_WN: np.ndarray, camera: np.ndarray) -> None:
        """Draws the lines of the floor around the robot, and the shadows of its struts."""
        ground = self._robot.ground
        x, y = self._side * (_SQUARES + np.round(p_WN.mean(axis=0)[:2, np.newaxis] / self._side))
        floor = np.stack([*np.meshgrid(x, y), np.zeros((x.size, y.size))], axis=-1)
        floor[..., 2] = ground_heights(floor[..., :2], ground)
        seen, depth = _seen(floor, camera)
        seen[depth < 0.1 * self._reach] = np.nan  # behind the camera
        self._floor.set_segments([*seen, *seen.swapaxes(0, 1)])
        below = p_WN[self._lines[: self._struts]]
        below[..., 2] = ground_heights(below[..., :2], ground)
        seen, depth = _seen(below, camera)
        widths = 2.0 * self._points * self._radii[: self._struts] / depth.mean(axis=1)
        self._shadows.set(segments=seen, linewidth=widths)


def _seen(points: np.ndarray, camera: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places (..., 2) of points (..., 3) in a picture, and their distances (...) along the view."""
    right, up, forward = view_axes()
    offset = points - camera
    depth = offset @ forward
    return np.stack([offset @ right, offset @ up], axis=-1) / depth[..., np.newaxis], depth
