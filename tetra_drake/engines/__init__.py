"""Engines that simulate a gait on a scenario; all return a SimulationResult."""

ENGINES = {
    "drake": "tetra_drake.engines.drake",
    "compiled": "tetra_drake.engines.compiled.engine",
    "mujoco": "tetra_drake.engines.mujoco",
}
"""Modules of the engines by name, each with its `ENGINE`; see engines.interface.

A name, in lower case, is that of the engine's kind in a scenario.
"""
