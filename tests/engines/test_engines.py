"""What holds on every engine: recording and watching change nothing, failures are reported."""

import pickle
from unittest.mock import Mock

import numpy as np
import pytest
import xarray
from helpers.actuations import LIMITED
from helpers.converged import shortly

from tetra_drake.engines.mujoco import installed
from tetra_drake.engines.simulate import simulate
from tetra_drake.errors import Diverged, StepBudgetExceeded
from tetra_drake.laws.feedback import PATHWAYS
from tetra_drake.laws.friction import Coulomb
from tetra_drake.laws.terrain import Rough
from tetra_drake.robot.command import Command
from tetra_drake.robot.measures import path_of_centre
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.engine_kinds import Drake
from tetra_drake.scenario.load import load_scenario

WAVES = Command("waves", 0.1, 1.5 * np.sin(np.arange(10.0)[:, np.newaxis] + np.arange(8)))
ROUGH = {"terrain": Rough(amplitude=2e-3, wavelength=0.1), "friction": Coulomb()}
FEELS = {"cpg.signals": "live", "cpg.feedback": list(PATHWAYS)}
SMALL = {"robot.tetrahedra": 2}
WALKS = {
    "thesis": ("thesis", SMALL, ["drake", "compiled", *(["mujoco"] if installed() else [])]),
    "witnessed": ("thesis-reversal", SMALL | {"engine": Drake(mode_changes="witness")}, ["drake"]),
    "rough": ("thesis", ROUGH, ["compiled"]),
    "feedback": ("thesis", FEELS | {"robot.tetrahedra": 3}, ["drake", "compiled"]),
    "command": ("coulomb", {}, ["compiled"]),
} | {name: ("prism", {"actuation": kind}, ["drake", "compiled"]) for name, kind in LIMITED.items()}
"""A shipped scenario, its changes, and engines that simulate it."""


@pytest.mark.parametrize(
    ("walk", "engine"),
    [(walk, engine) for walk, (_, _, engines) in WALKS.items() for engine in engines],
)
def test_recording_and_watching_change_nothing(walk, engine):
    name, changes, _ = WALKS[walk]
    changes = {"engine": f"!{engine.capitalize()}"} | changes
    short = shortly(load_scenario(name), 0.3, **changes)
    drive = {"command": WAVES} if walk == "command" else {"gait": seeded_gait(short)}
    plain = simulate(short, **drive)
    recorded = simulate(short, **drive, record=True)
    assert plain.engine == engine
    assert plain.recorded is None and recorded.recorded is not None
    if engine == "drake":
        viewer, unwatched = Mock(wants=Mock(return_value=True)), recorded
        recorded = simulate(short, **drive, record=True, viewer=viewer)
        assert viewer.show.call_count > 25
        xarray.testing.assert_identical(recorded.trajectory, unwatched.trajectory)
    # NaN, too, of a robot that has no front.
    assert repr(recorded.metrics) == repr(plain.metrics), "bit for bit"
    assert recorded.integrator == plain.integrator
    for column, values in vars(plain.path).items():
        np.testing.assert_array_equal(getattr(recorded.path, column), values)


def test_the_path_is_that_of_the_trajectory(scenario, engine):
    beside = [[0.0, f"{y} mm", 0.0] for y in (4, 0, -3)]
    changes = {"robot.tetrahedra": 3, "robot.offsets": beside, "engine": engine}
    short = shortly(scenario, 0.5, **changes)
    result = simulate(scenario=short, gait=seeded_gait(short), record=True)
    path, whole = result.path, path_of_centre(result.trajectory, Robot.of(short).structure)
    assert path.times.tolist() == [0.0, 0.25, 0.5]
    np.testing.assert_allclose(path.centre, whole.centre[::25], atol=1e-9)
    np.testing.assert_allclose(path.heading, whole.heading[::25], atol=1e-9)
    assert abs(path.heading[-1]) > 1e-4
    assert result.metrics.heading_change == path.heading[-1] - path.heading[0]


FAILING = [({"simulation.max_speed": "1 cm/s"}, Diverged)]
FAILING += [({"cpg.gain": "4e9 N"}, Diverged)]  # steps below the least
FAILING += [({"simulation.max_evaluations": 1000}, StepBudgetExceeded)]


@pytest.mark.parametrize(("changes", "kind"), FAILING)
def test_a_simulation_that_fails_on_the_diagram_says_when_and_why(scenario, changes, kind):
    failing = shortly(scenario, 1.0, engine="!Drake", **changes)
    with pytest.raises(kind) as caught:
        simulate(scenario=failing, gait=seeded_gait(failing))
    assert 0.0 <= caught.value.time < failing.simulation.duration
    assert caught.value.reason in str(caught.value)
    sent = pickle.loads(pickle.dumps(caught.value))  # to another process
    assert (type(sent), sent.time, str(sent)) == (kind, caught.value.time, str(caught.value))


def test_without_mujoco_its_engine_is_refused(scenario, monkeypatch, refused):
    monkeypatch.setattr("tetra_drake.engines.mujoco.installed", lambda: False)
    with refused("thesis", "engine"):
        simulate(scenario.with_changes({"engine": "!Mujoco"}), seeded_gait(scenario))
