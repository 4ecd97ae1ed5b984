"""Reading of MJCF, MuJoCo's XML format, by MuJoCo's own compiler.

Files of earlier versions of MuJoCo are read, too, as far as the structure needs it: settings of
numerical methods that have been removed are left out, and global coordinates become local ones.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Collection
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from tetra_drake.errors import InputError
from tetra_drake.files import read_text
from tetra_drake.settings.refusals import hint

_LONGEST_REASON = 150
LARGEST_MJCF = 2**22
"""Largest size of a file in bytes."""

_REMOVED = {"option": ["collision", "apirate"], "flag": ["sensornoise"]}
"""Attributes by elements that earlier versions of MuJoCo had."""
_PLACES = ("pos", "quat", "axisangle", "xyaxes", "zaxis", "euler")
"""Attributes that place a body."""


def compiled_model(file: Path, *, without: Collection[str] = ()) -> tuple[Any, list[str]]:
    """MuJoCo's model (mjModel) of a file, `without` bodies of these names and all that refers to
    them, and the attributes that were left out.

    Raises InputError if the file is no MJCF, if MuJoCo refuses it, or if MuJoCo is missing.
    """
    root = _parsed(file, file.parent, set())
    try:
        import mujoco
    except ImportError as error:
        problem = "needs MuJoCo to be read: pip install 'tetra_drake[mujoco]'"
        raise InputError(file, "", problem) from error
    if mujoco.get_mju_user_warning() is None:  # it would write them to a file in the working folder
        mujoco.set_mju_user_warning(lambda message: None)
    left_out = _modernise(root)
    try:
        if not left_out and not without:
            return mujoco.MjModel.from_xml_path(str(file)), left_out
        spec = mujoco.MjSpec.from_string(ElementTree.tostring(root, encoding="unicode"))
        spec.modelfiledir = os.path.abspath(file.parent)
        for name in without:
            bodies = {body.name: body for body in spec.bodies[1:]}  # without those in deleted ones
            if name not in bodies:
                problem = f"found no body '{name}' to leave out; {hint(name, bodies)}"
                raise InputError(file, "without", problem)
            spec.delete(bodies[name])
        return spec.compile(), left_out
    except InputError:
        raise
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        reason = " ".join(str(error).split())[-_LONGEST_REASON:]  # ends with what was found
        raise InputError(file, "", f"mujoco refuses the file: {reason}") from error


def _parsed(file: Path, folder: Path, seen: set[Path]) -> ElementTree.Element:
    """Root element of a file, with the content of the files that it includes. Their paths are
    relative to `folder`. Raises InputError for one of the files `seen`, to which it is added."""
    if file in seen:
        raise InputError(file, "include", "found the file twice, expected it once")
    seen.add(file)
    text = read_text(file, "MJCF file", most=LARGEST_MJCF)
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise InputError(file, "", "declares a document type, expected XML without one")
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, RecursionError) as error:
        raise InputError(file, "", f"is not XML: {error}") from error
    for parent in [*root.iter()]:
        for place, child in reversed([*enumerate(parent)]):
            if child.tag == "model":  # MuJoCo reads a file that attaches itself for ever
                _parsed(folder / child.get("file", ""), folder, {*seen})
            if child.tag == "include":
                included = _parsed(folder / child.get("file", ""), folder, seen)
                parent[place : place + 1] = included
    return root


def _modernise(root: ElementTree.Element) -> list[str]:
    """Removes what MuJoCo no longer knows, in place. Returns the names of the attributes.

    With global coordinates, the places of all parts are given in the frame of the world. This is
    the same as bodies that have this frame.
    """
    left_out: list[str] = []
    removed = dict(_REMOVED)
    if any(compiler.get("coordinate") == "global" for compiler in root.iter("compiler")):
        removed["compiler"] = ["coordinate"]
        for body in root.iter("body"):
            for name in _PLACES:
                body.attrib.pop(name, None)
    for tag, names in removed.items():
        for element, name in itertools.product(root.iter(tag), names):
            if element.attrib.pop(name, None) is not None:
                left_out.append(f"{tag} {name}")
    return [*dict.fromkeys(left_out)]
