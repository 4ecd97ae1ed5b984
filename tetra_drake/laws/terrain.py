"""Terrain: the surface of the ground, z = h(x, y), its tangent frames, and kinds of terrain.

The world has x forward, y left, and z up. The robot starts around the origin, T1's base at x = 0,
and walks along +x.

The surface is a uniform biquadratic B-spline. Its control points are a regular grid of heights. The
gradient is continuous, a plane is exact, and no point is higher than the highest control point. An
edge is rounded over one cell. Beyond the grid the surface continues with the height at the border.

A point touches this surface. The centre of a round foot must stay above the *rolled surface*, on
which the centre of a ball moves that rolls over the ground. The depth of the foot is the distance
of its centre from the nearest place of the rolled surface, along whose normal the ground pushes.
Where the ball touches one place of the ground, this is the depth of the foot's lowest point. In a
corner, where it touches two, both push. The rolled surface is a spline on a finer grid.

A *frame* is a row of the table `frames`. It has the distance of a node from the surface, positive
above it, and the axes of the tangent plane: normal n, t1 (the world's x axis projected into the
plane), and t2 = n x t1. On flat ground the axes are the world's, and `frames` is not used.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, NamedTuple, Self

import numpy as np
from pydantic import Field

from tetra_drake.errors import InputError
from tetra_drake.kernels.compiling import compiled, inlined
from tetra_drake.kernels.lanes import (
    Real,
    Table,
    any_lane,
    floor,
    gather,
    inverse_sqrt,
    maximum,
    minimum,
    select,
)
from tetra_drake.laws.kinematics import P_WN
from tetra_drake.laws.vectors import Vector3, put_vector, vector_at
from tetra_drake.settings.quantities import Angle, Length
from tetra_drake.settings.section import Kinds, Section, settings_text
from tetra_drake.settings.units import INCH

GAP, N_X, N_Y, N_Z, T1_X, T1_Y, T1_Z, T2_Y, T2_Z, FRAME_COLUMNS = range(10)
"""Columns of the table `frames` (contacts, 9), and their number: distance of the node from the
surface (m), axes n and t1, and axis t2 without its x, which is 0."""

MOST_ROLLED = 1 << 18
"""Largest number of heights of a finer grid; see rolled_surface()."""
MOST_TRIALS, NEAR = 24, 1e-7
"""Most places that nearest_plane() tries, and its last step as a share of the depth."""


@dataclass(frozen=True)
class Grid:
    """Heights of a terrain on a regular grid: the control points of the surface."""

    heights: np.ndarray
    """Heights (rows, columns) in m. Rows are along x, columns along y."""
    corner: tuple[float, float]
    """Coordinates x and y of heights[0, 0], in m."""
    cell: tuple[float, float]
    """Distances between heights along x and y, in m."""


class SurfaceGrid(NamedTuple):
    """Position and size of the grid of control points of the ground's surface; SI units."""

    corner_x: Real
    """Coordinate x of the first control point."""
    corner_y: Real
    """Coordinate y of the first control point."""
    per_cell_x: Real
    per_cell_y: Real
    last_row: Real
    """Largest coordinate along x, in cells, that has three rows of control points around it."""
    last_column: Real
    """Largest coordinate along y, in cells, that has three columns of control points around it."""
    columns: Real
    """Number of control points per row."""
    first: Real
    """Index of the first control point in the heights."""
    top: Real
    """Height of the highest control point."""
    is_stepped: Real
    """1 if balls that are large enough meet sharp edges between unequal heights, otherwise 0."""
    reach: Real
    """Largest radius of a foot."""

    @classmethod
    def of(cls, grid: Grid, *, is_stepped: bool = False) -> Self:
        """Position and size of a grid of control points."""
        inside = 1.5 + 1e-9  # keeps the spline's control points on the grid in spite of rounding
        return cls(
            corner_x=grid.corner[0],
            corner_y=grid.corner[1],
            per_cell_x=1.0 / grid.cell[0],
            per_cell_y=1.0 / grid.cell[1],
            last_row=grid.heights.shape[0] - inside,
            last_column=grid.heights.shape[1] - inside,
            columns=grid.heights.shape[1],
            first=0.0,
            top=grid.heights.max(),
            is_stepped=float(is_stepped),
            reach=0.0,
        )


@inlined
def surface(x: Real, y: Real, grid: SurfaceGrid, heights: Table) -> tuple[Real, Real, Real]:
    """Height (m) of the surface at x and y (m), and its gradient: dh/dx and dh/dy; see
    bent_surface()."""
    height, h_x, h_y, _, _, _ = bent_surface(x, y, grid, heights)
    return height, h_x, h_y


@inlined
def bent_surface(x: Real, y: Real, grid: SurfaceGrid, heights: Table) -> tuple[Real, ...]:
    """Height h (m) of the surface at x and y (m), its gradient dh/dx and dh/dy, and its second
    derivatives d2h/dx2, d2h/dxdy and d2h/dy2.

    The surface is a quadratic B-spline. `heights` (points,) are the heights (m) of its control
    points, row by row. Beyond the grid the surface continues with the height at the border.
    """
    cells_x = (x - grid.corner_x) * grid.per_cell_x
    cells_y = (y - grid.corner_y) * grid.per_cell_y
    # With this order of minimum and maximum, NaN becomes a bound, so no index leaves the grid.
    s = maximum(minimum(cells_x, grid.last_row), 0.5)
    t = maximum(minimum(cells_y, grid.last_column), 0.5)
    row, column = floor(s + 0.5), floor(t + 0.5)
    a, b = s - row, t - column
    index = grid.first + (row - 1.0) * grid.columns + (column - 1.0)
    h_0, b_0, bb_0 = _across_row(heights, index, b)
    h_1, b_1, bb_1 = _across_row(heights, index + grid.columns, b)
    h_2, b_2, bb_2 = _across_row(heights, index + 2.0 * grid.columns, b)
    height, by_a, by_aa = _spline(h_0, h_1, h_2, a)
    by_b, by_ab, _ = _spline(b_0, b_1, b_2, a)
    by_bb, _, _ = _spline(bb_0, bb_1, bb_2, a)
    per_x = select(s == cells_x, grid.per_cell_x, 0.0)
    per_y = select(t == cells_y, grid.per_cell_y, 0.0)
    bends = by_aa * per_x * per_x, by_ab * per_x * per_y, by_bb * per_y * per_y
    return height, by_a * per_x, by_b * per_y, *bends


@inlined
def _across_row(heights: Table, index: Real, b: Real) -> tuple[Real, Real, Real]:
    before, here = gather(heights, index, 0), gather(heights, index, 1)
    return _spline(before, here, gather(heights, index, 2), b)


@inlined
def _spline(before: Real, here: Real, after: Real, part: Real) -> tuple[Real, Real, Real]:
    """Value of a quadratic B-spline and its derivatives per cell, first and second, from the values
    of three neighbouring control points. `part` (-1/2 to 1/2) is the distance from the control
    point `here`, in cells."""
    less, more, rise, next_rise = 0.5 - part, 0.5 + part, here - before, after - here
    # Each sum has one product, so there is only one way to round a product and a sum together.
    value = here - 0.5 * less * less * rise + 0.5 * more * more * next_rise
    return value, rise + more * (next_rise - rise), next_rise - rise


@compiled
def find_frames(
    nodes: Table, contacts: Table, grid: SurfaceGrid, heights: Table, frames: Table
) -> None:
    """Writes the frame of the ground below each contact node to the table `frames` (contacts,
    FRAME_COLUMNS): gap (m) between node and surface, normal and tangents.

    `contacts` (contacts,) are the indices of the nodes, `nodes` the table with their positions.
    `heights` (points,) are the heights (m) of the surface's control points. A node that is too high
    to touch the highest control point gets the frame of level ground at that height.
    """
    for i in range(contacts.size):
        put_frame(vector_at(nodes, contacts[i], P_WN), grid, heights, False, i, frames)


@inlined
def put_frame(
    place: Vector3, grid: SurfaceGrid, heights: Table, is_rolled: bool, i: int, frames: Table
) -> None:
    """Writes row i of `frames` for a node at `place` (m); see find_frames(). If the surface
    `is_rolled`, a node in the ground gets the frame at the nearest place of the surface."""
    x, y, z = place
    near = z <= grid.top + grid.reach
    height, h_x, h_y = grid.top, 0.0 * z, 0.0 * z
    c = n_z = 0.0 * z + 1.0
    if any_lane(near):
        if is_rolled:
            z_at, slope_x, slope_y = nearest_plane(x, y, z, grid, heights)
        else:
            z_at, slope_x, slope_y = surface(x, y, grid, heights)
        height = select(near, z_at, height)
        h_x, h_y = select(near, slope_x, h_x), select(near, slope_y, h_y)
        c = inverse_sqrt(1.0 + h_y * h_y)
        n_z = inverse_sqrt(1.0 + h_x * h_x + h_y * h_y)
    frames[i, GAP] = (z - height) * n_z  # exact on a plane
    put_vector((-h_x * n_z, -h_y * n_z, n_z), i, N_X, frames)
    frames[i, T1_X] = (1.0 + h_y * h_y) * c * n_z
    frames[i, T1_Y] = -h_x * h_y * c * n_z
    frames[i, T1_Z] = h_x * c * n_z
    frames[i, T2_Y] = c
    frames[i, T2_Z] = h_y * c


@inlined
def row_of(g: Table, i: int, base: Real) -> SurfaceGrid:
    """SurfaceGrid from row i of the table `g` (rows, fields). Its first height is counted from
    the index `base`."""
    place = g[i, 0], g[i, 1], g[i, 2], g[i, 3], g[i, 4], g[i, 5], g[i, 6]
    return SurfaceGrid(*place, g[i, 7] + base, g[i, 8], g[i, 9], g[i, 10])


@inlined
def nearest_plane(
    x: Real, y: Real, z: Real, grid: SurfaceGrid, heights: Table
) -> tuple[Real, Real, Real]:
    """Tangent plane at the place of the surface that is nearest to a point in the ground: its
    height (m) at x and y (m), and its gradient. Above the surface, the plane at x and y itself.

    Newton's method minimizes the squared distance. A step that does not lessen it is tried again
    at a quarter of its length, because the surface bends sharply in corners.
    """
    s, t, height, h_x, h_y = x, y, z, 0.0 * z, 0.0 * z
    to_s = to_t = 0.0 * z
    least = 0.0 * z + math.inf
    for _ in range(MOST_TRIALS):
        h, by_s, by_t, by_ss, by_st, by_tt = bent_surface(s + to_s, t + to_t, grid, heights)
        d_x, d_y, rise = s + to_s - x, t + to_t - y, maximum(h - z, 0.0)
        square = d_x * d_x + d_y * d_y + rise * rise
        nearer = square < least
        least = select(nearer, square, least)
        s, t = select(nearer, s + to_s, s), select(nearer, t + to_t, t)
        height, h_x = select(nearer, h, height), select(nearer, by_s, h_x)
        h_y = select(nearer, by_t, h_y)
        g_s, g_t = d_x + rise * by_s, d_y + rise * by_t
        ss, st, tt = 1.0 + by_s * by_s, by_s * by_t, 1.0 + by_t * by_t
        b_ss, b_st, b_tt = ss + rise * by_ss, st + rise * by_st, tt + rise * by_tt
        is_valley = (b_ss > 0.0) & (b_ss * b_tt > b_st * b_st)
        ss, st = select(is_valley, b_ss, ss), select(is_valley, b_st, st)
        tt = select(is_valley, b_tt, tt)
        per = 1.0 / (ss * tt - st * st)
        to_s = select(nearer, (st * g_t - tt * g_s) * per, 0.25 * to_s)
        to_t = select(nearer, (st * g_s - ss * g_t) * per, 0.25 * to_t)
        if not any_lane(abs(to_s) + abs(to_t) > NEAR * abs(height - z)):
            break
    return height + h_x * (x - s) + h_y * (y - t), h_x, h_y


@inlined
def to_frame(vector: Vector3, frames: Table, i: int, flat: bool) -> Vector3:
    """Components of a vector of the world frame along t1, t2 and n: tangents and normal of the
    ground in row i of `frames`. If the ground is `flat`, they are the world's axes, and `frames` is
    not used."""
    if flat:
        return vector
    x, y, z = vector
    return (
        x * frames[i, T1_X] + y * frames[i, T1_Y] + z * frames[i, T1_Z],
        y * frames[i, T2_Y] + z * frames[i, T2_Z],
        x * frames[i, N_X] + y * frames[i, N_Y] + z * frames[i, N_Z],
    )


@inlined
def to_world(t_1: Real, t_2: Real, n: Real, frames: Table, i: int, flat: bool) -> Vector3:
    """Vector in the world frame that has the given components along t1, t2 and n. These are
    tangents and normal of the ground in row i of `frames`. If the ground is `flat`, they are the
    world's axes, and `frames` is not used."""
    if flat:
        return t_1, t_2, n
    return (
        t_1 * frames[i, T1_X] + n * frames[i, N_X],
        t_1 * frames[i, T1_Y] + t_2 * frames[i, T2_Y] + n * frames[i, N_Y],
        t_1 * frames[i, T1_Z] + t_2 * frames[i, T2_Z] + n * frames[i, N_Z],
    )


def rolled_surface(
    grid: SurfaceGrid, heights: np.ndarray, radius: float
) -> tuple[SurfaceGrid, np.ndarray]:
    """Grid and heights (points,) in m of the surface that the centre of a ball with this radius (m)
    passes as it rolls over another surface, which has the `heights` (rows, columns) on `grid`.

    Its cells are an eighth of the radius or of a cell, whichever is larger; a 64th if the ground is
    the same everywhere along x or y. They are larger if there were more than MOST_ROLLED heights.
    """
    sizes = np.array([1.0 / grid.per_cell_x, 1.0 / grid.per_cell_y])
    varies = [np.ptp(heights, axis=axis).any() for axis in (0, 1)]
    parts = 8.0 if all(varies) else 64.0
    finest = max(radius, sizes.min()) / parts
    most = max(1.0, (MOST_ROLLED / heights.size) ** (0.5 if all(varies) else 1.0) // 1.0)
    n = np.where(varies, np.minimum(np.ceil(sizes / finest - 1e-9), most), 1.0)
    x, y = (
        low + size / parts * np.arange((rows - 1) * parts + 1)
        for low, size, parts, rows in zip(grid[:2], sizes, n, heights.shape, strict=True)
    )
    spacing = np.minimum(sizes / n, radius / parts) / (1.0 if all(varies) else 4.0)
    steps = [
        step * np.arange(-(radius // step), radius // step + 1.0) if bends else np.zeros(1)
        for step, bends in zip(spacing, varies, strict=True)
    ]
    u, v = (part.ravel() for part in np.meshgrid(*steps))
    ball = np.stack([u, v, radius**2 - u**2 - v**2], axis=-1)
    ball = ball[ball[:, 2] >= 0.0]
    ball[:, 2] **= 0.5
    if grid.is_stepped and radius > 2.0 * np.abs(np.diff(heights, axis=0)).max():
        copies = int(4.0 * n[0])
        heights = heights.repeat(copies, axis=0)  # sharp edges
        sharp = sizes / [copies, 1.0]
        corner = x[0] - 0.5 * (copies - 1) * sharp[0], y[0]
        grid = SurfaceGrid.of(Grid(heights, corner, (sharp[0], sharp[1])))
    rolled = np.empty((x.size, y.size))
    roll(x, y, ball, grid, np.ascontiguousarray(heights).ravel(), rolled)
    cell = sizes / n
    return SurfaceGrid.of(Grid(rolled, (x[0], y[0]), (cell[0], cell[1]))), rolled.ravel()


@compiled
def roll(x: Table, y: Table, ball: Table, grid: SurfaceGrid, heights: Table, rolled: Table) -> None:
    """Writes the heights `rolled` (rows, columns) in m of the centre of a ball that touches a
    surface from above, at x (rows,) and y (columns,). `ball` (points, 3) are points of the ball's
    lower half, from the centre, the last coordinate downward; all in m."""
    for row in range(x.size):
        for column in range(y.size):
            highest = -math.inf
            for k in range(len(ball)):
                place = x[row] + ball[k, 0], y[column] + ball[k, 1]
                highest = max(highest, surface(*place, grid, heights)[0] + ball[k, 2])
            rolled[row, column] = highest


# Settings: a section for each kind of terrain, which gives the heights.

BEHIND, AHEAD, ASIDE = 24.0 * INCH, 120.0 * INCH, 30.0 * INCH
"""Least reach of generated grids from the origin: backward, forward, sideways; in m."""
FAR = 1000.0
"""Reach of an incline, on which a robot may roll, in every direction; in m."""
HIGHEST = 1e6
"""Largest height (m). Larger numbers would leave too few digits for the robot's motion."""
MOST_CELLS = 4_000_000
STEEPEST = math.radians(60.0)


def fault_of_heights(heights: np.ndarray) -> str:
    """What is wrong with heights (rows, columns) in m, and what was expected; "" if nothing is."""
    if heights.ndim != 2 or min(heights.shape) < 3 or heights.size > MOST_CELLS:
        shape = " x ".join(map(str, heights.shape)) or "a single number"
        return f"{shape} heights, expected at least 3 x 3, at most {MOST_CELLS} in all"
    for row, column in np.argwhere(~(np.abs(heights) <= HIGHEST))[:1]:
        found = f"{heights[row, column]} in row {row + 1}, column {column + 1}"
        return f"{found}, expected heights of at most {HIGHEST:g} m"
    return ""


class Relief(Section):
    """Base class for the settings of terrain, which give the heights of the ground."""

    is_flat: ClassVar[bool] = False
    """True if h = 0 everywhere. The kernels are faster then."""
    is_ground: ClassVar[bool] = True
    """False if there is nothing that nodes could touch."""
    place: ClassVar[str] = "on uneven ground"
    """Words that say where a robot walks, unless the terrain is a slope; empty on level ground."""
    is_stepped: ClassVar[bool] = False
    """True if large balls meet sharp edges between unequal heights; see Steps."""

    @property
    def plane_slope(self) -> float | None:
        """Slope (rad) along +x, if the terrain is a plane through the origin; otherwise None."""
        return 0.0 if self.is_flat else None

    @property
    def where(self) -> str:
        """Words for where a robot walks, such as "up 5 degrees"; empty on level ground."""
        slope = self.plane_slope
        if not slope:
            return self.place
        return f"{'up' if slope > 0.0 else 'down'} {abs(math.degrees(slope)):.3g} degrees"

    @property
    def text(self) -> str:
        """Description of the terrain with its settings, such as "incline (slope 5 deg)"."""
        kind = type(self).__name__.lower() if self.is_ground else "no ground"
        return kind + settings_text(self)

    @property
    def paths(self) -> dict[str, str]:
        """Paths of the files that these settings name, by the names of the settings."""
        return {}

    def save(self, folder: Path) -> None:
        """Copies the terrain's files, if it has any, to the folder of a record."""

    def grid(self, *, ahead: float, scale: float, source: object) -> Grid:
        """Heights of the terrain on a grid.

        Steps and obstacles without a start begin at x = `ahead` (m). The generated area grows with
        the robot's `scale`, a ratio of sizes; see Blueprint.scale. Raises InputError, naming
        `source` (the scenario) and the key, for more than MOST_CELLS (4 million) cells.
        """
        raise NotImplementedError


class Flat(Relief):
    """Level ground at height 0, the default."""

    is_flat = True
    place = ""

    def grid(self, *, ahead: float, scale: float, source: object) -> Grid:
        aside = scale * ASIDE
        return Grid(np.zeros((3, 3)), (-aside, -aside), (aside, aside))


class Nothing(Flat):
    """No ground: nodes touch nothing. For structures that float or hang."""

    is_ground = False
    place = "without ground"


class Incline(Relief):
    """A plane that rises along +x: h = tan(slope) x. A negative slope goes down.

    The robot starts on the plane, tilted with it.
    """

    place = ""

    slope: Angle = Field(ge=-STEEPEST, le=STEEPEST)
    """Angle by which the ground rises along +x."""

    @property
    def plane_slope(self) -> float:
        return self.slope

    def grid(self, *, ahead: float, scale: float, source: object) -> Grid:
        cell = scale * FAR, scale * FAR  # three heights make a plane one cell wide
        x, y = _axes(cell, 0.0, scale)
        return Grid(math.tan(self.slope) * x, (x[0, 0], y[0, 0]), cell)


class Steps(Relief):
    """Stairs across the robot's path.

    h = height min(count, floor((x - start) / depth) + 1), and 0 before `start`. An edge rises over
    one cell of the grid before it and one behind it; a cell is about as long as a step is high, at
    most a quarter of the depth. Feet with a radius above twice the height meet sharp edges.
    """

    place = "over steps"
    is_stepped = True

    height: Length
    """Height of each step above the one before; negative goes down."""
    depth: Length = Field(gt=0)
    """Length of each step along x."""
    count: int = Field(ge=1)
    """Number of steps."""
    start: Length | None = None
    """Coordinate x of the first step; by default 1 in ahead of the robot."""

    def grid(self, *, ahead: float, scale: float, source: object) -> Grid:
        start = ahead if self.start is None else self.start
        quarter, height = 0.25 * self.depth, abs(self.height)
        key, finest = ("height", height) if 0.0 < height < quarter else ("depth", quarter)
        _check_size((finest, scale * ASIDE), scale, source, key)
        cell = self.depth / math.ceil(self.depth / finest), scale * ASIDE
        x, y = _axes(cell, start + 0.5 * cell[0], scale)  # edges midway between two heights
        risen = np.clip(np.floor((x - start) / self.depth) + 1.0, 0.0, self.count)
        return Grid(self.height * risen, (x[0, 0], y[0, 0]), cell)


class Rough(Relief):
    """Random ground, interpolated smoothly between the heights of a grid.

    Neighbours are half a wavelength apart. Heights are independent and uniform between -2 amplitude
    and 0, so a robot at z = 0 does not sink in.
    """

    place = "on rough ground"

    amplitude: Length = Field(ge=0)
    """Half the range of heights."""
    wavelength: Length = Field(gt=0)
    """Twice the distance between heights."""
    seed: int = Field(ge=0, default=0)
    """Seed of the random heights."""

    def grid(self, *, ahead: float, scale: float, source: object) -> Grid:
        half = 0.5 * self.wavelength
        _check_size((half, half), scale, source, "wavelength")
        x, y = _axes((half, half), 0.0, scale)
        generator = np.random.default_rng(self.seed)
        heights = generator.uniform(-2.0 * self.amplitude, 0.0, x.shape)
        return Grid(heights, (x[0, 0], y[0, 0]), (half, half))


class Obstacles(Relief):
    """Round bumps, h = height max(0, 1 - (r / radius)^2) at the distance r from a bump's centre.

    The highest counts. Each square of side `spacing` has one, at a random position. The ground is
    interpolated smoothly on a grid, so a bump's top is about an eighth lower.
    """

    place = "over obstacles"

    height: Length = Field(gt=0)
    """Height of a bump."""
    radius: Length = Field(gt=0)
    """Radius of a bump."""
    spacing: Length = Field(gt=0)
    """Side of a square."""
    seed: int = Field(ge=0, default=0)
    """Seed of the random positions."""
    start: Length | None = None
    """Coordinate x before which no bump reaches; by default 1 in ahead of the robot."""

    def grid(self, *, ahead: float, scale: float, source: object) -> Grid:
        cell, spacing = 0.5 * self.radius, self.spacing
        _check_size((cell, cell), scale, source, "radius")
        _check_size((spacing, spacing), scale, source, "spacing")
        x, y = _axes((cell, cell), 0.0, scale)
        start = ahead if self.start is None else self.start
        behind, far, aside = scale * BEHIND, scale * AHEAD, scale * ASIDE
        first = max(-behind, start + self.radius + 1.5 * cell)  # and its control points
        squares = np.arange(first, far, spacing), np.arange(-aside, aside, spacing)
        corners = np.stack(np.meshgrid(*squares, indexing="ij"), axis=-1).reshape(-1, 2)
        generator = np.random.default_rng(self.seed)
        centres = corners + spacing * generator.uniform(size=corners.shape)
        heights = np.zeros_like(x)
        nearest = np.rint((centres - (x[0, 0], y[0, 0])) / cell).astype(int)
        for offset in np.ndindex(5, 5):  # a bump is four cells wide
            at = nearest + offset - np.array([2, 2])
            inside = ((at >= 0) & (at < heights.shape)).all(axis=1)
            at, centre = tuple(at[inside].T), centres[inside]
            r_squared = (x[at] - centre[:, 0]) ** 2 + (y[at] - centre[:, 1]) ** 2
            np.maximum.at(heights, at, self.height * (1.0 - r_squared / self.radius**2))
        return Grid(heights, (x[0, 0], y[0, 0]), (cell, cell))


Terrain = Annotated[
    Flat | Nothing | Incline | Steps | Rough | Obstacles,
    Kinds(Relief, more=["tetra_drake.laws.height_field:HeightField"]),
]


def _check_size(cell: tuple[float, float], scale: float, source: object, key: str) -> None:
    """Raises InputError that names `source` (the scenario) and `key` if cells of this size (m)
    would be more than MOST_CELLS (4 million). The generated area grows with the robot's `scale`."""
    if MOST_CELLS * cell[0] * cell[1] < scale**2 * (BEHIND + AHEAD) * 2.0 * ASIDE:
        problem = f"is too small: cells of {min(cell):.3g} m would be more than {MOST_CELLS}"
        raise InputError(source, f"terrain.{key}", problem)


def _axes(cell: tuple[float, float], origin: float, scale: float) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates x and y (rows, columns) in m of a grid that covers the generated area, with a
    spare cell at each side. The area grows with the robot's `scale`. A row of points lies at x =
    `origin`."""
    first = math.floor((-scale * BEHIND - origin) / cell[0])
    last = math.ceil((scale * AHEAD - origin) / cell[0])
    aside = math.ceil(scale * ASIDE / cell[1]) + 1
    x = origin + cell[0] * np.arange(first - 1, last + 2)
    x, y = np.meshgrid(x, cell[1] * np.arange(-aside, aside + 1.0), indexing="ij")
    return x, y
