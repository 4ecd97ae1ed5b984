"""Kinds of terrain, and the grid of heights of each kind.

The ground is the surface z = h(x, y) in the world: x forward, y left, z up. The robot starts around
the origin, T1's base at x = 0, and walks along +x. laws.terrain makes the surface from heights.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from tetra_drake.errors import InputError
from tetra_drake.scenario.height_files import HeightFile
from tetra_drake.settings.kind_text import settings_text
from tetra_drake.settings.quantities import Angle, Length
from tetra_drake.settings.section import Kinds, Section
from tetra_drake.settings.units import INCH

BEHIND, AHEAD, ASIDE = 24.0 * INCH, 120.0 * INCH, 30.0 * INCH
"""Least reach of generated grids from the origin: backward, forward, sideways; in m."""
FAR = 1000.0
"""Reach of an incline, on which a robot may roll, in every direction; in m."""
MOST_CELLS = 4_000_000
STEEPEST = math.radians(60.0)


@dataclass(frozen=True)
class Grid:
    """Heights on a regular grid: the control points of the surface."""

    heights: np.ndarray
    """Heights (rows, columns) in m. Rows are along x, columns along y."""
    corner: tuple[float, float]
    """Coordinates x and y of heights[0, 0], in m."""
    cell: tuple[float, float]
    """Distances between heights along x and y, in m."""


class Relief(Section):
    """Base class of the kinds of terrain."""

    is_flat: ClassVar[bool] = False
    """True if h = 0 everywhere. The kernels are faster then."""
    is_ground: ClassVar[bool] = True
    """False if there is nothing that nodes could touch."""
    uneven: ClassVar[str] = "on uneven ground"
    """Words for where a robot walks on this kind of uneven ground."""

    @property
    def plane_slope(self) -> float | None:
        """Slope (rad) along +x, if the terrain is a plane through the origin; otherwise None."""
        return None

    @property
    def where(self) -> str:
        """Words for where a robot walks, such as "up 5 degrees"; empty on level ground."""
        slope = self.plane_slope
        if slope is None:
            return self.uneven
        if slope == 0.0:
            return ""
        return f"{'up' if slope > 0.0 else 'down'} {abs(math.degrees(slope)):.3g} degrees"

    @property
    def text(self) -> str:
        """Description of the terrain, such as "incline (slope 5 deg)"."""
        return type(self).__name__.lower() + settings_text(self)

    @property
    def paths(self) -> dict[str, str]:
        """Paths of the files that settings name, by key."""
        return {}

    def save(self, folder: Path) -> None:
        """Writes the files of the terrain to the folder of a record, under new names."""

    def grid(self, *, ahead: float, scale: float, source: object) -> Grid:
        """The heights of the terrain.

        Steps and obstacles without a start begin at x = `ahead` (m). The generated area grows with
        the robot's `scale`; see Blueprint.scale. Raises InputError, naming `source` and the key,
        for more than MOST_CELLS cells.
        """
        raise NotImplementedError


class Flat(Relief):
    """h = 0 everywhere: the thesis's floor, and the default."""

    is_flat = True

    @property
    def plane_slope(self) -> float:
        return 0.0

    def grid(self, *, ahead: float, scale: float, source: object) -> Grid:
        aside = scale * ASIDE
        return Grid(np.zeros((3, 3)), (-aside, -aside), (aside, aside))


class Nothing(Flat):
    """No ground: nodes touch nothing. For structures that float or hang."""

    is_ground = False

    @property
    def where(self) -> str:
        return "without ground"

    @property
    def text(self) -> str:
        return "no ground"


class Incline(Relief):
    """A plane that rises along +x: h = tan(slope) x. A negative slope goes down.

    The robot starts on it, turned with it.
    """

    slope: Angle = Field(ge=-STEEPEST, le=STEEPEST)
    """Angle by which the ground rises along +x."""

    @property
    def plane_slope(self) -> float:
        return self.slope

    def grid(self, *, ahead: float, scale: float, source: object) -> Grid:
        cell = scale * FAR, scale * FAR  # three heights make a plane one cell wide
        x, y = _axes(cell, 0.0, scale)
        return _grid(x, y, math.tan(self.slope) * x, cell)


class Steps(Relief):
    """Stairs across the way: h = height min(count, floor((x - start) / depth) + 1) from `start` on.

    A step rises over a cell before and after its edge: the height of a step, or a quarter of its
    depth if that is less.
    """

    uneven = "over steps"

    height: Length
    """Height of each step above the one before; negative goes down."""
    depth: Length = Field(gt=0)
    """Length of each step along x."""
    count: int = Field(ge=1)
    """Number of steps."""
    start: Length | None = None
    """Coordinate x of the first step; 1 in ahead of the robot if not given."""

    def grid(self, *, ahead: float, scale: float, source: object) -> Grid:
        start = ahead if self.start is None else self.start
        quarter, height = 0.25 * self.depth, abs(self.height)
        key, finest = ("height", height) if 0.0 < height < quarter else ("depth", quarter)
        _check_size((finest, scale * ASIDE), scale, source, key)
        cell = self.depth / math.ceil(self.depth / finest), scale * ASIDE
        x, y = _axes(cell, start + 0.5 * cell[0], scale)  # edges midway between two heights
        risen = np.clip(np.floor((x - start) / self.depth) + 1.0, 0.0, self.count)
        return _grid(x, y, self.height * risen, cell)


class Rough(Relief):
    """Random ground. Heights half a wavelength apart are independent and uniform between -2
    amplitude and 0.

    The mean height is -amplitude. A robot that stands at z = 0 touches the ground without sinking
    in.
    """

    uneven = "on rough ground"

    amplitude: Length = Field(ge=0)
    """Half the range of heights."""
    wavelength: Length = Field(gt=0)
    """Twice the distance between heights."""
    seed: int = Field(ge=0, default=0)
    """Seed of the random heights. The same seed gives the same ground."""

    def grid(self, *, ahead: float, scale: float, source: object) -> Grid:
        half = 0.5 * self.wavelength
        _check_size((half, half), scale, source, "wavelength")
        x, y = _axes((half, half), 0.0, scale)
        generator = np.random.default_rng(self.seed)
        heights = generator.uniform(-2.0 * self.amplitude, 0.0, x.shape)
        return _grid(x, y, heights, (half, half))


class Obstacles(Relief):
    """Round bumps, h = height max(0, 1 - (r / radius)^2). Where bumps overlap, the highest counts.

    Each square of side `spacing` has one bump, at a random position. No bump reaches before
    `start`. The grid lowers a bump's top by about an eighth.
    """

    uneven = "over obstacles"

    height: Length = Field(gt=0)
    """Height of a bump."""
    radius: Length = Field(gt=0)
    """Radius of a bump."""
    spacing: Length = Field(gt=0)
    """Side of a square of the ground. Each square has one bump."""
    seed: int = Field(ge=0, default=0)
    """Seed of the random positions. The same seed gives the same ground."""
    start: Length | None = None
    """Coordinate x where bumps begin; 1 in ahead of the robot if not given."""

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
        return _grid(x, y, heights, (cell, cell))


class HeightField(Relief):
    """Heights in m from a file. Rows are along x and columns along y, in ascending order.

    The grid's centre is the origin. The file is numpy's `.npy`, or text of numbers separated by
    blanks or commas. It has at least 3 x 3 and at most 4 million heights. A relative path starts at
    the scenario file that names it. A record keeps a copy of the file, named by a digest of the
    heights.
    """

    file: HeightFile
    """File of heights in m."""
    cell: Length = Field(gt=0)
    """Distance between neighbours, along x and y."""

    @property
    def paths(self) -> dict[str, str]:
        return {"file": self.file.path}

    def save(self, folder: Path) -> None:
        self.file.save(folder)

    def grid(self, *, ahead: float, scale: float, source: object) -> Grid:
        heights = self.file.heights
        x, y = (-0.5 * (size - 1) * self.cell for size in heights.shape)
        return Grid(heights, (x, y), (self.cell, self.cell))


Terrain = Annotated[Flat | Nothing | Incline | Steps | Rough | Obstacles | HeightField, Kinds()]


def _check_size(cell: tuple[float, float], scale: float, source: object, key: str) -> None:
    """Raises InputError that names `key` if cells of this size are too many."""
    if MOST_CELLS * cell[0] * cell[1] < scale**2 * (BEHIND + AHEAD) * 2.0 * ASIDE:
        problem = f"is too small: cells of {min(cell):.3g} m would be more than {MOST_CELLS}"
        raise InputError(source, f"terrain.{key}", problem)


def _axes(cell: tuple[float, float], origin: float, scale: float) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates x and y (rows, columns) of a grid that covers the generated area, with a spare
    cell at each side. One x is `origin`."""
    first = math.floor((-scale * BEHIND - origin) / cell[0])
    last = math.ceil((scale * AHEAD - origin) / cell[0])
    aside = math.ceil(scale * ASIDE / cell[1]) + 1
    x = origin + cell[0] * np.arange(first - 1, last + 2)
    x, y = np.meshgrid(x, cell[1] * np.arange(-aside, aside + 1.0), indexing="ij")
    return x, y


def _grid(x: np.ndarray, y: np.ndarray, heights: np.ndarray, cell: tuple[float, float]) -> Grid:
    """Grid of heights (rows, columns) at the coordinates of _axes()."""
    return Grid(heights, (float(x[0, 0]), float(y[0, 0])), cell)
