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
    """A clock that only sleeping advances."""

    def __init__(self) -> None:
        self.now = 1000.0
        self.sleeps: list[float] = []

    def clock(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds
        self.sleeps.append(seconds)


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


def test_watching_changes_no_bit_of_the_result(
    short: Scenario, gait: Gait, meshcat: Meshcat, visitor: socket.socket
) -> None:
    time = FakeTime()
    view = LiveView(meshcat, short, clock=time.clock, sleep=time.sleep)
    alone = simulate(scenario=short, gait=gait, record=True)
    watched = simulate(scenario=short, gait=gait, record=True, viewer=view)
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


def test_goes_no_faster_than_time(
    short: Scenario, gait: Gait, meshcat: Meshcat, visitor: socket.socket
) -> None:
    time = FakeTime()
    view = LiveView(meshcat, short, clock=time.clock, sleep=time.sleep)
    while meshcat.GetNumActiveConnections() == 0:
        pass
    started = time.now
    simulate(scenario=short, gait=gait, viewer=view)
    last_frame = 0.3 - 1.0 / FRAMES_PER_SECOND
    assert last_frame < time.now - started <= 0.3


def test_a_slow_simulation_is_not_held_up(
    short: Scenario, gait: Gait, meshcat: Meshcat, visitor: socket.socket
) -> None:
    time = FakeTime()

    def clock() -> float:
        time.now += 1.0  # each look at the clock finds a second gone
        return time.now

    while meshcat.GetNumActiveConnections() == 0:
        pass
    simulate(
        scenario=short, gait=gait, viewer=LiveView(meshcat, short, clock=clock, sleep=time.sleep)
    )
    assert sum(time.sleeps) == 0.0


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
