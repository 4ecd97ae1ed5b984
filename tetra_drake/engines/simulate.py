"""simulate(): one gait on one scenario, by the engine that the scenario names."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

from tetra_drake.engines.viewer import Viewer
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.gait import Gait
from tetra_drake.scenario.schema import Scenario


def simulate(
    *, scenario: Scenario, gait: Gait, record: bool = False, viewer: Viewer | None = None
) -> SimulationResult:
    """Simulates the scenario's robot walking by a gait for the scenario's duration, on the
    engine that the scenario names.

    Pure: the same scenario and gait give the same numbers, bit for bit, wall time aside,
    whether or not a trajectory is recorded and whoever watches.

    Raises Diverged or StepBudgetExceeded, which say when and why.
    """
    if scenario.simulation.engine == "drake":
        from tetra_drake.engines.drake import simulate_drake

        return simulate_drake(scenario=scenario, gait=gait, record=record, viewer=viewer)
    if scenario.simulation.engine == "compiled":
        from tetra_drake.engines.compiled.engine import simulate_compiled as run
    else:
        from tetra_drake.engines.mujoco import simulate_mujoco as run
    result = run(scenario=scenario, gait=gait, record=record or viewer is not None)
    if viewer is None or result.trajectory is None:
        return result
    # These engines are too fast to be watched: the viewer is shown the recording.
    for i, time in enumerate(result.trajectory["time"].values):
        if viewer.wants(time):
            viewer.show(result.trajectory.isel(time=[i]))
    return result if record else dataclasses.replace(result, trajectory=None)


def prepare(scenario: Scenario, *, say: Callable[[str], None] = lambda text: None) -> None:
    """Compiles the scenario's engine, so that no simulation has to wait for that; `say` is told if
    it takes longer than a moment."""
    if scenario.simulation.engine == "compiled":
        from tetra_drake.engines.compiled.engine import compile_engine

        compile_engine(scenario, say)
