"""A recorded trajectory as one HTML page that plays it in any browser, with no server."""

from __future__ import annotations

import html
import logging
import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.geometry import Meshcat, MeshcatAnimation, MeshcatParams
from pydrake.math import RigidTransform

from tetra_drake.files import write_whole
from tetra_drake.robot.structure import BOTTOM_LEFT, BOTTOM_RIGHT, NODES, MakeStructure, Structure
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.units import INCH
from tetra_drake.visualization.packed_page import pack_page
from tetra_drake.visualization.scene import (
    ASPECT,
    COLOURS,
    Motion,
    add_robot,
    motions,
    rgba,
    set_surroundings,
)

if TYPE_CHECKING:
    import xarray

FRAMES_PER_SECOND = 25.0
"""Key frames per second of motion, at most; 15 s then make a page of 2.5 MB."""

TICKS_PER_SECOND = 100_000
"""Resolution of a key frame's time: Meshcat counts in integers."""

REPETITIONS = 1_000_000
"""How often the page plays the motion before it stops: as good as for ever."""

LEGEND = {
    "actuated": "actuated cable",
    "outer": "passive outer cable",
    "inner": "passive inner cable",
    "normal": "normal force",
    "friction": "friction force",
    "trace": "path of the bottom nodes",
}


def save_replay(
    path: str | Path, *, scenario: Scenario, trajectory: xarray.Dataset, title: str
) -> None:
    """Writes the page that replays a trajectory (see trajectory.make_dataset).

    Every key frame is a sample of the trajectory, at that sample's time; nothing is
    simulated again. Browsers show at their own rate what lies between two key frames.

    Raises InputError if `path` cannot be written.
    """
    meshcat = quiet_meshcat(MeshcatParams(host="localhost", port=0))
    add_robot(meshcat, MakeStructure(scenario.robot, scenario.cables))
    show_replay(meshcat, scenario=scenario, trajectory=trajectory)
    write_whole(path, pack_page(_with_title(meshcat.StaticHtml(), title), title=title))


def replay_title(gait: str, trajectory: xarray.Dataset) -> str:
    """A gait's name, and how far the trajectory goes in which time."""
    x1 = trajectory["p_WN"].values[:, 0, BOTTOM_LEFT, 0]
    times = trajectory["time"].values
    return f"{gait}: {(x1[-1] - x1[0]) / INCH:.2f} inches in {times[-1] - times[0]:g} s"


def show_replay(meshcat: Meshcat, *, scenario: Scenario, trajectory: xarray.Dataset) -> None:
    """Lets a Meshcat that shows the scenario's robot (scene.add_robot) play a trajectory."""
    structure = MakeStructure(scenario.robot, scenario.cables)
    p_WN = trajectory["p_WN"].values
    _add_traces(meshcat, structure, p_WN)
    set_surroundings(meshcat, structure, p_WN)
    frames = trajectory.isel(time=frame_samples(trajectory["time"].values))
    film = _Film(meshcat, frames["time"].values)
    for motion in motions(structure, frames):
        film.add(motion)
    film.publish()


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
    """Key frames of motions, one for each of `times` (s), for Meshcat to play."""

    def __init__(self, meshcat: Meshcat, times: np.ndarray) -> None:
        self._meshcat = meshcat
        self._animation = MeshcatAnimation(frames_per_second=TICKS_PER_SECOND)
        self._animation.set_loop_mode(MeshcatAnimation.LoopMode.kLoopRepeat)
        self._animation.set_repetitions(REPETITIONS)
        self._ticks = np.rint((times - times[0]) * TICKS_PER_SECOND).astype(int).tolist()

    def add(self, motion: Motion) -> None:
        """Key frames of one object's motion, which stands at the first of them meanwhile."""
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


def _add_traces(meshcat: Meshcat, structure: Structure, p_WN: np.ndarray) -> None:
    """The whole paths of all bottom nodes; p_WN (samples, bodies, 4, 3) in m."""
    for i, body in enumerate(structure.bodies):
        for node in (BOTTOM_LEFT, BOTTOM_RIGHT):
            path = f"/traces/{body} {NODES[node]}"
            meshcat.SetLine(path, p_WN[:, i, node].T, rgba=rgba("trace"))


_HEADING = """
<style>
  #heading {{ position: fixed; left: 16px; top: 12px; right: 270px; pointer-events: none;
    font: 13px sans-serif; color: #222 }}
  #heading h1 {{ margin: 0; font-size: 20px; font-weight: 600 }}
  #heading p {{ margin: 6px 0; font-variant-numeric: tabular-nums }}
  #heading ul {{ margin: 0; padding: 0; list-style: none }}
  #heading li span {{ display: inline-block; width: 22px; height: 4px; margin: 3px 8px 3px 0 }}
  @media (max-width: 700px) {{ #heading {{ top: 28px; right: 16px }} }}  /* below the controls */
</style>
<div id="heading">
  <h1>{title}</h1>
  <p>Grid: 1 in, darker lines every 6 in. The harder a cable pulls, the thicker it is; an arrow of
    6 in is 0.2 lbf. Open Controls to pause, for time and speed (Animations), and to hide forces,
    cables or traces (Scene).</p>
  <ul>{legend}</ul>
  <p>t = <output id="clock"></output> s</p>
</div>
"""

_LEGEND_ITEM = """
    <li><span style="background: {colour}"></span>{meaning}</li>"""

_SCRIPT = """
<script>
  // The camera is placed for windows of some width to height; narrower ones must not cut the sides.
  function fit() {{
    viewer.camera.zoom = Math.min(1, window.innerWidth / window.innerHeight / {aspect});
    viewer.set_dirty();
  }}
  window.addEventListener("resize", fit);
  fit();
  function show_time() {{
    document.getElementById("clock").value = viewer.animator.time.toFixed(2);
    requestAnimationFrame(show_time);
  }}
  show_time();
</script>
"""


def _with_title(page: str, title: str) -> str:
    """Meshcat's page with a title, and over the scene a heading, a legend and a clock."""
    escaped = html.escape(title)
    legend = "".join(
        _LEGEND_ITEM.format(colour=COLOURS[name], meaning=meaning)
        for name, meaning in LEGEND.items()
    )
    heading = _HEADING.format(title=escaped, legend=legend)
    # Functions, as backslashes in a replacement text would mean something.
    page = re.sub(r"<title>.*?</title>", lambda _: f"<title>{escaped}</title>", page, count=1)
    page = re.sub(r"<body[^>]*>", lambda tag: tag[0] + heading, page, count=1)
    return page.replace("</body>", _SCRIPT.format(aspect=ASPECT) + "</body>")
