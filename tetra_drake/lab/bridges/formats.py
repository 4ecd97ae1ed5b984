"""Formats of files: scenario, structure, or structure of other software."""

from __future__ import annotations

import os
from pathlib import Path

from tetra_drake.files import write_whole
from tetra_drake.scenario.robot_structure import StructureFile
from tetra_drake.scenario.shipped import shipped_scenarios, structure_names
from tetra_drake.scenario.structure_files import KEYS_OF_NTRT, XML_SUFFIXES
from tetra_drake.scenario.yaml_text import dump_yaml, read_mapping
from tetra_drake.settings.section import written

SCENARIO_KEYS = {"base", "robot"}
"""Keys that distinguish the files: each scenario file has one of them, and no structure file has
any."""


def format_of(name_or_file: str | Path) -> str:
    """Format of a file, or of the file that a name means: "scenario", "structure", or the software
    that has the format, "MuJoCo" or "NTRT". A name that a scenario and a structure share means the
    structure; "structure" if there is no such file. Raises InputError if the file cannot be read.
    """
    name = str(name_or_file)
    if Path(name).suffix.lower() in XML_SUFFIXES:
        return "MuJoCo"
    if name in structure_names():
        return "structure"
    if name in shipped_scenarios():
        return "scenario"
    keys = [*StructureFile.model_fields, *SCENARIO_KEYS, *KEYS_OF_NTRT]
    is_file = os.path.isfile(name)
    content = read_mapping(Path(name), "structure file", keys=keys) if is_file else {}
    if not KEYS_OF_NTRT.isdisjoint(content):
        return "NTRT"
    return "structure" if SCENARIO_KEYS.isdisjoint(content) else "scenario"


def save_structure(structure: StructureFile, path: Path, *, source: str) -> None:
    """Writes a structure file with all digits. Its first line names the `source` of the structure.
    Raises InputError if the file cannot be written."""
    text = dump_yaml({"format": 1} | written(structure.model_dump(exclude_defaults=True)))
    name = " ".join(Path(source).name.split())
    write_whole(path, f"# Converted from {name} by tetra-drake.\n{text}")
