"""Formats of files: scenario, structure, or structure of other software."""

from __future__ import annotations

import os
from pathlib import Path

from tetra_drake.files import write_whole
from tetra_drake.scenario.robot_structure import StructureFile
from tetra_drake.scenario.shipped import shipped_scenarios, structure_names
from tetra_drake.scenario.structure_files import KEYS_OF_NTRT, XML_SUFFIXES
from tetra_drake.scenario.yaml_text import dump_yaml, read_mapping
from tetra_drake.settings.section import Tree, written

SCENARIO_KEYS = {"base", "robot"}
"""Keys that distinguish the files: each scenario file has one of them, and no structure file has
any."""


def names_scenario(name_or_file: str | Path) -> bool:
    """True if a name or a file means a scenario. A name that a scenario and a structure share means
    the structure."""
    name = str(name_or_file)
    if name in structure_names() or not os.path.isfile(name):
        return name in shipped_scenarios() and name not in structure_names()
    if Path(name).suffix.lower() in XML_SUFFIXES:
        return False
    return not SCENARIO_KEYS.isdisjoint(_read(Path(name)))


def foreign_format(name_or_file: str | Path) -> str:
    """Name of the software whose format a file has, "MuJoCo" or "NTRT"; empty for a structure, a
    scenario or no file. Raises InputError if the file cannot be read."""
    file = Path(name_or_file)
    if file.suffix.lower() in XML_SUFFIXES:
        return "MuJoCo"
    if str(file) in {*structure_names(), *shipped_scenarios()} or not os.path.isfile(file):
        return ""
    return "" if KEYS_OF_NTRT.isdisjoint(_read(file)) else "NTRT"


def save_structure(structure: StructureFile, path: Path, *, source: str) -> None:
    """Writes a structure file with all digits. Its first line names the `source` of the structure.
    Raises InputError if the file cannot be written."""
    text = dump_yaml({"format": 1} | written(structure.model_dump(exclude_defaults=True)))
    name = " ".join(Path(source).name.split())
    write_whole(path, f"# Converted from {name} by tetra-drake.\n{text}")


def _read(file: Path) -> Tree:
    """Content of a YAML file that holds a structure, a scenario or a structure of NTRT. Raises
    InputError for any other content."""
    keys = [*StructureFile.model_fields, *SCENARIO_KEYS, *KEYS_OF_NTRT]
    return read_mapping(file, "structure file", keys=keys)
