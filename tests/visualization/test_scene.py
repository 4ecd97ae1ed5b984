"""The robot as a Meshcat scene: arrows, floor and camera."""

import numpy as np
import pytest
from helpers.made_up_walk import make_walk
from helpers.meshcat_page import commands
from pydrake.common.eigen_geometry import Quaternion
from pydrake.geometry import MeshcatParams
from pydrake.math import RotationMatrix

from tetra_drake.robot.ground import ground_heights
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.terrain_kinds import Incline, Rough, Steps
from tetra_drake.scenario.units import INCH
from tetra_drake.visualization.replay import quiet_meshcat
from tetra_drake.visualization.scene import (
    MOST_POINTS,
    UNEVEN_MARGIN,
    aligning_quaternions,
    floor_corners,
    floor_points,
    set_surroundings,
    tracks,
)

UNEVEN = {
    "incline": Incline(slope=0.2),
    "steps": Steps(height=0.3 * INCH, depth=6.0 * INCH, count=3),
    "rough": Rough(amplitude=0.3 * INCH, wavelength=4.0 * INCH),
}


def robot_on(terrain):
    return Robot.of(load_scenario("coulomb").with_changes({"terrain": terrain}))


def test_aligning_quaternions_turn_z_into_the_direction():
    directions = np.random.default_rng(3).normal(size=(50, 3))
    directions[:3] = [(0.0, 0.0, 2.0), (0.0, 0.0, -3.0), (0.0, 1e-12, -1.0)]
    for q, direction in zip(aligning_quaternions(directions), directions, strict=True):
        z = RotationMatrix(Quaternion(q)).matrix()[:, 2]
        np.testing.assert_allclose(z, direction / np.linalg.norm(direction), rtol=0, atol=1e-9)
    np.testing.assert_array_equal(aligning_quaternions(np.zeros(3)[np.newaxis]), [[1, 0, 0, 0]])


@pytest.mark.parametrize("terrain", UNEVEN.values(), ids=UNEVEN)
def test_the_drawn_floor_is_the_ground_a_node_radius_lower(terrain):
    robot = robot_on(terrain)
    ground, radius = robot.ground, robot.structure.node_radius
    meshcat = quiet_meshcat(MeshcatParams(host="localhost", port=0))
    points = make_walk().p_WN.values
    set_surroundings(meshcat, robot, points)
    page = meshcat.StaticHtml()
    objects = {c["path"]: c["object"] for c in commands(page, "/floor/") if "object" in c}
    assert "/floor/slab" not in objects
    vertices = {
        path: np.reshape(thing["geometries"][0]["data"]["attributes"]["position"]["array"], (-1, 3))
        for path, thing in objects.items()
        if path in ("/floor/relief", "/floor/inch", "/floor/six_inches")
    }
    assert len(vertices) == 3
    for path, p_WV in vertices.items():
        above = p_WV[:, 2] - ground_heights(p_WV[:, :2], ground) + radius
        walls = p_WV[:, 2] < p_WV[:, 2].min() + 1e-6 if path == "/floor/relief" else False
        assert np.abs(above[~walls] if path == "/floor/relief" else above - 3e-4).max() < 1.1e-4
    low, high = floor_corners(points, UNEVEN_MARGIN) * INCH
    for p_WV in vertices.values():
        np.testing.assert_allclose([p_WV[:, :2].min(axis=0), p_WV[:, :2].max(axis=0)], [low, high])
    moved = {c["path"]: c["matrix"] for c in commands(page, "set_transform")}
    arrow = np.reshape(moved["/floor/forward"], (4, 4))  # its columns, one after the other
    ends = np.array([arrow[3, :3], arrow[3, :3] + arrow[2, :3]])
    clear = ends[:, 2] - ground_heights(ends[:, :2], ground) + radius
    assert clear.min() > -0.05 * INCH and clear.max() < 0.3 * INCH


@pytest.mark.parametrize("terrain", UNEVEN.values(), ids=UNEVEN)
def test_the_drawn_floor_is_as_fine_as_the_ground_and_bounded(terrain):
    ground = robot_on(terrain).ground
    corners = np.array([[-6, -9], [60, 9]])
    floor = floor_points(ground, corners)
    assert floor.shape[0] * floor.shape[1] <= MOST_POINTS
    inches = floor[:, 0, 0] / INCH
    assert set(range(-6, 61)) <= set(inches.round(9))  # the grid's lines lie on its edges
    middle = (floor[1:, :-1] + floor[:-1, :-1]) / 2
    error = ground_heights(middle[..., :2], ground) - middle[..., 2]
    assert np.abs(error).max() < 0.01 * INCH
    if isinstance(terrain, Incline):
        assert floor.shape[:2] == (67, 19)  # nothing between whole inches


def test_force_arrows_stand_on_the_slope():
    slope = 0.2
    frames = make_walk().isel(time=[0, 50])
    inclined, flat = robot_on(Incline(slope=slope)), robot_on(load_scenario().terrain)
    sloping = {track.path: track for track in tracks(inclined, frames)}
    level = {track.path: track for track in tracks(flat, frames)}
    for kind, expected in (
        ("normal", [-np.sin(slope), 0.0, np.cos(slope)]),
        ("friction", [-np.cos(slope), 0.0, -np.sin(slope)]),  # backward in the walk
    ):
        path = f"/forces/{kind}/T1 bottom_left"
        assert frames.in_contact.values[0, 0] == 1
        (quaternion, _), scales = sloping[path].quaternions, sloping[path].scales
        z = RotationMatrix(Quaternion(quaternion)).matrix()[:, 2]
        np.testing.assert_allclose(z, expected, rtol=0, atol=1e-12)
        np.testing.assert_allclose(scales, level[path].scales, rtol=1e-12)
    assert level["/forces/normal/T1 bottom_left"].quaternions is None
