"""The interface of whatever shows a simulation while it runs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    import xarray


class Viewer(Protocol):
    """Someone who watches a simulation as it runs."""

    def wants(self, time: float) -> bool:
        """Whether to be shown the state at this time (s)."""

    def show(self, frame: xarray.Dataset) -> None:
        """Takes one sample of a trajectory (see results.trajectory.assemble_dataset)."""
