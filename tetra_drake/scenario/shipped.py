"""The scenarios and structures that come with the package or with plug-ins."""

from __future__ import annotations

from pathlib import Path

from tetra_drake.settings import plugins

SCENARIOS = Path(__file__).parent
STRUCTURES = SCENARIOS / "structures"


def shipped_scenarios() -> list[str]:
    """The names of the scenarios that come with the package."""
    return sorted(file.stem for file in SCENARIOS.glob("*.yaml"))


def shipped_structures() -> list[str]:
    """The names of the structures that come with the package."""
    return sorted(file.stem for file in STRUCTURES.glob("*.yaml"))


def structure_names() -> list[str]:
    """The names of the structures that come with the package or with plug-ins."""
    return sorted({*shipped_structures(), *plugins.entries(plugins.STRUCTURES)})


def named_structure(name: str) -> Path:
    """The file of a structure by one of the names in structure_names(). Raises InputError if a
    plug-in does not have the file."""
    if name in shipped_structures():
        return STRUCTURES / f"{name}.yaml"
    entry = plugins.entries(plugins.STRUCTURES)[name]
    file = Path(getattr(plugins.loaded(entry), "__file__", None) or "?").parent / f"{name}.yaml"
    if not file.is_file():
        raise plugins.refusal(entry, f"found no file {name}.yaml beside the module '{entry.value}'")
    return file
