"""simulate(): one gait on one scenario, by the engine that the scenario names."""

from __future__ import annotations

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
    if scenario.simulation.engine == "compiled":
        from tetra_drake.engines.compiled.engine import simulate_compiled

        return simulate_compiled(scenario=scenario, gait=gait, record=record, viewer=viewer)
    if scenario.simulation.engine == "mujoco":
        from tetra_drake.engines.mujoco import simulate_mujoco

        return simulate_mujoco(scenario=scenario, gait=gait, record=record, viewer=viewer)
    from tetra_drake.engines.drake import simulate_drake

    return simulate_drake(scenario=scenario, gait=gait, record=record, viewer=viewer)


def prepare(scenario: Scenario, *, say: Callable[[str], None] = lambda text: None) -> None:
    """Makes the scenario's engine ready, so that no simulation has to wait for its compilation.

    `say` is told if that takes longer than a moment.
    """
    if scenario.simulation.engine == "compiled":
        from tetra_drake.engines.compiled.engine import compile_engine

        compile_engine(scenario, say)
