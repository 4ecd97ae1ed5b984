"""The interface of whatever shows a simulation while it runs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from tetra_drake.errors import InputError
from tetra_drake.scenario.schema import Scenario

if TYPE_CHECKING:
    import xarray


class Viewer(Protocol):
    """Someone who watches a simulation as it runs."""

    def wants(self, time: float) -> bool:
        """True if the viewer wants the state at this time (s)."""

    def show(self, frame: xarray.Dataset) -> None:
        """Takes one sample of a trajectory (see results.trajectory.make_dataset)."""


def check_can_be_watched(scenario: Scenario) -> None:
    """Raises InputError unless the scenario's engine is the diagram: others show nothing until they
    have ended."""
    engine = scenario.engine_name
    if engine != "drake":
        problem = f"found '{engine}', expected 'drake', which alone can be watched as it simulates"
        raise InputError(f"scenario {scenario.name}", "engine", problem)
