"""Short walks, and settings at which the diagram and the compiled engine agree to micrometres."""

from tetra_drake.scenario.schema import Scenario

FINE = {
    "cpg.start_up": 0.0,
    "simulation.scheme": "runge_kutta3",
    "simulation.accuracy": 1e-6,
    "simulation.max_step": "1e-4 s",
    "simulation.mode_changes": "witness",
    "compiled.tolerance": "1e-8 m/s",
    "compiled.max_step": "3e-5 s",
    "compiled.look_ahead": "1e-8 s",
}
"""Settings at which both engines have converged, mode changes placed to 2e-8 s, for short walks
that are driven from the start."""


def shortly(scenario: Scenario, duration: float, **changes: object) -> Scenario:
    """A short simulation, driven from the start; `cpg__reach=1` changes cpg.reach."""
    times = {
        "simulation.duration": f"{duration} s",
        "simulation.steady_from": f"{0.5 * duration} s",
    }
    given = {key.replace("__", "."): value for key, value in changes.items()}
    return scenario.with_changes({**times, "cpg.start_up": 0.0, **given})
