"""Engines that simulate a gait on a scenario; all return a SimulationResult."""
