"""Terrains: the grids they become, the surfaces drawn from those, and what is refused."""

from pathlib import Path

import numpy as np
import pytest
from helpers.laws import UNEVEN
from scipy.interpolate import NdBSpline

from tetra_drake.laws.height_field import HeightField
from tetra_drake.laws.terrain import (
    Grid,
    Obstacles,
    Rough,
    Steps,
    SurfaceGrid,
    Terrain,
    surface,
)
from tetra_drake.scenario.load import SCENARIO, load_scenario, save_scenario
from tetra_drake.scenario.scenario import Scenario

IN = 0.0254
AHEAD = 20.0 * IN


def grid_of(terrain: Terrain) -> Grid:
    return terrain.grid(ahead=AHEAD, scale=1.0, source="file")


def spline(grid: Grid, x: np.ndarray, y: np.ndarray, nu: tuple[int, int] = (0, 0)) -> np.ndarray:
    """The biquadratic B-spline whose control points are the heights, or a derivative of it."""
    axes = zip(grid.corner, grid.cell, grid.heights.shape, strict=True)
    knots = tuple(start + cell * (np.arange(size + 3) - 1.5) for start, cell, size in axes)
    places = np.stack(np.broadcast_arrays(x, y), axis=-1)
    return NdBSpline(knots, grid.heights, k=2)(places, nu=nu)


@pytest.mark.parametrize("terrain", UNEVEN.values(), ids=UNEVEN)
def test_the_surface_is_the_spline_of_the_heights_with_its_gradient(terrain):
    grid = grid_of(terrain)
    base = SurfaceGrid.of(grid, is_stepped=terrain.is_stepped)
    for x, y in np.random.default_rng(0).uniform(-0.6, 0.7, (200, 2)):
        expected = [spline(grid, x, y, nu) for nu in ((0, 0), (1, 0), (0, 1))]
        found = surface(x, y, base, grid.heights.ravel())
        np.testing.assert_allclose(found, expected, atol=1e-12)


@pytest.mark.parametrize("terrain", UNEVEN.values(), ids=UNEVEN)
def test_the_ground_of_a_robot_ten_times_as_long_is_ten_times_as_large(terrain):
    lengths = ("height", "depth", "amplitude", "wavelength", "radius", "spacing", "start")
    larger = {key: 10.0 * length for key, length in terrain if key in lengths}
    grid = grid_of(terrain)
    large = terrain.model_copy(update=larger).grid(ahead=10.0 * AHEAD, scale=10.0, source="file")
    np.testing.assert_allclose(large.heights, 10.0 * grid.heights, atol=1e-12)
    np.testing.assert_allclose(large.corner + large.cell, 10.0 * np.array(grid.corner + grid.cell))


@pytest.mark.parametrize("terrain", UNEVEN.values(), ids=UNEVEN)
def test_a_grid_covers_the_way_and_more(terrain):
    # Half a cell within its outermost heights, the surface has all the heights it is made of.
    grid = grid_of(terrain)
    first = np.add(grid.corner, np.multiply(0.5, grid.cell))
    last = first + np.multiply(np.array(grid.heights.shape) - 2, grid.cell)
    assert (first <= [-24 * IN, -30 * IN]).all() and (last >= [120 * IN, 30 * IN]).all()


@pytest.mark.parametrize(("height", "start"), [(-0.25 * IN, None), (5 * IN, -0.1)])
def test_stairs_have_their_treads_and_edges_in_place(height, start):
    depth, count = 10.1 * IN, 3
    grid = grid_of(Steps(height=height, depth=depth, count=count, start=start))
    first = AHEAD if start is None else start
    steps = np.arange(count)
    treads = spline(grid, first + (np.arange(-1, count + 2) + 0.5) * depth, 0.01)
    np.testing.assert_allclose(treads, height * np.array([0, 1, 2, 3, 3, 3]), atol=1e-12)
    edges = spline(grid, first + steps * depth, -0.2)
    np.testing.assert_allclose(edges, height * (steps + 0.5), atol=1e-12)
    # Level again a cell away, which is at most the height of a step.
    beside = spline(grid, first + steps * depth + min(abs(height), depth / 4), 0.0)
    np.testing.assert_allclose(beside, height * (steps + 1), atol=1e-12)


def test_rough_heights_are_uniform_and_never_above_the_floor():
    grid = grid_of(Rough(amplitude=0.3, wavelength=0.06))
    heights = grid.heights
    assert grid.cell == (0.03, 0.03)  # half a wavelength
    assert -0.6 <= heights.min() < -0.599 and -0.001 < heights.max() <= 0.0
    spread = 0.6 / np.sqrt(12.0)
    assert abs(heights.mean() + 0.3) < 5 * spread / np.sqrt(heights.size)
    assert heights.std() == pytest.approx(spread, rel=0.02)


def test_a_seed_is_one_ground_on_every_machine():
    grounds = (Rough(amplitude=0.5, wavelength=0.5, seed=seed) for seed in (0, 0, 1))
    first, again, other = (grid_of(ground).heights for ground in grounds)
    # numpy's default_rng(0).random(3)
    drawn = np.array([0.6369616873214543, 0.2697867137638703, 0.04097352393619469])
    np.testing.assert_allclose(first[0, :3], drawn - 1.0, rtol=1e-14)
    assert np.array_equal(first, again)
    assert (first != other).all()


def test_as_many_bumps_stand_as_there_are_squares():
    # A paraboloid's volume is half its cylinder's; bumps this small seldom overlap.
    height, radius, spacing, start = 0.1, 0.01, 0.127, 0.0
    grid = grid_of(Obstacles(height=height, radius=radius, spacing=spacing, start=start))
    assert 0.99 * height < grid.heights.max() <= height
    first = start + radius + 0.75 * radius
    rows, columns = np.ceil((120 * IN - first) / spacing), 60 * IN / spacing
    volume = grid.heights.sum() * np.prod(grid.cell)
    one = 0.5 * np.pi * radius**2 * height
    assert volume == pytest.approx(rows * columns * one, rel=0.02)


HEIGHTS = np.array([[0.0, 1.0, 2.0, 3.0], [0.5, -1.0, 2.5, 1e-3], [4.0, 5.0, 6.0, 7.0]])


def write_heights(file: Path, heights: np.ndarray) -> None:
    if file.suffix == ".npy":
        np.save(file, heights)
    else:
        np.savetxt(file, heights, delimiter=", " if file.suffix == ".csv" else " ", header="x, y")


def on_field(file: Path) -> Scenario:
    return load_scenario("thesis").with_changes({"terrain": HeightField(file=str(file), cell=0.5)})


def test_a_height_file_has_rows_along_x(tmp_path):
    for name in ("heights.npy", "heights.csv", "heights.txt"):
        write_heights(tmp_path / name, HEIGHTS)
        grid = grid_of(HeightField(file=str(tmp_path / name), cell=0.5))
        assert np.array_equal(grid.heights, HEIGHTS)
        assert (grid.corner, grid.cell) == ((-0.5, -0.75), (0.5, 0.5))  # centred: 1 by 1.5 m


NO_HEIGHTS = {
    "nan in row 2, column 2": np.diag([0.0, np.nan, 0.0]),
    "-10000000.0 in row 2, column 3": np.where(np.arange(9).reshape(3, 3) == 5, -1e7, 0.0),
    "1 x 3 x 4": HEIGHTS[None],
    "2000 x 2001": np.zeros((2000, 2001), dtype=np.int8),
}
NO_FILES = [b"", b"one two", b"1 2 3\n4 5\n", b"\x93NUMPY\x01\x00\x06\x00{'a':{"]


@pytest.mark.filterwarnings("error")
def test_what_are_no_heights_is_refused(tmp_path, refused):
    file, mine = tmp_path / "heights.npy", tmp_path / "mine.yaml"

    def refuse(name, fact):
        mine.write_text(f"base: thesis\nterrain: !HeightField {{file: {name}, cell: 1 m}}\n")
        with refused(mine, "terrain.file", fact):
            load_scenario(mine)

    for found, heights in NO_HEIGHTS.items():
        np.save(file, heights, allow_pickle=True)
        refuse("heights.npy", found)
    for content in NO_FILES:
        for name in ("heights.npy", "heights.txt"):
            (tmp_path / name).write_bytes(content)
            refuse(name, name)


def test_a_height_file_is_sought_beside_the_scenario_that_names_it(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_heights(tmp_path / "heights.csv", HEIGHTS)
    field = "!HeightField {file: heights.csv, cell: 5 m}"
    Path("hilly.yaml").write_text(f"base: thesis\nterrain: {field}")
    absolute = HeightField(file=str(tmp_path / "heights.csv"), cell=5.0)
    assert load_scenario("hilly.yaml").terrain == absolute
    Path("mine").mkdir()
    Path("mine/fine.yaml").write_text("base: ../hilly.yaml\nterrain: {cell: 1 m}")
    assert load_scenario("mine/fine.yaml").terrain == HeightField(file=absolute.file, cell=1.0)


def test_fields_are_equal_if_their_heights_are_wherever_they_were_read(tmp_path):
    names = "one.npy", "same.csv", "other.npy", "turned.npy"
    fields = HEIGHTS, HEIGHTS, HEIGHTS + 1e-12, HEIGHTS.reshape(4, 3)
    for name, heights in zip(names, fields, strict=True):
        write_heights(tmp_path / name, heights)
    one, same, *others = (on_field(tmp_path / name) for name in names)
    assert one == same and hash(one) == hash(same) and one.differences(same) == []
    for other in others:
        assert one != other
        [(key, text)], [(_, other_text)] = one.differences(other), other.differences(one)
        assert key == "terrain.file" and text != other_text
    (tmp_path / "whole.yaml").write_text(one.to_yaml())
    assert load_scenario(tmp_path / "whole.yaml") == one


@pytest.mark.parametrize("damage", ["gone", "changed"])
def test_a_saved_field_does_not_need_the_file_it_was_read_from(tmp_path, damage, refused):
    write_heights(tmp_path / "heights.csv", HEIGHTS)
    scenario = on_field(tmp_path / "heights.csv")
    save_scenario(tmp_path / "record", scenario)
    (tmp_path / "heights.csv").unlink()
    changed = scenario.with_changes({"terrain.cell": "1 m"})
    assert np.array_equal(grid_of(changed.terrain).heights, HEIGHTS)

    moved = (tmp_path / "record").rename(tmp_path / "moved")
    loaded = load_scenario(moved / SCENARIO)
    assert loaded == scenario
    assert np.array_equal(grid_of(loaded.terrain).heights, HEIGHTS)

    (copy,) = (file for file in moved.iterdir() if file.name != SCENARIO)
    copy.unlink() if damage == "gone" else write_heights(copy, 2.0 * HEIGHTS)
    with refused(moved / SCENARIO, "terrain.file", copy.name):
        load_scenario(moved / SCENARIO)
