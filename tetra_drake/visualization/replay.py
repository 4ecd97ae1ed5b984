"""The replay page: one HTML file that plays a trajectory in any browser, without a server."""

from __future__ import annotations

import base64
import gzip
import html
import logging
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

import numpy as np
from pydrake.geometry import Meshcat, MeshcatParams

from tetra_drake.errors import InputError
from tetra_drake.files import write_whole
from tetra_drake.formatting import render
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import Structure, followed_nodes
from tetra_drake.visualization.scene import (
    ASPECT,
    COLOURS,
    Track,
    add_robot,
    cable_colours,
    rgba,
    set_surroundings,
    tracks,
)

if TYPE_CHECKING:
    import xarray

FRAMES_PER_SECOND = 25.0
"""Key frames per second of motion, at most."""

RESOLUTION = 2.0**-16
"""Step to which pages round positions and sizes (m) and quaternions; 15 s of the thesis's robot
then take 0.2 MB, and Meshcat's script 1 MB."""

_TRACE_FRAMES = 5  # key frames per piece of the traces, which becomes visible when it ends
_TICKS_PER_SECOND = 100_000  # resolution of time: Meshcat counts in integers
_REPETITIONS = 1_000_000  # number of times that the motion is played before it stops


def save_replay(
    path: str | Path,
    *,
    robot: Robot,
    trajectory: xarray.Dataset,
    title: str,
    viewer: str | Path | None = None,
) -> None:
    """Writes the page that replays a robot's trajectory.

    Every key frame is a sample of the trajectory; browsers interpolate between key frames. With
    `viewer`, the page reads Meshcat's script, which is most of it, from that file, so that pages
    can share it; it is written if it does not exist.

    Raises InputError if `path` or `viewer` cannot be written, or `viewer` holds anything else.
    """
    meshcat = quiet_meshcat(MeshcatParams(host="localhost", port=0))
    film = _add_film(meshcat, robot, trajectory)
    legend = legend_of(robot.structure)
    page = meshcat.StaticHtml()
    if viewer is not None:
        address = quote(Path(os.path.relpath(viewer, Path(path).parent)).as_posix())
        page, script = _without_viewer(page, address=address)
        _write_once(Path(viewer), script)
    write_whole(path, pack_page(_with_overlay(page, title, legend, film), title=title))


def legend_of(structure: Structure) -> list[tuple[str, str]]:
    """Names in COLOURS, and what has these colours."""
    cables = [(colour, f"{kind} cable") for kind, colour in cable_colours(structure).items()]
    return [
        *cables,
        ("normal", "normal force"),
        ("friction", "friction force"),
        ("trace", f"path of the {structure.followed}"),
        ("forward", "arrow on the floor: forward (+x)"),
    ]


def _add_film(meshcat: Meshcat, robot: Robot, trajectory: xarray.Dataset) -> dict[str, Any]:
    """Adds robot, surroundings and traces in the first frame; returns the film.

    It is what overlay.html.jinja plays, small when compressed: motions are steps from frame to
    frame, the first one from 0, in RESOLUTION, in a row for each component.
    """
    add_robot(meshcat, robot.structure)
    set_surroundings(meshcat, robot, trajectory["p_WN"].values)
    frames = trajectory.isel(time=frame_samples(trajectory["time"].values))
    times = frames["time"].values
    ticks = np.rint((times - times[0]) * _TICKS_PER_SECOND).astype(int).tolist()
    moving = list(tracks(robot, frames))
    for track in moving:
        meshcat.SetTransform(track.path, track.matrix(0))
    followed = _rounded(followed_nodes(frames["p_WN"].values, robot.structure)) * RESOLUTION
    return {
        "per_second": _TICKS_PER_SECOND,
        "resolution": RESOLUTION,
        "repetitions": _REPETITIONS,
        "ticks": ticks,
        "motions": {track.path: _steps(track) for track in moving},
        "traces": _add_traces(meshcat, followed, ticks),
    }


def _add_traces(meshcat: Meshcat, paths: np.ndarray, ticks: list[int]) -> dict[str, int]:
    """Adds paths (frames, paths, 3) in m in pieces; returns the tick at which a piece is walked."""
    steps = np.stack([paths[:-1], paths[1:]]).reshape(2, len(paths) - 1, -1, 3)
    traces = {}
    for first in range(0, len(paths) - 1, _TRACE_FRAMES):
        last = min(first + _TRACE_FRAMES, len(paths) - 1)
        start, end = steps[:, first:last].reshape(2, -1, 3).swapaxes(1, 2)
        path = f"/traces/{ticks[last] / _TICKS_PER_SECOND:g} s"
        meshcat.SetLineSegments(path, start, end, rgba=rgba("trace"))
        traces[path] = ticks[last]
    return traces


def _rounded(values: np.ndarray) -> np.ndarray:
    """Whole multiples of RESOLUTION."""
    return np.rint(values / RESOLUTION).astype(int)


def _steps(track: Track) -> dict[str, list[list[int]]]:
    """Steps in RESOLUTION of the object's properties, a row for each component."""
    values = {"position": track.positions, "scale": track.scales}
    if track.quaternions is not None:
        values["quaternion"] = np.roll(track.quaternions, -1, axis=1)  # x y z w
    return {
        name: np.diff(_rounded(rows.T), prepend=0).tolist()
        for name, rows in values.items()
        if rows is not None
    }


def frame_samples(times: np.ndarray) -> np.ndarray:
    """Indices of the samples to show, the first and the last included.

    `times` (samples,) in s, evenly spaced.
    """
    frames = min(int((times[-1] - times[0]) * FRAMES_PER_SECOND + 1e-9) + 1, len(times))
    samples = np.linspace(0, len(times) - 1, max(frames, min(len(times), 2)))
    return samples.round().astype(int)


def quiet_meshcat(params: MeshcatParams) -> Meshcat:
    """A Meshcat that does not announce its server in Drake's log."""
    logger = logging.getLogger("drake")
    level = logger.level
    logger.setLevel(logging.WARNING)
    try:
        return Meshcat(params)
    finally:
        logger.setLevel(level)


def pack_page(page: str, *, title: str) -> str:
    """A page that holds `page` compressed and unpacks it in the browser; `title` is plain text."""
    packed = base64.b64encode(gzip.compress(page.encode("utf-8"), mtime=0)).decode("ascii")
    return render("visualization/packed_page.html.jinja", title=title, packed=packed)


def _with_overlay(
    page: str, title: str, legend: Sequence[tuple[str, str]], film: Mapping[str, Any]
) -> str:
    """Meshcat's page that plays a film, with a title, and over the scene a heading, a legend and a
    clock."""
    overlay = render(
        "visualization/overlay.html.jinja",
        title=title,
        legend=[(COLOURS[name], meaning) for name, meaning in legend],
        aspect=ASPECT,
        film=film,
    )
    # Functions, as backslashes in a replacement text would mean something.
    named = f"<title>{html.escape(title)}</title>"
    page = re.sub(r"<title>.*?</title>", lambda _: named, page, count=1)
    return re.sub(r"<body[^>]*>", lambda tag: tag[0] + overlay, page, count=1)


def _without_viewer(page: str, *, address: str) -> tuple[str, str]:
    """Meshcat's page with its script read from an address, and that script."""
    before, script, after = re.split(r"<script[^>]*>(.+?)</script>", page, maxsplit=1, flags=re.S)
    reader = render("visualization/viewer.html.jinja", address=address)
    # Before the body, of which nothing is to be seen if the viewer is missing.
    return (before + after).replace("</head>", f"{reader}</head>", 1), script


def _write_once(path: Path, text: str) -> None:
    """Writes a file unless it holds the text already; raises InputError if it holds another."""
    if not path.exists():
        write_whole(path, text)
    elif not path.is_file() or path.read_bytes() != text.encode("utf-8"):
        problem = "is not the viewer of this version of Drake, expected that or no file yet"
        raise InputError(path, "", problem)
