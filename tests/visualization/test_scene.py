"""The robot as a Meshcat scene: bodies, cables and floor."""

import numpy as np
import pytest
from helpers import prism
from helpers.laws import UNEVEN
from helpers.made_up_walk import make_row, make_walk
from helpers.meshcat_page import commands
from matplotlib.colors import hex2color

from tetra_drake.robot.ground import ground_heights
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.load import load_scenario
from tetra_drake.settings.units import INCH, INCHES
from tetra_drake.visualization import scene


@pytest.mark.parametrize("name", ["incline", "steps", "rough"])
def test_the_drawn_floor_is_the_ground_a_node_radius_lower_and_as_fine(name, meshcat):
    robot = Robot.of(load_scenario("coulomb").with_changes({"terrain": UNEVEN[name]}))
    ground, radius = robot.ground, scene.drawn_radii(robot.structure)[1].min()
    points = make_walk().p_WN.values
    scene.set_surroundings(meshcat, robot, points, seen=points[0])
    page = meshcat.StaticHtml()
    objects = {c["path"]: c["object"] for c in commands(page, "/floor/") if "object" in c}
    assert "/floor/slab" not in objects
    vertices = {
        path: np.reshape(thing["geometries"][0]["data"]["attributes"]["position"]["array"], (-1, 3))
        for path, thing in objects.items()
        if path in ("/floor/relief", "/floor/squares", "/floor/dark")
    }
    assert len(vertices) == 3
    for path, p_WV in vertices.items():
        above = p_WV[:, 2] - ground_heights(p_WV[:, :2], ground) + radius
        walls = p_WV[:, 2] < p_WV[:, 2].min() + 1e-6 if path == "/floor/relief" else False
        assert np.abs(above[~walls] if path == "/floor/relief" else above - 3e-4).max() < 1.1e-4
        assert (p_WV[:, :2].min(axis=0) < points.min(axis=(0, 1))[:2] - 6.0 * INCH).all()
        assert (p_WV[:, :2].max(axis=0) > points.max(axis=(0, 1))[:2] + 6.0 * INCH).all()
    floor = scene.floor_points(ground, np.array([[-6, -9], [60, 9]]), INCHES)
    assert floor.shape[0] * floor.shape[1] <= scene.MOST_POINTS
    inches = floor[:, 0, 0] / INCH
    assert set(range(-6, 61)) <= set(inches.round(9))  # the grid's lines lie on its edges
    middle = (floor[1:, :-1] + floor[:-1, :-1]) / 2
    error = ground_heights(middle[..., :2], ground) - middle[..., 2]
    assert np.abs(error).max() < 0.01 * INCH


def test_bodies_of_any_structure_have_their_struts_and_nodes(meshcat):
    structure = prism.make_prism().structure
    scene.add_robot(meshcat, structure)
    page = meshcat.StaticHtml()
    shapes = {c["path"]: c["object"]["geometries"][0] for c in commands(page, "set_object")}
    moved = {c["path"]: np.reshape(c["matrix"], (4, 4)).T for c in commands(page, "set_transform")}
    for i, body in enumerate(structure.bodies):
        ends = structure.p_BN[2 * i : 2 * i + 2]
        (path,) = (path for path in shapes if path.startswith(f"/robot/{body}/strut "))
        along = (ends[1] - ends[0]) / shapes[path]["height"]
        np.testing.assert_allclose(moved[path][:3, 2], along, rtol=0, atol=1e-12)
        np.testing.assert_allclose(moved[path][:3, 3], ends.mean(axis=0), rtol=0, atol=1e-12)
    radii = scene.drawn_radii(structure)[1]
    assert (radii >= prism.RADII).all()
    for name, radius, p_BN in zip(structure.node_names, radii, structure.p_BN, strict=True):
        (path,) = (path for path in shapes if path.endswith(f"/node {name}"))
        assert shapes[path]["radius"] == radius
        np.testing.assert_allclose(moved[path][:3, 3], p_BN, rtol=0, atol=1e-12)


def test_a_sample_places_bodies_and_cables_and_colours_feet(meshcat):
    walk = make_walk().isel(time=[50])  # T1 is lifted, T2 stands
    robot = make_row()
    scene.add_robot(meshcat, robot.structure)
    scene.place_robot(meshcat, robot, walk, per_newton=1e-4)
    page = meshcat.StaticHtml()
    moved = {c["path"]: np.reshape(c["matrix"], (4, 4)).T for c in commands(page, "set_transform")}
    for path, cable in zip(scene.cable_paths(robot.structure), robot.structure.cables, strict=True):
        start, end = walk.p_WN.values[0, [cable["node_a"], cable["node_b"]]]
        matrix = moved[path]
        np.testing.assert_allclose(matrix[:3, 3] - matrix[:3, 2] / 2, start, rtol=0, atol=1e-12)
        np.testing.assert_allclose(matrix[:3, 3] + matrix[:3, 2] / 2, end, rtol=0, atol=1e-12)
    for body, place in zip(robot.structure.bodies, walk.p_WB.values[0], strict=True):
        np.testing.assert_array_equal(moved[f"/robot/{body}"][:3, 3], place)
    told = [c for c in commands(page, "set_property") if c["property"] == "color"]
    colours = {c["path"]: c["value"] for c in told}
    lifted, stands = (colours[f"/robot/{body}/node {body} bottom_left"] for body in ("T1", "T2"))
    assert lifted != stands
    assert stands[:3] == pytest.approx(hex2color(scene.COLOURS["stance"]))


def test_a_cut_cable_is_not_seen():
    walk, cut = make_walk(bodies=3), {"at": "1 s", "cut": ["T1-T2 outer top"]}
    robot = make_row(3, {"events": [cut]})
    radii = scene.cable_radii(robot, walk, 1e-4)
    thin = radii < 1e-6
    cable = robot.structure.cable_names.index(*cut["cut"])
    assert thin[:, cable].tolist() == (walk.time.values >= 1.0).tolist()
    assert np.flatnonzero(thin.any(axis=0)).tolist() == [cable]
