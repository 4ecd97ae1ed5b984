"""Reading of MJCF, MuJoCo's XML format, by MuJoCo's own compiler.

Files of earlier versions of MuJoCo are read, too, as far as the structure needs it: settings of
numerical methods that have been removed are left out, and global coordinates become local ones.

MuJoCo trusts its files: some hundred bytes can take hours or all memory, and paths lead anywhere.
So sizes and paths are checked before it reads them.
"""

from __future__ import annotations

import contextlib
import itertools
import math
import os
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from tetra_drake.errors import InputError
from tetra_drake.files import read_text
from tetra_drake.scenario.robot_structure import MOST_NODES
from tetra_drake.settings.refusals import hint

_LONGEST_REASON = 150
LARGEST_MJCF = 2**22
"""Largest size of a file in bytes."""

MOST_PARTS, MOST_CELLS = 10 * MOST_NODES, 4_000_000
"""Largest number of elements of bodies with all copies, and of cells of pictures and surfaces."""

_REMOVED = {"option": ["collision", "apirate"], "flag": ["sensornoise"]}
"""Attributes by elements that earlier versions of MuJoCo had."""
_PLACES = ("pos", "quat", "axisangle", "xyaxes", "zaxis", "euler")
"""Attributes that place a body."""
_FOLDERS = ("assetdir", "meshdir", "texturedir")
"""Attributes with the folders of files."""
_CELLS = ("nrow", "ncol", "width", "height", "nsample", "params", "params")
"""Attributes whose product is a number of cells. Some meshes have the square of a parameter."""


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
    has_size = root.find("size") is not None
    left_out = _modernise(root)
    try:
        _check_sizes(root, file)
        _check_paths(root, file)
        if not left_out and not has_size and not without:
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
                problem = "found a model to attach, expected one file, as mj_saveLastXML writes"
                raise InputError(file, "asset.model", problem)
            if child.tag == "include":
                path = folder / child.get("file", "")
                _check_path(path, file, folder)
                parent[place : place + 1] = _parsed(path, folder, seen)
    return root


def _check_sizes(root: ElementTree.Element, file: Path) -> None:
    """Raises InputError if MuJoCo would make too many parts or cells."""
    parts = sum(map(_parts, root.iter("worldbody")))
    cells = sum(math.prod(_sizes(element, *_CELLS)) for element in root.iter())
    for what, found, most in (("parts", parts, MOST_PARTS), ("cells", cells, MOST_CELLS)):
        if found > most:
            raise InputError(file, "", f"makes {found:.3g} {what}, expected at most {most:g}")


def _parts(element: ElementTree.Element) -> float:
    """Number of elements in an element, with all copies."""
    copies = math.prod(_sizes(element, "count"))
    return copies * (1.0 + sum(map(_parts, element)))


def _sizes(element: ElementTree.Element, *names: str) -> Iterator[float]:
    """Numbers above 1 in attributes. MuJoCo refuses what is no number."""
    for text in itertools.chain(*(element.get(name, "").split() for name in names)):
        with contextlib.suppress(ValueError):
            yield max(1.0, float(text))


def _check_paths(root: ElementTree.Element, file: Path) -> None:
    """Raises InputError if an attribute names a file that MuJoCo should not open."""
    folders = [
        "",
        *(text for one in root.iter("compiler") for text in map(one.get, _FOLDERS) if text),
    ]
    for element in root.iter():
        for name in element.attrib:
            if name.startswith("file"):
                for folder in folders:
                    _check_path(file.parent / folder / element.get(name, ""), file, file.parent)


def _check_path(path: Path, file: Path, folder: Path) -> None:
    """Raises InputError if a path in a file leads out of the `folder` and the working folder, or to
    a device or a pipe, which may never end."""
    try:
        place = path.resolve()
        homes = folder.resolve(), Path.cwd()
        is_odd = path.exists() and not path.is_file() and not path.is_dir()
    except (OSError, ValueError, RuntimeError) as error:
        raise InputError(file, "", f"names a file that cannot be read: {error}") from error
    if is_odd or not any(place.is_relative_to(home) for home in homes):
        problem = f"names '{path}', expected a regular file in its folder or in the working folder"
        raise InputError(file, "", problem)


def _modernise(root: ElementTree.Element) -> list[str]:
    """Removes what MuJoCo no longer knows, in place. Returns the names of the attributes.

    With global coordinates, the places of all parts are given in the frame of the world. This is
    the same as bodies that have this frame.
    """
    left_out: list[str] = []
    for size in root.iter("size"):  # of memory for what is no part of a structure
        size.attrib.clear()
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
