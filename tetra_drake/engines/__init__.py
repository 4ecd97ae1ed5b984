"""Engines: each simulates gaits on scenarios and returns a SimulationResult."""

ENGINES = {
    "drake": "tetra_drake.engines.drake",
    "compiled": "tetra_drake.engines.lanes.batch",
    "mujoco": "tetra_drake.engines.mujoco",
}
"""Module of each engine, by name. A module has an `ENGINE`; see engines.engine.

The name is the engine's kind in a scenario, in lower case.
"""
