"""The replay page: one HTML file that plays a trajectory in any browser, without a server."""

from __future__ import annotations

import base64
import gzip
import html
import logging
import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.geometry import Meshcat, MeshcatAnimation, MeshcatParams
from pydrake.math import RigidTransform

from tetra_drake.files import write_whole
from tetra_drake.formatting import fixed, render
from tetra_drake.robot.ground import make_ground
from tetra_drake.robot.structure import BOTTOM_LEFT, BOTTOM_RIGHT, MakeStructure
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.units import INCH
from tetra_drake.visualization.scene import (
    ASPECT,
    CABLE_KINDS,
    COLOURS,
    Motion,
    add_robot,
    cable_kind,
    motions,
    rgba,
    set_surroundings,
)

if TYPE_CHECKING:
    import xarray

FRAMES_PER_SECOND = 25.0
"""Key frames per second of motion, at most; 15 s of motion give a page of 2.5 MB."""

TRACE_FRAMES = 5
"""Key frames per piece of the traces, each of which becomes visible when it ends."""

TICKS_PER_SECOND = 100_000
"""Resolution of the time of key frames: Meshcat counts in integers."""

REPETITIONS = 1_000_000
"""How often the page plays the motion before it stops."""

LEGEND = {
    "actuated": "actuated cable",
    "outer": "passive outer cable",
    "inner": "passive inner cable",
    "normal": "normal force",
    "friction": "friction force",
    "trace": "path of the bottom nodes",
    "forward": "arrow on the floor: forward (+x)",
}


def save_replay(
    path: str | Path, *, scenario: Scenario, trajectory: xarray.Dataset, title: str
) -> None:
    """Writes the page that replays a trajectory.

    Every key frame is a sample of the trajectory; browsers interpolate between key frames.

    Raises InputError if `path` cannot be written.
    """
    meshcat = quiet_meshcat(MeshcatParams(host="localhost", port=0))
    structure = MakeStructure(scenario)
    add_robot(meshcat, structure)
    show_replay(meshcat, scenario=scenario, trajectory=trajectory)
    absent = set(CABLE_KINDS) - {cable_kind(cable) for cable in structure.cables}
    legend = {name: meaning for name, meaning in LEGEND.items() if name not in absent}
    page = _with_overlay(meshcat.StaticHtml(), title, legend)
    write_whole(path, pack_page(page, title=title))


def replay_title(gait: str, trajectory: xarray.Dataset) -> str:
    """Name of a gait, and the distance and duration of its trajectory."""
    x1 = trajectory["p_WN"].values[[0, -1], 0, BOTTOM_LEFT, 0]
    times = trajectory["time"].values
    return f"{gait}: {fixed((x1[1] - x1[0]) / INCH)} inches in {times[-1] - times[0]:g} s"


def show_replay(meshcat: Meshcat, *, scenario: Scenario, trajectory: xarray.Dataset) -> None:
    """Lets a Meshcat that shows the scenario's robot (scene.add_robot) play a trajectory."""
    structure = MakeStructure(scenario)
    ground = make_ground(scenario, structure)
    set_surroundings(meshcat, structure, ground, trajectory["p_WN"].values)
    frames = trajectory.isel(time=frame_samples(trajectory["time"].values))
    film = _Film(meshcat, frames["time"].values)
    film.add_traces(frames["p_WN"].values[:, :, [BOTTOM_LEFT, BOTTOM_RIGHT]])
    for motion in motions(structure, ground, frames):
        film.add(motion)
    film.publish()


def frame_samples(times: np.ndarray, rate: float = FRAMES_PER_SECOND) -> np.ndarray:
    """Indices of the samples to show, at most `rate` per second, the first and the last included.

    `times` (samples,) in s, evenly spaced.
    """
    frames = min(int((times[-1] - times[0]) * rate + 1e-9) + 1, len(times))
    chosen = np.linspace(0, len(times) - 1, max(frames, min(len(times), 2)))
    return chosen.round().astype(int)


def quiet_meshcat(params: MeshcatParams) -> Meshcat:
    """A Meshcat that does not announce its server in Drake's log."""
    logger = logging.getLogger("drake")
    level = logger.level
    logger.setLevel(logging.WARNING)
    try:
        return Meshcat(params)
    finally:
        logger.setLevel(level)


class _Film:
    """Key frames of an animation, one for each of `times` (s)."""

    def __init__(self, meshcat: Meshcat, times: np.ndarray) -> None:
        self._meshcat = meshcat
        self._animation = MeshcatAnimation(frames_per_second=TICKS_PER_SECOND)
        self._animation.set_loop_mode(MeshcatAnimation.LoopMode.kLoopRepeat)
        self._animation.set_repetitions(REPETITIONS)
        self._ticks = np.rint((times - times[0]) * TICKS_PER_SECOND).astype(int).tolist()

    def add_traces(self, paths: np.ndarray) -> None:
        """Paths (frames, ..., 3) in m of nodes, in pieces that are shown once walked."""
        steps = np.stack([paths[:-1], paths[1:]]).reshape(2, len(paths) - 1, -1, 3)
        for first in range(0, len(paths) - 1, TRACE_FRAMES):
            last = min(first + TRACE_FRAMES, len(paths) - 1)
            start, end = steps[:, first:last].reshape(2, -1, 3).swapaxes(1, 2)
            path = f"/traces/{self._ticks[last] / TICKS_PER_SECOND:g} s"
            self._meshcat.SetLineSegments(path, start, end, rgba=rgba("trace"))
            self._animation.SetProperty(0, path, "visible", False)
            for tick in {self._ticks[last], self._ticks[-1]}:  # a motion that ends earlier repeats
                self._animation.SetProperty(tick, path, "visible", True)

    def add(self, motion: Motion) -> None:
        """Key frames of one object's motion; without animation it stands in the first."""
        self._meshcat.SetTransform(motion.path, motion.matrix(0))
        if motion.quaternions is None:
            self._vectors(motion.path, "position", motion.positions)
        else:
            self._poses(motion.path, motion.quaternions, motion.positions)
        if motion.scales is not None:
            self._vectors(motion.path, "scale", motion.scales)

    def publish(self) -> None:
        """Hands the key frames to Meshcat; nothing can be added afterwards."""
        self._meshcat.SetAnimation(self._animation)

    def _poses(self, path: str, quaternions: np.ndarray, positions: np.ndarray) -> None:
        for tick, q, p in zip(self._ticks, quaternions, positions, strict=True):
            self._animation.SetTransform(tick, path, RigidTransform(Quaternion(q), p))

    def _vectors(self, path: str, name: str, values: np.ndarray) -> None:
        for tick, row in zip(self._ticks, values.tolist(), strict=True):
            self._animation.SetProperty(tick, path, name, row)


def pack_page(page: str, *, title: str) -> str:
    """A page that holds `page` compressed and unpacks it in the browser; `title` is plain text."""
    packed = base64.b64encode(gzip.compress(page.encode("utf-8"), mtime=0)).decode("ascii")
    return render("visualization/packed_page.html.jinja", title=title, packed=packed)


def _with_overlay(page: str, title: str, legend: Mapping[str, str]) -> str:
    """Meshcat's page with a title, and over the scene a heading, a legend and a clock."""
    lines = [(COLOURS[name], meaning) for name, meaning in legend.items()]
    overlay = render("visualization/overlay.html.jinja", title=title, legend=lines, aspect=ASPECT)
    # Functions, as backslashes in a replacement text would mean something.
    named = f"<title>{html.escape(title)}</title>"
    page = re.sub(r"<title>.*?</title>", lambda _: named, page, count=1)
    return re.sub(r"<body[^>]*>", lambda tag: tag[0] + overlay, page, count=1)
