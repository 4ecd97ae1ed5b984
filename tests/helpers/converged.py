"""Short walks, and settings at which the diagram and the compiled engine agree to micrometres."""

from tetra_drake.scenario.engine_kinds import Compiled, Drake
from tetra_drake.scenario.scenario import Scenario

CONVERGED: dict[str, Drake | Compiled] = {
    "drake": Drake(scheme="runge_kutta3", accuracy=1e-6, max_step=1e-4, mode_changes="witness"),
    "compiled": Compiled(tolerance=1e-8, max_step=3e-5),
}
"""Engines that have converged, with mode changes placed to 2e-8 s, for short walks."""


def shortly(scenario: Scenario, duration: float, **changes: object) -> Scenario:
    """A short simulation, driven from the start; `cpg__reach=1` changes cpg.reach."""
    times = {"simulation.duration": f"{duration} s", "simulation.steady_from": f"{duration / 2} s"}
    given = {key.replace("__", "."): value for key, value in changes.items()}
    return scenario.with_changes({**times, "cpg.start_up": 0.0, **given})
