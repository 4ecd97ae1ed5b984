"""Replay page: one HTML file that plays a trajectory in any browser, without a server."""

from __future__ import annotations

import base64
import gzip
import html
import logging
import math
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

import numpy as np
import pandas
from pydrake.geometry import Meshcat, MeshcatParams

from tetra_drake.errors import InputError
from tetra_drake.files import write_whole
from tetra_drake.formatting import render, rounded
from tetra_drake.robot.ground import ground_axes
from tetra_drake.robot.measures import distance_walked, path_of_centre
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import followed_nodes
from tetra_drake.scenario.metrics import looks_for_turns
from tetra_drake.visualization.scene import (
    COLOURS,
    add_robot,
    cable_paths,
    cable_radii,
    drawn_radii,
    least_drawn_radius,
    node_colours,
    node_paths,
    radius_per_newton,
    set_surroundings,
)

if TYPE_CHECKING:
    import xarray

FRAMES_PER_SECOND = 25.0
"""Largest number of frames per second of motion."""

RESOLUTION = 2.0**-16
"""Rounding step of positions and sizes (m) and quaternions. With it, 15 s of the thesis's robot
take 0.1 MB; Meshcat's script takes 0.9 MB."""

MOST_NAMES = 12
"""Largest number of bodies for which names are shown. Names made of two nodes are never shown."""

LONG_ARROW = 0.8
"""Length of the arrow of a large force (percentile _USUAL), as a share of the robot's height."""

_COMMAND = re.compile(r'fetch\(("data:application/octet-binary;base64,[^"]*")\)(\s*\.then\(.*\))+;')
"""Pattern of the asynchronous commands in Meshcat's page that add parts of the scene. The film runs
them at once, because it needs the whole scene."""
_SCRIPT = re.compile("<script[^>]*>(.+?)</script>", re.DOTALL)
_IN_HEAD = (
    '<meta name="viewport" content="width=device-width, initial-scale=1">'
    '<link rel="icon" href="data:,">'
)
"""Elements for the head of the page. Without them, phones show a page small, and browsers ask the
host for an icon."""
_USUAL = 99.0
"""Percentile of tensions and forces that is drawn at full size. Impacts are far larger."""


@dataclass(frozen=True)
class Replay:
    """Page that replays a trajectory. Every frame is a sample of the trajectory; the page
    interpolates between frames."""

    robot: Robot
    """The robot that moved."""
    trajectory: xarray.Dataset
    """Its motion and forces over time; see results.trajectory."""
    title: str
    """Name of the gait, a colon, and a short result, such as "walks 14 in". If the result begins
    with "rolls", the page says "rolled", otherwise "walked"."""
    progress: Mapping[str, Any] | None = None
    """What the page writes at each frame in place of the distance, see _progress(). Then no path is
    drawn."""
    text: str = ""
    """Text with numbers, which the page shows on demand."""

    def save(self, path: str | Path, *, viewer: str | Path | None = None) -> None:
        """Writes the page to the HTML file `path`.

        `viewer` is a file for Meshcat's script. Pages can share it, which makes them much smaller.
        It is written if it does not exist. By default the script is in the page. Raises InputError
        if a file cannot be written, or `viewer` has another content.
        """
        address = ""
        if viewer is not None:
            address = quote(Path(os.path.relpath(viewer, Path(path).parent)).as_posix())
        page, script = self.page(address)
        if viewer is not None:
            file = Path(viewer)
            if not file.exists():
                write_whole(file, script)
            elif not file.is_file() or file.read_bytes() != script.encode("utf-8"):
                problem = "is no viewer of this version of Drake; delete it or name another file"
                raise InputError(file, "", problem)
        write_whole(path, page)

    def page(self, address: str = "") -> tuple[str, str]:
        """The page as HTML, and the script for the file at `address`; "" if there is no address.

        `address` is the URL from which the page reads Meshcat's script (JavaScript), relative to
        the page. By default the script is in the page itself.
        """
        meshcat = quiet_meshcat(MeshcatParams(host="localhost", port=0))
        frames = self.trajectory.isel(time=frame_samples(self.trajectory["time"].values))
        p_WN = self.trajectory["p_WN"].values
        add_robot(meshcat, self.robot.structure)
        set_surroundings(meshcat, self.robot, p_WN, seen=p_WN[0])
        page, script = meshcat.StaticHtml(), ""
        if address:
            before, script, after = _SCRIPT.split(page, maxsplit=1)
            reader = render("visualization/viewer.html.jinja", address=address)
            # Before the body, so that nothing of the body is shown if the file is missing.
            page = (before + after).replace("</head>", f"{reader}</head>", 1)
        name, _, deed = self.title.rpartition(": ")
        film = film_of(self.robot, frames, rolls=deed.startswith("rolls"))
        if self.progress is not None:
            film |= {"progress": self.progress, "traces": []}
        overlay = render(
            "visualization/overlay.html.jinja",
            name=name,
            deed=deed,
            text=self.text,
            film=film,
            script=render("visualization/film.js"),
        )
        page = _COMMAND.sub(r"handle(\1);", page)
        # The replacements are functions, because backslashes in a text would be interpreted.
        named = f"<title>{html.escape(self.title)}</title>{_IN_HEAD}"
        page = page.replace("<html>", '<html lang="en">', 1)
        page = re.sub(r"<title>.*?</title>", lambda _: named, page, count=1)
        page = re.sub(r"<body[^>]*>", lambda tag: f"{tag[0]}<main>{overlay}", page, count=1)
        page = "</main></body>".join(page.rsplit("</body>", 1))
        return pack_page(page, title=self.title), script


def film_of(robot: Robot, frames: xarray.Dataset, *, rolls: bool) -> dict[str, Any]:
    """Data for the page's script film.js: the objects of the scene and their motion.

    `frames` are the samples of a trajectory to show. Each number that moves, such as an x
    coordinate, has a row of its differences from frame to frame in whole units of RESOLUTION. The
    first difference is from 0. Such rows compress well.
    """
    structure = robot.structure
    bodies, contacts = structure.bodies, structure.contacts
    nodes = {
        "path": [path.split("/")[1:] for path in node_paths(structure)],
        "body": structure.carriers.tolist(),
        "place": structure.p_BN.round(6).tolist(),
        "colour": [COLOURS[name] for name in node_colours(structure)],
        "radius": [round(radius, 6) for radius in drawn_radii(structure)[1].tolist()],
    }
    tension, force = frames["tension"].values, ground_forces(robot, frames)
    greatest = np.percentile(tension, _USUAL) if tension.size else 0.0
    per_newton = radius_per_newton(structure, greatest)
    sizes = np.linalg.norm(force, axis=-1)
    usual_force = float(np.percentile(sizes, _USUAL)) if sizes.size else 0.0
    units = robot.scenario.units
    arrow = LONG_ARROW * float(np.ptp(frames["p_WN"].values[0, :, 2])) / units.square
    # The next 1, 2 or 5 times a power of ten, in the unit of force.
    shown = max(usual_force / max(arrow, 1.0) / units.force, 1e-6)
    power = 10.0 ** math.floor(math.log10(shown))
    nice = next(n for n in (1.0, 2.0, 5.0, 10.0) if n * power >= shown)
    force_of_square = nice * power * units.force
    poses = np.concatenate([frames["p_WB"].values, frames["q_WB"].values], axis=-1)
    cables = {
        "path": [path.split("/")[1:] for path in cable_paths(structure)],
        "nodes": structure.segments.ends.tolist(),
    }
    return {
        "times": frames["time"].values.round(5).tolist(),
        "resolution": RESOLUTION,
        "rests": bool((poses == poses[0]).all()),
        "bodies": bodies,
        "named": len(bodies) <= MOST_NAMES and not any(" " in name for name in bodies),
        "nodes": pandas.DataFrame(nodes).to_dict("records"),
        "cables": pandas.DataFrame(cables).to_dict("records"),
        "contacts": contacts.tolist(),
        "colours": COLOURS,
        "anchored": bool(structure.held.any()),
        "strut": least_drawn_radius(structure),
        "length": {"size": units.length, "name": units.length_name},
        "dark": units.squares * units.square,
        "poses": _steps(poses),
        "radii": _steps(cable_radii(robot, frames, per_newton)),
        "touches": _steps(frames["in_contact"].values * RESOLUTION),
        "arrows": _steps(force * units.square / force_of_square),
        "traces": _steps(followed_nodes(frames["p_WN"].values, structure)[:, :2]),
        "progress": _progress(robot, frames, rolls=rolls),
        "legend": {
            "tension": f"{rounded(greatest / units.force, 2)} {units.force_name}",
            "force": f"{rounded(force_of_square / units.force, 2)} {units.force_name}",
            "square": units.shown(units.square, "m"),
            "dark": units.shown(units.squares * units.square, "m"),
            "trace": "rear feet" if structure.markers.size else "centre",
        },
    }


def ground_forces(robot: Robot, frames: xarray.Dataset) -> np.ndarray:
    """Forces (frames, contacts, 3) of the ground on the contact nodes, in the world frame, in N.
    `frames` are samples of a trajectory."""
    friction, normal = frames["friction_force"].values, frames["normal_force"].values
    forces = np.concatenate([friction, normal[..., np.newaxis]], axis=-1)
    if robot.ground.flat:
        return forces
    p_WN = frames["p_WN"].values[:, robot.structure.contacts]
    axes = ground_axes(p_WN.reshape(-1, 3), robot.ground).reshape(*p_WN.shape, 3)
    turned: np.ndarray = np.einsum("fci,fcij->fcj", forces, axes)
    return turned


def _progress(robot: Robot, frames: xarray.Dataset, *, rolls: bool) -> dict[str, Any]:
    """What the page writes at each frame: the distance walked in the scenario's unit of length, or
    the change of heading in degrees if the objective is about turning. Keys: `what` (a verb),
    `unit`, `digits` (decimals) and `values` (frames,)."""
    structure, objective = robot.structure, robot.scenario.objective
    if structure.points_ahead and looks_for_turns(objective):
        heading = np.rad2deg(path_of_centre(frames, structure).heading)
        values, what, unit, digits = heading - heading[0], "turned", "°", 0
    else:
        units = robot.scenario.units
        values = distance_walked(frames, structure) / units.length
        what = "rolled" if rolls else "walked"
        unit, digits = f" {units.length_name}", units.decimals
    return {"what": what, "unit": unit, "digits": digits, "values": values.round(digits).tolist()}


def _steps(values: np.ndarray) -> list[list[int]]:
    """Differences from frame to frame of values (frames, ...), in whole units of RESOLUTION. There
    is a row (frames,) for each number of a frame, flattened; its first difference is from 0."""
    rows = np.rint(values.reshape(len(values), -1).T / RESOLUTION).astype(int)
    steps: list[list[int]] = np.diff(rows, prepend=0).tolist()
    return steps


def frame_samples(times: np.ndarray) -> np.ndarray:
    """Indices of the samples of a trajectory to show, including the first and the last: at most
    FRAMES_PER_SECOND per second.

    `times` (samples,) are in s and evenly spaced.
    """
    frames = min(int((times[-1] - times[0]) * FRAMES_PER_SECOND + 1e-9) + 1, len(times))
    samples = np.linspace(0, len(times) - 1, max(frames, min(len(times), 2)))
    return samples.round().astype(int)


def quiet_meshcat(params: MeshcatParams) -> Meshcat:
    """A Meshcat that does not log the address of its server."""
    logger = logging.getLogger("drake")
    level = logger.level
    logger.setLevel(logging.WARNING)
    try:
        return Meshcat(params)
    finally:
        logger.setLevel(level)


def pack_page(page: str, *, title: str) -> str:
    """Compresses a page (HTML) into a page that unpacks itself in the browser. `title` is plain
    text."""
    packed = base64.b64encode(gzip.compress(page.encode("utf-8"), mtime=0)).decode("ascii")
    return render("visualization/packed_page.html.jinja", title=title, packed=packed)
