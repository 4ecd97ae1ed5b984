"""Structure files: finding, reading, and merging with the settings of a scenario."""

from __future__ import annotations

import logging
import os
from pathlib import Path
from typing import Any

from tetra_drake.errors import InputError
from tetra_drake.scenario.changes import merged
from tetra_drake.scenario.robot_structure import StructureFile
from tetra_drake.scenario.shipped import named_structure, structure_names
from tetra_drake.scenario.structure_graph import members
from tetra_drake.scenario.yaml_text import read_mapping
from tetra_drake.settings.refusals import TAG, described, no_such
from tetra_drake.settings.section import Tree

_LOG = logging.getLogger("tetra_drake")
_KIND = StructureFile.tag

XML_SUFFIXES = (".xml", ".mjcf")
"""Suffixes of MuJoCo's files."""
KEYS_OF_NTRT = {"pair_groups", "builders", "substructures"}
"""Keys that occur only in files of NTRT."""


def read_structure(name_or_file: str | Path, *, unit: str | None = None) -> StructureFile:
    """Reads a structure: one of the package or of a plug-in by name, or a structure file by path.

    `unit`, such as "dm", is the unit of length of coordinates without a unit. Raises InputError
    that names file and key.
    """
    file = structure_file(str(name_or_file), Path())
    if not os.path.exists(file):
        problem = no_such("structure file", str(name_or_file), structure_names())
        raise InputError(name_or_file, "", problem)
    content = _content(file)
    return structure_of(content | ({"unit": unit} if unit else {}), file)


def structure_file(name: str, folder: Path) -> Path:
    """The file of a structure of the package or of a plug-in; for another name, the path relative
    to `folder`."""
    return named_structure(name) if name in structure_names() else folder / name


def with_structure(tree: Tree, source: object) -> Tree:
    """Replaces the key `robot.file` in the content of a scenario file by the content of the
    structure file.

    The file must be a valid structure. Keys beside `file` override its content; `actuated` is
    replaced as a whole. Content without `robot.file` stays as it is. Raises InputError that names
    file, or `source`, and key.
    """
    robot = tree.get("robot")
    if not isinstance(robot, dict) or robot.get(TAG, _KIND) != _KIND or "file" not in robot:
        return tree
    changes = {key: value for key, value in robot.items() if key not in (TAG, "file")}
    name = robot["file"]
    if not isinstance(name, str) or not os.path.exists(structure_file(name, Path())):
        problem = no_such("structure file", str(name), structure_names())
        raise InputError(source, "robot.file", f"{described(name)}: {problem}")
    file = structure_file(name, Path())
    content = _content(file)
    section = structure_of(content, file)
    return tree | {"robot": {TAG: _KIND} | merged(content, changes, "robot", section=section)}


def structure_of(content: Any, file: Path) -> StructureFile:
    """Structure from the parsed content of a file. A warning in the log names the nodes that
    nothing uses. Raises InputError that names `file` and key."""
    structure = StructureFile.from_tree(content, file)
    used = structure.blueprint()
    if unused := [node for node in structure.nodes if node not in used.node_names]:
        _LOG.warning("%s: nodes that nothing uses are left out: %s", file, ", ".join(unused))
    names = [cable.names[0] for cable in members("cables", structure.cables)]
    if inner := [name for name in names if name not in used.cable_names]:
        _LOG.warning("%s: cables within a rigid body are left out: %s", file, ", ".join(inner))
    return structure


def _content(file: Path) -> Tree:
    """Content of a structure file. Raises InputError for a file of other software."""
    if file.suffix.lower() in XML_SUFFIXES:
        raise _foreign(file, "MuJoCo")
    keys = [*StructureFile.model_fields, *KEYS_OF_NTRT]
    content = read_mapping(file, "structure file", keys=keys)
    if not KEYS_OF_NTRT.isdisjoint(content):
        raise _foreign(file, "NTRT", unit=" --unit dm")
    return content


def _foreign(file: Path, software: str, *, unit: str = "") -> InputError:
    """Error about a file of other software, with the command that converts it."""
    remedy = f"tetra-drake structure '{file}'{unit} --out structure.yaml"
    return InputError(file, "", f"is a file of {software}; convert it once: {remedy}")
