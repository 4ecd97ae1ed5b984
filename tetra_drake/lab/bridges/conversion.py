"""Conversion of files of MuJoCo and NTRT to structures."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from tetra_drake.errors import InputError
from tetra_drake.lab.bridges.formats import format_of
from tetra_drake.lab.bridges.mjcf import mjcf_tree
from tetra_drake.lab.bridges.ntrt import ntrt_tree
from tetra_drake.scenario.robot_structure import StructureFile
from tetra_drake.scenario.structure_files import structure_of
from tetra_drake.settings.units import given_quantity


def converted(
    file: Path, *, unit: str | None = None, without: Collection[str] = ()
) -> StructureFile:
    """Structure of an MJCF file, or of a file of NTRT (NASA Tensegrity Robotics Toolkit).

    Args:
        file: the file.
        unit: unit of length of a file of NTRT, such as "dm"; it has bare numbers.
        without: names of bodies of an MJCF file that are left out.

    Raises:
        InputError: names file and key.
    """
    if format_of(file) == "MuJoCo":
        if unit is not None:
            raise InputError(file, "unit", f"found {unit!r:.60}; files of MuJoCo are in m")
        return structure_of(mjcf_tree(file, without=without), file)
    if without:
        problem = f"found {', '.join(without)}, expected bodies of a file of MuJoCo"
        raise InputError(file, "without", problem)
    if unit is None:
        raise InputError(file, "unit", "is missing; give the unit of length, such as dm")
    return structure_of(ntrt_tree(file, unit=given_quantity(f"1 {unit}", "m", file, "unit")), file)
