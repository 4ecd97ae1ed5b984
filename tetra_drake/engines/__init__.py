"""Engines: each simulates gaits on scenarios and returns a SimulationResult."""
