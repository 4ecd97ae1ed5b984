"""Live view: a browser shows a simulation while it runs."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np
from pydrake.geometry import Meshcat, MeshcatParams

from tetra_drake.formatting import Say
from tetra_drake.laws.cable import CableLaw, elastic_tension
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import node_positions
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.settings.units import INCH
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

FREE_FLOOR = 15.0 * INCH
"""Length of floor in front of the robot and behind it, because its path is not known yet."""
_POLLING_PERIOD = 0.1  # s, while no browser is connected


class LiveView:
    """Viewer that shows a simulation in Meshcat, not faster than real time.

    An engine calls wants() and show() (see engines.engine.Viewer). The simulation waits until a
    browser is connected.
    """

    def __init__(self, meshcat: Meshcat, scenario: Scenario) -> None:
        self._meshcat = meshcat
        self._robot = Robot.of(scenario)
        self._started: float | None = None
        self._due = 0.0
        structure = self._robot.structure
        p_WN = node_positions(structure, structure.initial_state)
        free = np.array([FREE_FLOOR * structure.scale, 0.0, 0.0])
        # The greatest tension is not known yet. The greatest at the start has half of full size.
        law = CableLaw.of(structure.cables)
        tensions = elastic_tension(np.subtract(structure.initial_lengths, law.free_length), law)
        self._per_newton = radius_per_newton(structure, 2.0 * np.max(tensions))
        add_robot(meshcat, structure)
        around = np.stack([p_WN - free, p_WN + free])
        set_surroundings(meshcat, self._robot, around, seen=around)

    def wants(self, time: float) -> bool:
        """True if a new frame is due at this time (s) of the simulation."""
        return time >= self._due

    def show(self, frame: xarray.Dataset) -> None:
        """Shows one sample of a trajectory (`time` has length 1). Waits until as much real time has
        passed as simulated time; at first, until a browser is connected."""
        now = float(frame["time"].values[0])
        if self._started is not None:
            time.sleep(max(0.0, self._started + now - time.monotonic()))
        place_robot(self._meshcat, self._robot, frame, per_newton=self._per_newton)
        if self._started is None:
            while self._meshcat.GetNumActiveConnections() == 0:
                time.sleep(_POLLING_PERIOD)
            self._started = time.monotonic() - now
        self._meshcat.SetSimulationTime(now)  # Meshcat shows the real-time rate
        self._due = (np.floor(now * FRAMES_PER_SECOND) + 1.0) / FRAMES_PER_SECOND


def open_view(scenario: Scenario, *, say: Say) -> LiveView:
    """Opens a view in a new Meshcat server. `say` gets a line of text with its web address."""
    meshcat = quiet_meshcat(MeshcatParams(host="localhost"))
    say(f"open {meshcat.web_url()} in a browser, which starts the simulation")
    return LiveView(meshcat, scenario)
