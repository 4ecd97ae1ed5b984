"""States of robots that can be kept: as values, in files, and to go on from."""

from __future__ import annotations

import dataclasses
import hashlib
import io
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np

from tetra_drake import __version__
from tetra_drake.errors import InputError
from tetra_drake.files import read_bytes, write_whole

MOST_BYTES_OF_STATES = 4 * 2**30
"""Largest size of a file of states."""


@dataclass(frozen=True, eq=False)
class States:
    """States of N robots at an instant, from which simulations go on; see Simulation.save().

        >>> simulation = td.Simulation(td.load_scenario("coulomb"), count=2)
        >>> readings = simulation.step(simulation.rest)
        >>> states = simulation.save()
        >>> states.save_npz("states.npz")
        >>> td.States.load("states.npz") == states
        True
        >>> readings = simulation.restore(states[0], [1])

    They are values: they can be compared with ==, pickled, and written to a file. An index selects
    robots: an integer, a list or a slice. Do not change the numbers.
    """

    scenario: str
    """Name of the scenario."""
    identity: str
    """Digest of the scenario's values. Another scenario of the same name has another one."""
    robots: tuple[str, ...]
    """Identity of each robot: the seed of its disturbances, and its damage, as JSON."""
    tables: Mapping[str, np.ndarray]
    """Numbers of the states by name; the first axis is the robots."""
    record: bool | None = None
    """True or False for states with their motion so far: whether the trajectory was recorded. None
    for states without it."""
    version: str = __version__
    """Version of the package that made them."""

    def __len__(self) -> int:
        return len(self.robots)

    def __getitem__(self, which: int | slice | list[int] | np.ndarray) -> Self:
        rows = np.atleast_1d(np.arange(len(self))[which])
        robots = tuple(self.robots[row] for row in rows)
        tables = {name: table[rows] for name, table in self.tables.items()}
        return dataclasses.replace(self, robots=robots, tables=tables)

    def __eq__(self, other: object) -> bool:
        return self.digest == other.digest if isinstance(other, States) else NotImplemented

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return f"<States of {len(self)} robots on scenario {self.scenario}>"

    @property
    def time(self) -> np.ndarray:
        """Simulated time (N,) in s."""
        return self.tables["readings.time"]

    @property
    def digest(self) -> str:
        """Digest of all values, the same for equal states only."""
        digest = hashlib.sha256(json.dumps(self._about).encode())
        for name, table in sorted(self.tables.items()):
            digest.update(f"{name} {table.dtype.str} {table.shape}".encode())
            digest.update(table.tobytes())
        return digest.hexdigest()

    @property
    def _about(self) -> dict[str, Any]:
        own = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        return {name: value for name, value in own.items() if name != "tables"}

    def save_npz(self, path: str | Path) -> None:
        """Writes the states to a file in NumPy's format npz. Raises InputError if it cannot be
        written."""
        about = np.array(json.dumps(self._about | {"digest": self.digest}))
        buffer = io.BytesIO()
        np.savez(buffer, about=about, **self.tables)  # type: ignore[arg-type]
        write_whole(path, buffer.getvalue())

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """The states in a file that save_npz() wrote. Raises InputError if the file is damaged or
        from another version."""
        content = read_bytes(path, "file of states", most=MOST_BYTES_OF_STATES)
        try:
            with np.load(io.BytesIO(content), allow_pickle=False) as file:
                tables = {name: file[name] for name in file.files}
            about = json.loads(str(tables.pop("about")))
            digest, robots = about.pop("digest"), tuple(about.pop("robots"))
            states = cls(**about, robots=robots, tables=tables)
        except Exception as error:  # damage can show in any step
            problem = f"is damaged, or no file of states: {type(error).__name__}: {error}"
            raise InputError(path, "", problem) from error
        states.check_version(path)
        if states.digest != digest:
            raise InputError(path, "", "is damaged: its digest differs")
        return states

    def check_version(self, source: object) -> None:
        """Raises InputError, which names `source`, if another version has made the states."""
        if self.version != __version__:
            problem = f"found states of tetra_drake {self.version}, expected {__version__}"
            raise InputError(source, "version", problem)
