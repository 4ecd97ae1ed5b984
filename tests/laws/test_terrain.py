"""The surface of the ground and the frames in it, against planes, differences and splines."""

import math

import numpy as np
import pytest

from tetra_drake.laws.contact import Ground
from tetra_drake.laws.height_field import HeightField
from tetra_drake.laws.terrain import (
    FRAME_COLUMNS,
    GAP,
    N_X,
    T1_X,
    T2_Y,
    Incline,
    Relief,
    Rough,
    Steps,
    SurfaceGrid,
    put_frame,
    rolled_surface,
    surface,
)
from tetra_drake.robot.ground import ground_frames, ground_heights, make_ground
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import Structure, node_positions
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.scenario import Scenario

INCH = 0.0254
ROUGH = Rough(amplitude=0.5 * INCH, wavelength=5.0 * INCH, seed=3)


@pytest.fixture
def ground(scenario: Scenario, structure: Structure):
    """A function that gives the ground of a terrain, under the robot."""
    return lambda terrain: make_ground(scenario.with_changes({"terrain": terrain}), structure)


def at(ground: Ground, x: float, y: float) -> tuple[float, float, float]:
    """Height of the surface and its gradient."""
    return surface(x, y, SurfaceGrid(*ground.grid), ground.heights)


def saved(heights: np.ndarray, folder) -> str:
    """The name of a file with heights."""
    np.save(folder / "heights.npy", heights)
    return str(folder / "heights.npy")


def test_beyond_the_grid_the_surface_goes_on_as_it_is_at_the_edge(ground, tmp_path):
    x = 0.5 * np.arange(-4, 5)[:, np.newaxis]
    made = ground(HeightField(file=saved(0.1 * x + np.zeros((9, 7)) - 0.5, tmp_path), cell=0.5))
    edge = at(made, 1.75, 0.1)  # half a cell within the last height
    for far in (1.76, 5.0, 1e9, np.inf, np.nan):
        assert at(made, far, 0.1) == (pytest.approx(edge[0], abs=1e-8), 0.0, 0.0)
    assert at(made, 0.3, np.nan)[1:] == (pytest.approx(0.1), 0.0)


def test_a_frame_is_orthonormal_and_its_first_tangent_is_worlds_x_in_the_plane(ground):
    made = ground(ROUGH)
    p_WN = np.random.default_rng(1).uniform(-0.5, 1.0, (50, 3))
    p_WN[:, 2] = ground_heights(p_WN[:, :2], made) - 1e-3
    for p, frame in zip(p_WN, ground_frames(p_WN, made), strict=True):
        _, h_x, h_y = at(made, *p[:2])
        n = np.array([-h_x, -h_y, 1.0]) / math.hypot(h_x, h_y, 1.0)
        projected = np.array([1.0, 0.0, 0.0]) - n[0] * n
        t_1 = projected / np.linalg.norm(projected)
        np.testing.assert_allclose(frame[N_X : N_X + 3], n, atol=1e-14)
        np.testing.assert_allclose(frame[T1_X : T1_X + 3], t_1, atol=1e-14)
        np.testing.assert_allclose(frame[T2_Y : T2_Y + 2], np.cross(n, t_1)[1:], atol=1e-14)
        assert frame[GAP] == pytest.approx(-1e-3 * n[2], rel=1e-9)


def test_a_robot_that_starts_off_the_grid_is_refused(ground, refused, tmp_path):
    small = HeightField(file=saved(np.zeros((3, 3)), tmp_path), cell=0.1)
    with refused("thesis", "terrain", "off its grid"):
        ground(small)


def test_a_robot_that_starts_at_rest_may_be_pressed_into_the_ground():
    robot = Robot.of(load_scenario("six_bar").with_changes({"terrain": Incline(slope=0.1)}))
    start = node_positions(robot.structure, robot.structure.initial_state)
    gaps = ground_frames(start[robot.structure.contacts], robot.ground)[:, GAP]
    gaps -= robot.ground.radius
    depth = robot.weight / 3.0 / robot.scenario.ground.stiffness  # three feet bear it
    assert gaps.min() == pytest.approx(-depth, rel=1e-3)


def frame_under(centre: np.ndarray, surface: tuple[SurfaceGrid, np.ndarray]) -> np.ndarray:
    """Frame of a ball with this centre on its rolled surface."""
    frames = np.empty((1, FRAME_COLUMNS))
    put_frame(tuple(centre), *surface, True, 0, frames)
    return frames[0]


def rolled(terrain: Relief, radius: float) -> tuple[SurfaceGrid, np.ndarray]:
    """Rolled surface of a terrain, with its heights."""
    grid = terrain.grid(ahead=0.0, scale=1.0, source="")
    base = SurfaceGrid.of(grid, is_stepped=terrain.is_stepped)
    return rolled_surface(base, grid.heights, radius)


@pytest.mark.parametrize("radius", [0.005, 0.02])
def test_the_gap_of_a_foot_is_its_distance_to_the_nearest_point(ground, radius):
    terrain = Rough(amplitude=0.01, wavelength=0.15, seed=3)
    surface_and_heights, made = rolled(terrain, radius), ground(terrain)
    for x, y in np.random.default_rng(4).uniform(-0.2, 0.4, (10, 2)):
        centre = np.array([x, y, surface(x, y, *surface_and_heights)[0] - 0.02 * radius])
        steps = np.linspace(-1.2 * radius, 1.2 * radius, 201)
        near = np.stack(np.meshgrid(x + steps, y + steps), axis=-1).reshape(-1, 2)
        points = np.column_stack([near, ground_heights(near, made)])
        nearest = np.linalg.norm(points - centre, axis=1).min()
        gap = frame_under(centre, surface_and_heights)[GAP]
        assert gap == pytest.approx(nearest - radius, abs=0.02 * radius)


@pytest.mark.parametrize(("radius", "height"), [(0.05, 0.02), (0.05, 0.005), (0.0125, 0.005)])
def test_a_ball_meets_a_step_where_its_circle_meets_the_edge(radius, height):
    stairs = rolled(Steps(height=height, depth=2.0, count=1, start=0.3), radius)
    x = np.arange(0.2, 0.3, 1e-4)
    risen = [surface(at, 0.0, *stairs)[0] > radius + 0.002 * radius for at in x]
    touch = math.sqrt(radius**2 - (radius - height) ** 2)
    assert 0.3 - x[np.argmax(risen)] == pytest.approx(touch, abs=0.01 * radius)
