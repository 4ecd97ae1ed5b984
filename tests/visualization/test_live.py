"""Watching a simulation in Meshcat: when what is shown, and that it changes nothing."""

from __future__ import annotations

import socket
from collections.abc import Iterator

import numpy as np
import pytest
import xarray
from helpers.meshcat_page import commands, unpack
from pydrake.geometry import Meshcat, MeshcatParams

from tetra_drake.engines.simulate import simulate
from tetra_drake.robot.gait import Gait, seeded_gait
from tetra_drake.scenario.schema import Scenario
from tetra_drake.visualization.live import FRAMES_PER_SECOND, LiveView
from tetra_drake.visualization.replay import quiet_meshcat

HANDSHAKE = (
    "GET / HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
)


class FakeTime:
    """A clock that sleeping advances, and each look at it by `look` s."""

    def __init__(self, look: float = 0.0) -> None:
        self.now, self.look, self.slept = 1000.0, look, 0.0

    def clock(self) -> float:
        self.now += self.look
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds
        self.slept += seconds


@pytest.fixture
def short(scenario: Scenario) -> Scenario:
    return scenario.with_changes({"simulation.duration": 0.3, "simulation.steady_from": 0.1})


@pytest.fixture
def gait(short: Scenario) -> Gait:
    return seeded_gait(short)


@pytest.fixture
def meshcat() -> Meshcat:
    return quiet_meshcat(MeshcatParams(host="localhost", port=0))


@pytest.fixture
def visitor(meshcat: Meshcat) -> Iterator[socket.socket]:
    """A browser's connection, as far as Meshcat can tell."""
    with socket.create_connection(("localhost", meshcat.port())) as connection:
        connection.sendall(HANDSHAKE.encode())
        yield connection


def shown_position(meshcat: Meshcat, body: str) -> list[float]:
    """Where Meshcat has a body now: the last column of its matrix."""
    (matrix,) = (
        command["matrix"]
        for command in map(unpack, commands(meshcat.StaticHtml(), "set_transform"))
        if command["path"] == f"/robot/{body}"
    )
    position: list[float] = matrix[12:15]
    return position


@pytest.mark.parametrize(("look", "slept"), [(0.0, 0.3), (1.0, 0.0)], ids=["fast", "slow"])
def test_watching_changes_nothing_and_waits_for_real_time_only(
    short: Scenario,
    gait: Gait,
    meshcat: Meshcat,
    visitor: socket.socket,
    look: float,
    slept: float,
) -> None:
    time = FakeTime(look)
    view = LiveView(meshcat, short, clock=time.clock, sleep=time.sleep)
    while meshcat.GetNumActiveConnections() == 0:
        pass
    watched = simulate(scenario=short, gait=gait, record=True, viewer=view)
    assert slept - 1.0 / FRAMES_PER_SECOND <= time.slept <= slept
    alone = simulate(scenario=short, gait=gait, record=True)
    assert watched.metrics == alone.metrics
    assert watched.integrator == alone.integrator
    xarray.testing.assert_identical(watched.trajectory, alone.trajectory)


def test_shows_where_the_robot_is(
    short: Scenario, gait: Gait, meshcat: Meshcat, visitor: socket.socket
) -> None:
    view = LiveView(meshcat, short, sleep=lambda seconds: None)
    shown = []

    class Onlooker:
        def wants(self, time: float) -> bool:
            return view.wants(time)

        def show(self, frame: xarray.Dataset) -> None:
            view.show(frame)
            shown.append(frame)

    simulate(scenario=short, gait=gait, viewer=Onlooker())
    for i, body in enumerate(shown[-1]["tetrahedron"].values):
        expected = shown[-1]["p_WB"].values[0, i]
        np.testing.assert_array_equal(shown_position(meshcat, body), expected)
    times = np.array([frame["time"].values[0] for frame in shown])
    assert times[0] == 0.0
    assert len(times) <= 0.3 * FRAMES_PER_SECOND + 1
    # A frame is due every 33 ms and comes with the end of a step, which takes 8 ms at most.
    assert np.diff(times).max() < 1.0 / FRAMES_PER_SECOND + 0.009


def test_waits_for_a_browser(short: Scenario, gait: Gait, meshcat: Meshcat) -> None:
    class GivenUp(Exception):
        pass

    looks = []

    def sleep(seconds: float) -> None:
        looks.append(seconds)
        if len(looks) == 3:
            raise GivenUp

    with pytest.raises(GivenUp):
        simulate(scenario=short, gait=gait, viewer=LiveView(meshcat, short, sleep=sleep))


def test_plays_the_recording_afterwards(
    short: Scenario, gait: Gait, meshcat: Meshcat, visitor: socket.socket
) -> None:
    view = LiveView(meshcat, short, sleep=lambda seconds: None)
    result = simulate(scenario=short, gait=gait, record=True, viewer=view)
    assert not commands(meshcat.StaticHtml(), "set_animation")
    assert result.trajectory is not None
    view.replay(result.trajectory)
    assert commands(meshcat.StaticHtml(), "set_animation")
