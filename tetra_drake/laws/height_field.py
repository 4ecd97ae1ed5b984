"""Terrain of heights from a file, which a digest of its content identifies."""

from __future__ import annotations

import hashlib
import io
import os
import re
import tokenize
import warnings
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field, PlainValidator

from tetra_drake.errors import InputError
from tetra_drake.files import read_bytes, write_whole
from tetra_drake.laws.terrain import Grid, Relief, fault_of_heights
from tetra_drake.settings.quantities import Length
from tetra_drake.settings.refusals import described, refuse

RECORDED = re.compile(r"heights-[0-9a-f]{16}\.npy")
"""Pattern of the names of files that save() writes."""


class HeightFile(str):
    """Heights of a terrain from a file. As a string it is the file's name in a record.

    The name contains a digest of the heights, so equal names mean equal heights. A scenario file
    gives the path of a height file instead.
    """

    heights: np.ndarray
    """Heights (rows, columns) in m."""
    path: str
    """Path of the file that was read."""

    @classmethod
    def read(cls, path: Any) -> HeightFile:
        """Reads the height file of a setting, which is its path; a HeightFile is returned as it is.

        Raises InputError for what is not a path, for a file without heights, for fewer than 3 x 3
        or more than 4 million heights, for heights above 1e6 m, and for a file of a record whose
        heights do not fit the digest in its name.
        """
        if isinstance(path, HeightFile):
            return path
        if not isinstance(path, str):
            refuse("", f"found {described(path)}, expected the path of a height file")
        heights = _read_heights(path)
        if fault := fault_of_heights(heights):
            refuse("", f"'{path}' has {fault}")
        digest = hashlib.sha256(f"{heights.shape}".encode() + heights.astype("<f8").tobytes())
        file = cls(f"heights-{digest.hexdigest()[:16]}.npy")
        if RECORDED.fullmatch(os.path.basename(path)) and os.path.basename(path) != file:
            refuse("", f"'{path}' was changed: by its content its name would be {file}")
        file.heights, file.path = heights, os.path.abspath(path)
        return file

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Writes the heights to a file in a folder. The file's name is this string."""
        content = io.BytesIO()
        np.lib.format.write_array(content, self.heights, version=(1, 0))
        write_whole(os.path.join(folder, self), content.getvalue())


HeightPath = Annotated[
    HeightFile,
    PlainValidator(HeightFile.read, json_schema_input_type=str),
    Field(json_schema_extra={"format": "file name"}),
]
"""Type of a setting that is a height file. A scenario file gives its path."""


def _read_heights(path: str) -> np.ndarray:
    """Content of a height file, as an array of floats in m. Raises InputError if it cannot be
    read."""
    try:
        content = read_bytes(path, "height file")
        if path.endswith(".npy"):
            heights = np.lib.format.read_array(io.BytesIO(content))
            return np.ascontiguousarray(heights.astype(float, casting="same_kind"))
        text = re.sub("#.*", "", content.decode("utf-8"))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of an empty file
            return np.loadtxt(text.splitlines(), delimiter="," if "," in text else None, ndmin=2)
    except InputError as error:
        refuse("", f"'{path}': {error.problem}")
    except (ValueError, TypeError, MemoryError, tokenize.TokenError) as error:
        # The file may be a private one, so the error shows a place of NumPy's error, never a text.
        places = re.findall(r" at row \d+(?:, column \d+)?", str(error))
        expected = "expected numbers, equally many in each row"
        refuse("", f"'{path}' cannot be read as heights{''.join(places[-1:])}: {expected}")


class HeightField(Relief):
    """Heights in m from a file: numpy's `.npy`, or text of numbers separated by blanks or commas.

    Rows are along x, columns along y, ascending; the grid's centre is the origin. There are at
    least 3 x 3 and at most 4 million heights. A relative path starts in the folder of the scenario
    file. A record keeps a copy, named by a digest of the heights.
    """

    file: HeightPath
    """File of heights in m."""
    cell: Length = Field(gt=0)
    """Distance between neighbours, along x and y."""

    def grid(self, *, ahead: float, scale: float, source: object) -> Grid:
        heights = self.file.heights
        x, y = (-0.5 * (size - 1) * self.cell for size in heights.shape)
        return Grid(heights, (x, y), (self.cell, self.cell))

    @property
    def paths(self) -> dict[str, str]:
        return {"file": self.file.path}

    def save(self, folder: Path) -> None:
        """Copies the height file to the folder of a record, as heights-DIGEST.npy, named by a
        digest of the heights."""
        self.file.save(folder)
