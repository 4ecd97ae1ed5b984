"""The scenarios and structures that come with the package."""

from __future__ import annotations

from pathlib import Path

SCENARIOS = Path(__file__).parent
STRUCTURES = SCENARIOS / "structures"


def shipped_scenarios() -> list[str]:
    """The names of the scenarios that come with the package."""
    return sorted(file.stem for file in SCENARIOS.glob("*.yaml"))


def shipped_structures() -> list[str]:
    """The names of the structures that come with the package."""
    return sorted(file.stem for file in STRUCTURES.glob("*.yaml"))
