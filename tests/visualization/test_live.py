"""Watching a simulation in Meshcat: when what is shown."""

import re
import socket
from unittest.mock import Mock

import numpy as np
import pytest
from helpers.converged import shortly
from pydrake.geometry import Meshcat

from tetra_drake.engines.simulate import simulate
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.visualization.live import FRAMES_PER_SECOND, LiveView, open_view


@pytest.fixture
def short(scenario):
    return shortly(scenario, 0.3, robot__tetrahedra=2)


@pytest.mark.parametrize(("look", "slept"), [(0.0, 0.3), (1.0, 0.0)], ids=["fast", "slow"])
def test_frames_are_shown_in_real_time(short, meshcat, look, slept, monkeypatch):
    time = Mock()

    def rested():
        return sum(nap.args[0] for nap in time.sleep.call_args_list)

    # Sleeping advances the clock, and each look at it by `look` s.
    time.monotonic.side_effect = lambda: look * time.monotonic.call_count + rested()
    monkeypatch.setattr("tetra_drake.visualization.live.time", time)
    monkeypatch.setattr(Meshcat, "GetNumActiveConnections", lambda _: 1)  # a browser
    view = Mock(wraps=LiveView(meshcat, short))
    simulate(scenario=short, gait=seeded_gait(short), viewer=view)
    assert slept - 1.0 / FRAMES_PER_SECOND <= rested() <= slept
    times = np.array([call.args[0]["time"].values[0] for call in view.show.call_args_list])
    assert times[0] == 0.0 and len(times) <= 0.3 * FRAMES_PER_SECOND + 1
    # A frame is due every 33 ms and comes with the end of a step, which takes 12 ms at most.
    assert np.diff(times).max() < 1.0 / FRAMES_PER_SECOND + 0.013


def test_only_this_machine_can_watch(short):
    told = []
    view = open_view(short, say=told.append)
    port = int(re.search(r"localhost:(\d+)", told[0])[1])
    socket.create_connection(("localhost", port)).close()
    with pytest.raises(OSError):  # as another of the machine's addresses
        socket.create_connection(("127.0.0.2", port), timeout=5.0)
    del view


def test_waits_for_a_browser(short, meshcat, monkeypatch):
    time = Mock(sleep=Mock(side_effect=[None, None, TimeoutError]))
    monkeypatch.setattr("tetra_drake.visualization.live.time", time)
    with pytest.raises(TimeoutError):
        simulate(scenario=short, gait=seeded_gait(short), viewer=LiveView(meshcat, short))
    assert time.sleep.call_count == 3
