"""Reader of the YAML structures of NTRT, the NASA Tensegrity Robotics Toolkit.

NTRT has y up and masses in kg. It leaves the unit of length open, which forces (kg length/s^2) and
densities (kg/length^3) share. What only its motors and contacts use is left out, and so are bonds
of nodes with edges.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from pydantic import Field

from tetra_drake.errors import InputError
from tetra_drake.files import read_text
from tetra_drake.scenario.robot_kinds import MOST_NODES, Pair, Point
from tetra_drake.scenario.sections import Section, Tree, hint
from tetra_drake.scenario.yaml_text import parse_yaml

MOST_BYTES = 2**20
"""Upper limit of the size of a file."""

UNUSED = {
    *("friction", "roll_friction", "restitution"),
    *("history", "max_tension", "target_velocity", "min_actual_length", "min_rest_length"),
    *("rotation", "moveCablePointAToEdge", "moveCablePointBToEdge"),
    *("motor_friction", "motor_inertia", "back_drivable"),
}
"""Parameters of NTRT's builders that are allowed and not used."""


class Rotation(Section):
    """A rotation of a substructure about a point, the centre of its nodes if not given."""

    axis: Point
    angle: float
    """In degrees."""
    reference: Point | None = None


class Substructure(Section):
    """Another file as a part of a structure, or of several parts (a/b/c)."""

    path: str | None = None
    rotation: Rotation | None = None
    scale: float = Field(default=1.0, gt=0)
    offset: Point = Field(default=[0.0, 0.0, 0.0])
    """Displacement from each of several parts to the next."""
    translation: Point = Field(default=[0.0, 0.0, 0.0])


class Builder(Section):
    """Class and parameters of the pairs that have a tag."""

    made_as: Literal[
        "tgRodInfo",
        "tgBasicActuatorInfo",
        "tgBasicContactCableInfo",
        "tgKinematicActuatorInfo",
        "tgKinematicContactCableInfo",
    ] = Field(alias="class")
    parameters: dict[str, Any] = Field(default={})


class NtrtFile(Section):
    """Content of a file, in NTRT's axes and unit of length."""

    nodes: dict[str, Point] = Field(default={})
    pair_groups: dict[str, list[Pair]] = Field(default={})
    builders: dict[str, Builder] = Field(default={})
    substructures: dict[str, Substructure] = Field(default={})
    bond_groups: dict[str, dict[str, list[Pair]]] = Field(default={})
    """By tags and by bonds, in either order."""


class Rod(Section):
    """Parameters of rods, with NTRT's defaults."""

    radius: float = Field(default=0.5, gt=0)
    density: float = Field(default=1.0, gt=0)


class Cable(Section):
    """Parameters of cables, with NTRT's defaults."""

    stiffness: float = Field(default=1000.0, gt=0)
    damping: float = Field(default=10.0, ge=0)
    pretension: float = Field(default=0.0, ge=0)
    radius: float = 1.0
    """Of a motor's spool, which is not used."""


class Part(NamedTuple):
    """A structure with its substructures, in NTRT's axes and unit of length."""

    nodes: dict[str, np.ndarray]
    """The nodes of a substructure are named "SUBSTRUCTURE.NODE"."""
    pairs: dict[str, list[tuple[str, str]]]
    """Pairs of nodes by their tags, which blanks separate."""
    builders: dict[str, Rod | Cable]
    """By the tags that a pair must have."""

    @property
    def centre(self) -> np.ndarray:
        """Mean of the nodes."""
        return np.mean(list(self.nodes.values()), axis=0)

    def find_node(self, path: str, file: Path, key: str) -> str:
        """Full name of a node whose last parts are given: the least nested, then the first."""
        names = [name for name in self.nodes if f".{name}".endswith(f".{path}")]
        if not names:
            raise InputError(file, key, f"found unknown node '{path}'; {hint(path, self.nodes)}")
        return min(names, key=lambda name: name.count("."))


def ntrt_tree(file: str | Path, *, unit: float) -> Tree:
    """The tree of a structure file for a file of NTRT.

    unit: length of NTRT's unit in m. The axes z, x, y of NTRT are x (forward), y (left), z (up).
    A substructure's nodes are named "SUBSTRUCTURE/NODE", groups by their tags joined by slashes, as
    dots separate keys.
    Raises InputError that names file and key, for substructures too.
    """
    part = _read(Path(file), ())
    struts: Tree = {}
    cables: Tree = {}
    for tags, pairs in part.pairs.items():
        builder = _builder_of(tags, part.builders, file)
        name = _name("/".join(tags.split()))
        if isinstance(builder, Rod):
            group = struts.setdefault(name, {"pairs": []})
            group["diameter"] = f"{2.0 * builder.radius * unit!r} m"
            group["density"] = f"{builder.density / unit**3!r} kg/m^3"
            group["node_diameter"] = "0 m"
        else:
            group = cables.setdefault(name, {"pairs": []})
            group["stiffness"] = f"{builder.stiffness!r} N/m"
            group["damping"] = f"{builder.damping!r} N*s/m"
            group["tension"] = f"{builder.pretension * unit!r} N"
        group["pairs"] += [[_name(node) for node in pair] for pair in pairs]
    nodes = {}
    for node, p in part.nodes.items():
        nodes[_name(node)] = [f"{x!r} m" for x in (unit * p[[2, 0, 1]]).tolist()]
    return {"nodes": nodes, "struts": struts, "cables": cables}


def _name(path: str) -> str:
    """A name or path of NTRT as a name of a structure file."""
    return path.replace(".", "/")


def _read(file: Path, above: tuple[Path, ...]) -> Part:
    """The structure of a file that the files `above` contain."""
    if file.resolve() in above:
        raise InputError(file, "substructures", "the structure contains itself")
    content = read_text(file, "structure file of NTRT", most=MOST_BYTES)
    given = NtrtFile.from_tree(parse_yaml(content, file), file)
    parts = _read_substructures(given.substructures, file, (*above, file.resolve()))
    whole = Part({node: np.array(p) for node, p in given.nodes.items()}, {}, {})
    for name, part in parts.items():
        whole.nodes.update({f"{name}.{node}": p for node, p in part.nodes.items()})
        whole.builders.update(part.builders)
        for tags, pairs in part.pairs.items():
            named = [(f"{name}.{first}", f"{name}.{second}") for first, second in pairs]
            whole.pairs.setdefault(tags, []).extend(named)
    if not 1 <= len(whole.nodes) <= MOST_NODES:
        found = f"found {len(whole.nodes)} nodes, substructures included"
        raise InputError(file, "nodes", f"{found}, expected 1 to {MOST_NODES}")
    for tags, builder in given.builders.items():
        kind = Rod if builder.made_as == "tgRodInfo" else Cable
        used = {name: x for name, x in builder.parameters.items() if name not in UNUSED}
        key = f"builders.{tags}.parameters"
        whole.builders[tags] = kind.from_tree(used, file, key=key)
    for tags, group in given.pair_groups.items():
        for place, pair in enumerate(group):
            key = f"pair_groups.{tags}[{place}]"
            first, second = (whole.find_node(path, file, key) for path in pair)
            whole.pairs.setdefault(tags, []).append((first, second))
    for outer, groups in given.bond_groups.items():
        for inner, group in groups.items():
            bond, tags = (outer, inner) if "/" in outer else (inner, outer)
            key = f"bond_groups.{outer}.{inner}"
            whole.pairs.setdefault(tags, []).extend(_bonded_pairs(bond, group, parts, file, key))
    return whole


def _read_substructures(
    given: Mapping[str, Substructure], file: Path, above: tuple[Path, ...]
) -> dict[str, Part]:
    """The substructures in their places: first all are turned, then scaled, then moved."""
    parts: dict[str, Part] = {}
    for names, entry in given.items():
        if entry.path is None:
            continue
        for name in names.split("/"):
            if name in parts:
                raise InputError(file, f"substructures.{names}.path", f"'{name}' has one already")
            parts[name] = _read(file.parent / entry.path, above)
    for names, entry in given.items():
        for name in names.split("/"):
            if name not in parts:
                raise InputError(file, f"substructures.{names}", f"'{name}' has no path")
            if entry.rotation is not None:
                _turn(parts[name], entry.rotation, file, f"substructures.{names}.rotation")
    for names, entry in given.items():
        for place, name in enumerate(names.split("/")):
            part, centre = parts[name], parts[name].centre
            shift = place * np.array(entry.offset) + entry.translation
            for node, p in part.nodes.items():
                part.nodes[node] = centre + entry.scale * (p - centre) + shift
    return parts


def _turn(part: Part, rotation: Rotation, file: Path, key: str) -> None:
    """Turns a part in place, by Rodrigues' formula."""
    if not any(rotation.axis):
        raise InputError(file, f"{key}.axis", "found an axis of length 0, expected a direction")
    axis = np.array(rotation.axis) / np.linalg.norm(rotation.axis)
    angle = math.radians(rotation.angle)
    about = part.centre if rotation.reference is None else np.array(rotation.reference)
    for node, p in part.nodes.items():
        r = p - about
        along = np.dot(axis, r) * axis
        across = r - along
        turned = math.cos(angle) * across + math.sin(angle) * np.cross(axis, across)
        part.nodes[node] = about + along + turned


def _bonded_pairs(
    bond: str, pairs: list[Pair], parts: Mapping[str, Part], file: Path, key: str
) -> list[tuple[str, str]]:
    """Pairs between neighbours of a row of substructures, as in "a/b/c/node_node"."""
    *names, kind = bond.split("/")
    if kind != "node_node" or len(names) < 2:
        raise InputError(file, key, f"found the bond '{bond}', expected 'A/B/node_node'")
    for name in names:
        if name not in parts:
            raise InputError(file, key, f"found unknown '{name}'; {hint(name, parts)}")
    bonded = []
    for first, second in itertools.pairwise(names):
        for place, pair in enumerate(pairs):
            start = parts[first].find_node(pair[0], file, f"{key}[{place}]")
            end = parts[second].find_node(pair[1], file, f"{key}[{place}]")
            bonded.append((f"{first}.{start}", f"{second}.{end}"))
    return bonded


def _builder_of(tags: str, builders: Mapping[str, Rod | Cable], file: str | Path) -> Rod | Cable:
    """The builder all of whose tags a pair has; NTRT's defaults for `rod` and `string`."""
    words = set(tags.split())
    fitting = [name for name in builders if set(name.split()) <= words]
    if len(fitting) > 1:
        problem = f"found the builders {' and '.join(fitting)} for '{tags}', expected one"
        raise InputError(file, "builders", problem)
    if fitting:
        return builders[fitting[0]]
    if "rod" in words:
        return Rod()
    if "string" in words:
        return Cable()
    raise InputError(file, "builders", f"found none for '{tags}'; {hint(tags, builders)}")
