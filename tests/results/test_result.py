"""What a result says of its simulation."""

import json

import numpy as np
import pytest
from helpers.totals import make_totals

from tetra_drake.physics.contact import MODE_COLUMNS
from tetra_drake.results.result import (
    IntegratorWork,
    SimulationResult,
    make_result,
    motion_times,
    save_result,
)
from tetra_drake.results.trajectory import Motion
from tetra_drake.robot.gait import seeded_gait
from tetra_drake.scenario.units import INCH

RADIUS = 0.3  # m


def result_of(robot, states) -> SimulationResult:
    """That of a robot which is in these states at the times that count."""
    motion = Motion(
        times=motion_times(robot.scenario.simulation, record=False),
        states=states,
        signals=np.zeros((len(states), robot.structure.signals)),
        modes=np.zeros((len(states), len(robot.structure.contacts), MODE_COLUMNS)),
        drives=np.zeros((len(states), 0)),
    )
    work = IntegratorWork(scheme="none", accuracy=1.0, steps=1, derivative_evaluations=1)
    totals = make_totals()
    gait = seeded_gait(robot.scenario)
    return make_result(robot, gait, motion, totals=totals, work=work, wall_time=1.0, record=False)


def on_a_circle(robot, *, per_second, radius=RADIUS) -> np.ndarray:
    """States of a robot that is carried along a circle and turns by so many rad in each second: to
    the left, forward if the radius is positive."""
    times = motion_times(robot.scenario.simulation, record=False)
    structure = robot.structure
    states = np.tile(structure.initial_state, (len(times), 1))
    angles = per_second * times
    c, s = np.cos(angles), np.sin(angles)
    for i, (x, y, _) in enumerate(structure.p_WB - structure.p_WB.mean(axis=0)):
        pose = states[:, 7 * i : 7 * i + 7]
        pose[:, 0], pose[:, 3] = np.cos(angles / 2), np.sin(angles / 2)
        pose[:, 4] = c * x - s * y + radius * s
        pose[:, 5] = s * x + c * y + radius * (1.0 - c)
    return states


@pytest.mark.parametrize("radius", [RADIUS, -RADIUS], ids=["forward", "backward"])
def test_a_robot_on_a_circle_has_turned_by_its_angle(robot, radius):
    states = on_a_circle(robot, per_second=0.5, radius=radius)
    result = result_of(robot, states)
    assert result.metrics.heading_change == pytest.approx(7.5)  # in 15 s: more than one turn
    assert result.metrics.path_curvature == pytest.approx(1.0 / RADIUS, rel=1e-4)
    assert result.metrics.path_radius == pytest.approx(RADIUS, rel=1e-4)
    np.testing.assert_allclose(np.diff(result.path.times), 0.25)
    assert result.path.times[[0, -1]].tolist() == [0.0, 15.0]
    np.testing.assert_allclose(result.path.heading, 0.5 * result.path.times, atol=1e-12)
    np.testing.assert_allclose(result.path.centre[:, 2], robot.structure.p_WB[0, 2])


def test_the_path_is_written(robot, tmp_path):
    result = result_of(robot, on_a_circle(robot, per_second=-0.5))
    save_result(tmp_path / "result.json", result)
    content = json.loads((tmp_path / "result.json").read_text())
    lengths = {"distance", "steady_distance", "twist", "lead", "lateral_drift", "clearance"}
    assert {key for key in content if key.endswith("_in")} == {
        "path_radius_in",
        *(f"{name}_in" for name in lengths),
    }
    assert content["distance_in"] == pytest.approx(result.metrics.distance / INCH)
    assert content["path_radius_in"] == pytest.approx(RADIUS / INCH, rel=1e-4)
    assert content["metrics"]["heading_change"] == pytest.approx(-7.5)
    columns = (result.path.times, *result.path.centre.T, result.path.heading)
    assert list(content["path"].values()) == [column.tolist() for column in columns]
    assert list(content["path"]) == ["time_s", "x_m", "y_m", "z_m", "heading_rad"]

    standing = result_of(robot, on_a_circle(robot, per_second=0.0))
    save_result(tmp_path / "result.json", standing)
    assert json.loads((tmp_path / "result.json").read_text())["path_radius_in"] is None
