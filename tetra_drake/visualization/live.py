"""A simulation shown in a browser while it runs."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from pydrake.geometry import Meshcat, MeshcatParams

from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import node_positions
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.scenario.units import INCH
from tetra_drake.visualization.replay import quiet_meshcat
from tetra_drake.visualization.scene import (
    add_robot,
    place_robot,
    radius_per_newton,
    set_surroundings,
)

if TYPE_CHECKING:
    import xarray

FRAMES_PER_SECOND = 30.0
"""Frames per second of motion, at most."""

ROOM = 15.0 * INCH
"""Length of floor shown before and behind the robot, as nobody knows yet where it goes."""

_PATIENCE = 0.1  # s between two looks for a browser


class LiveView:
    """Shows a simulation in Meshcat, no faster than real time (see engines.interface.Viewer).

    It begins once a browser is there.
    """

    def __init__(self, meshcat: Meshcat, scenario: Scenario) -> None:
        self._meshcat = meshcat
        self._robot = Robot.of(scenario)
        self._started: float | None = None
        self._due = 0.0
        structure = self._robot.structure
        p_WN = node_positions(structure, structure.initial_state)
        room = np.array([ROOM, 0.0, 0.0])
        # The tensions to come are unknown: those at the start are drawn at half of full size.
        cables = structure.cables
        lengths = np.linalg.norm(p_WN[cables["node_b"]] - p_WN[cables["node_a"]], axis=1)
        stretch = lengths - cables["free_length"]
        self._per_newton = radius_per_newton(structure, 2.0 * (cables["stiffness"] * stretch).max())
        add_robot(meshcat, structure)
        around = np.stack([p_WN - room, p_WN + room])
        set_surroundings(meshcat, self._robot, around, seen=around)

    def wants(self, time: float) -> bool:
        """True if the frame before is over at this time (s)."""
        return time >= self._due

    def show(self, frame: xarray.Dataset) -> None:
        """Moves everything to where it is in a trajectory's sample, once its time has come."""
        now = float(frame["time"].values[0])
        if self._started is not None:
            time.sleep(max(0.0, self._started + now - time.monotonic()))
        place_robot(self._meshcat, self._robot.structure, frame, per_newton=self._per_newton)
        if self._started is None:
            while self._meshcat.GetNumActiveConnections() == 0:
                time.sleep(_PATIENCE)
            self._started = time.monotonic() - now
        self._meshcat.SetSimulationTime(now)  # for the rate it shows
        self._due = (np.floor(now * FRAMES_PER_SECOND) + 1.0) / FRAMES_PER_SECOND


def open_view(scenario: Scenario, *, say: Callable[[str], None]) -> LiveView:
    """A view in a new Meshcat, whose address `say` is told."""
    meshcat = quiet_meshcat(MeshcatParams(host="localhost"))
    say(f"open {meshcat.web_url()} in a browser, which starts the simulation")
    return LiveView(meshcat, scenario)
