"""Reader of the YAML structures of NTRT, the NASA Tensegrity Robotics Toolkit.

In NTRT y is up and masses are in kg. The unit of length is open; forces (kg length/s^2) and
densities (kg/length^3) depend on it. Structures begin anywhere, also below the ground: here the
lowest node is set on it. Settings of motors and contacts, and bonds of nodes with edges, are not
read.
"""

from __future__ import annotations

import itertools
import logging
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import pydantic
from pydantic import Field

from tetra_drake.errors import InputError
from tetra_drake.scenario.refusals import hint, refuse
from tetra_drake.scenario.robot_structure import (
    MOST_NODES,
    MOST_PAIRS,
    CableGroup,
    Pair,
    SphereGroup,
    StructureFile,
    StrutGroup,
)
from tetra_drake.scenario.section import Section, Tree, keys_of, written
from tetra_drake.scenario.units import LARGEST
from tetra_drake.scenario.yaml_text import read_mapping

MOST_BYTES = 2**20
"""Largest size of a file in bytes."""

MOST_PARTS = MOST_NODES // 2
"""Largest number of substructures, including nested ones."""

_LOG = logging.getLogger("tetra_drake")


Number = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Point = Annotated[list[Number], Field(min_length=3, max_length=3)]


class Rotation(Section):
    """A rotation of a substructure about a point, the centre of its nodes if not given."""

    axis: Point
    """A vector of any length but 0."""
    angle: Number
    """Angle in degrees."""
    reference: Point | None = None

    @pydantic.model_validator(mode="after")
    def _check(self) -> Rotation:
        if not any(self.axis):
            refuse("axis", "found a vector of length 0, expected a direction")
        return self


class Substructure(Section):
    """File that is one part of a structure, or several equal parts (a name such as a/b/c)."""

    path: str | None = None
    rotation: Rotation | None = None
    scale: float = Field(default=1.0, gt=0, le=LARGEST)
    offset: Point = Field(default=[0.0, 0.0, 0.0])
    """Displacement from each of several equal parts to the next."""
    translation: Point = Field(default=[0.0, 0.0, 0.0])


class Unused(Section):
    """Parameters of NTRT's builders that have no effect: the scenario has its own friction, ground
    and actuators."""

    friction: Any = None
    roll_friction: Any = None
    restitution: Any = None
    rotation: Any = None
    history: Any = None
    max_tension: Any = None
    target_velocity: Any = None
    min_actual_length: Any = None
    min_rest_length: Any = None
    motor_friction: Any = None
    motor_inertia: Any = None
    back_drivable: Any = None
    moveCablePointAToEdge: Any = None
    moveCablePointBToEdge: Any = None


class Parameters(Unused):
    """Parameters of a builder, with NTRT's defaults."""

    radius: float = Field(default=0.5, gt=0)
    """Radius of a rod or a sphere. For a cable, the radius of its spool, which is not used."""
    density: float = Field(default=1.0, gt=0)
    stiffness: float = Field(default=1000.0, gt=0)
    damping: float = Field(default=10.0, ge=0)
    pretension: float = Field(default=0.0, ge=0)


class Builder(Section):
    """Class and parameters for the pairs with a tag; of spheres, for the nodes with a name."""

    made_as: Literal[
        "tgRodInfo",
        "tgSphereInfo",
        "tgBasicActuatorInfo",
        "tgBasicContactCableInfo",
        "tgKinematicActuatorInfo",
        "tgKinematicContactCableInfo",
    ] = Field(alias="class")
    parameters: Parameters = Parameters()


DEFAULTS = {
    "rod": Builder.model_validate({"class": "tgRodInfo"}),
    "string": Builder.model_validate({"class": "tgBasicActuatorInfo"}),
    "sphere": Builder.model_validate({"class": "tgSphereInfo"}),
}
"""Builders by tag, for pairs and nodes without a builder in their file."""

SAME_PLACE = 1e-6
"""Distance below which a sphere is at a node of a pair."""


class NtrtFile(Section):
    """Content of a file, in NTRT's axes and unit of length."""

    nodes: dict[str, Point] = Field(default={})
    pair_groups: dict[str, list[Pair]] = Field(default={})
    """Lists of pairs of nodes. A key is the tags of its pairs, separated by blanks."""
    builders: dict[str, Builder] = Field(default={})
    """Builders. A key is the tags that a pair must have, separated by blanks."""
    substructures: dict[str, Substructure] = Field(default={})
    bond_groups: dict[str, dict[str, list[Pair]]] = Field(default={})
    """Lists of pairs of nodes, by their tags and the bond of two parts (outer key and inner key, in
    either order)."""


@dataclass
class Assembly:
    """A file together with its substructures, in NTRT's axes and unit of length."""

    nodes: dict[str, np.ndarray] = field(default_factory=dict)
    """Nodes by path, such as "SUBSTRUCTURE.NODE"."""
    pairs: dict[str, list[Pair]] = field(default_factory=dict)
    """Lists of pairs. A key is the tags of its pairs, separated by blanks."""
    builders: dict[str, Builder] = field(default_factory=dict)
    parts: int = 0
    """Number of added files, one for each substructure."""
    pair_count: int = 0
    _read: dict[Path, NtrtFile] = field(default_factory=dict)
    """Content of the files that were read. Several substructures may share a file."""

    def add_file(self, file: Path, *, prefix: str = "", above: tuple[Path, ...] = ()) -> None:
        """Adds a file. `above` are the files that contain it. The names of its nodes get a
        prefix."""
        given = self._content(file)
        if file.resolve() in above:
            raise InputError(file, "substructures", "the structure contains itself")
        self.parts += 1
        _check_size(self.parts, MOST_PARTS, file, "substructures")
        parts: dict[str, list[tuple[int, Substructure]]] = {}
        for joined, entry in given.substructures.items():
            for place, name in enumerate(joined.split("/")):
                parts.setdefault(name, []).append((place, entry))
        for name, entries in parts.items():
            paths = [entry.path for _, entry in entries if entry.path is not None]
            if len(paths) != 1:
                problem = f"found {len(paths)} paths of '{name}', expected one"
                raise InputError(file, "substructures", problem)
            start = f"{prefix}{name}."
            self.add_file(file.parent / paths[0], prefix=start, above=(*above, file.resolve()))
            self._place(start, entries, file)
        self.nodes |= {prefix + name: np.array(p) for name, p in given.nodes.items()}
        _check_size(len(self.nodes), MOST_NODES, file, "nodes")
        self.builders |= given.builders
        for tags, pairs in given.pair_groups.items():
            self._add_pairs(tags, pairs, (prefix, prefix), file, f"pair_groups.{tags}")
        for outer, groups in given.bond_groups.items():
            for inner, pairs in groups.items():
                bond, tags = (outer, inner) if "/" in outer else (inner, outer)
                key = f"bond_groups.{outer}.{inner}"
                for first, second in _bonded_parts(bond, list(parts), file, key):
                    starts = f"{prefix}{first}.", f"{prefix}{second}."
                    self._add_pairs(tags, pairs, starts, file, key)

    def _content(self, file: Path) -> NtrtFile:
        if file not in self._read:
            keys, what = keys_of(NtrtFile), "structure file of NTRT"
            content = read_mapping(file, what, keys=keys, most=MOST_BYTES)
            self._read[file] = NtrtFile.from_tree(content, file)
        return self._read[file]

    def _place(self, start: str, entries: list[tuple[int, Substructure]], file: Path) -> None:
        """Turns, then scales, then moves the nodes with names that begin with `start`. They are
        scaled about their centre."""
        names = [name for name in self.nodes if name.startswith(start)]
        if not names:
            return
        p = np.array([self.nodes[name] for name in names])
        for _, entry in entries:
            if entry.rotation is not None:
                p = _turned(p, entry.rotation)
        for place, entry in entries:
            centre, shift = p.mean(axis=0), place * np.array(entry.offset) + entry.translation
            p = centre + entry.scale * (p - centre) + shift
        if (farthest := np.abs(p).max()) > LARGEST:
            problem = f"'{start[:-1]}' reaches {farthest:g}, expected at most {LARGEST:g}"
            raise InputError(file, "substructures", problem)
        self.nodes |= dict(zip(names, p, strict=True))

    def _add_pairs(
        self, tags: str, pairs: list[Pair], starts: tuple[str, str], file: Path, key: str
    ) -> None:
        """Adds pairs. `starts` are the beginnings of the names of first and second nodes. A path
        means a node whose name ends with it: the least nested one, then the first."""
        for place, pair in enumerate(pairs):
            self.pair_count += 1
            _check_size(self.pair_count, MOST_PAIRS, file, f"{key}[{place}]")
            nodes = []
            for start, path in zip(starts, pair, strict=True):
                inside = [name for name in self.nodes if name.startswith(start)]
                fitting = [name for name in inside if f".{name}".endswith(f".{path}")]
                if not fitting:
                    problem = f"found unknown node '{path}'; {hint(path, inside)}"
                    raise InputError(file, f"{key}[{place}]", problem)
                nodes.append(min(fitting, key=lambda name: name.count(".")))
            self.pairs.setdefault(" ".join(tags.split()), []).append(nodes)


def _check_size(count: int, most: int, file: Path, key: str) -> None:
    """Refuses a structure that has become too large."""
    if count > most:
        problem = f"found more than {most} in the whole structure, expected at most as many"
        raise InputError(file, key, problem)


def _bonded_parts(bond: str, parts: list[str], file: Path, key: str) -> Iterable[tuple[str, str]]:
    """Neighbours in a row of substructures, for a bond such as "a/b/c/node_node"."""
    *names, kind = bond.split("/")
    if kind == "node_edge":
        problem = f"found the bond '{bond}'; bonds between nodes and edges are not supported"
        raise InputError(file, key, problem)
    if kind != "node_node" or len(names) < 2 or not set(names) <= set(parts):
        expected = f"expected 'A/B/node_node' with A and B of {', '.join(parts)}"
        raise InputError(file, key, f"found the bond '{bond}', {expected}")
    return itertools.pairwise(names)


def _turned(p: np.ndarray, rotation: Rotation) -> np.ndarray:
    """Points (n, 3) with a rotation."""
    from scipy.spatial import transform

    about = p.mean(axis=0) if rotation.reference is None else np.array(rotation.reference)
    axis = np.array(rotation.axis) / np.abs(rotation.axis).max()  # its square must not be 0
    vector = rotation.angle * axis / np.linalg.norm(axis)
    return about + transform.Rotation.from_rotvec(vector, degrees=True).apply(p - about)


def ntrt_tree(file: Path, *, unit: float) -> Tree:
    """The tree of a structure file for a file of NTRT.

    unit: length of NTRT's unit in m. The axes z, x, y of NTRT are x (forward), y (left), z (up).
    The lowest node is at z = 0. A substructure's nodes are named "SUBSTRUCTURE/NODE", groups by
    their tags joined by slashes, as dots separate keys. Raises InputError that names file and key,
    for substructures too.
    """
    whole = Assembly()
    whole.add_file(file)
    ignored = _ignored(whole.builders)
    if ignored:
        names = ", ".join(ignored)
        _LOG.warning("%s: not used, as the scenario has its own: %s", file, names)
    structure = StructureFile.model_construct(
        nodes={}, struts={}, cables={}, spheres={}, ignored=ignored
    )
    _add_spheres(structure, whole, unit)
    ground = min((p_W[1] for p_W in whole.nodes.values()), default=0.0)
    for name, p_W in whole.nodes.items():
        forward, left, up = p_W[[2, 0, 1]]
        structure.nodes[_without_dots(name)] = [unit * forward, unit * left, unit * (up - ground)]
    for tags, pairs in whole.pairs.items():
        name = _without_dots(tags).replace(" ", "/")
        named_pairs = [[_without_dots(node) for node in pair] for pair in pairs]
        builder = _builder_of(tags, whole.builders, file)
        given = builder.parameters
        if builder.made_as == "tgRodInfo":
            structure.struts[name] = StrutGroup.model_construct(
                pairs=named_pairs,
                diameter=2.0 * given.radius * unit,
                density=given.density / unit**3,
                node_diameter=0.0,
            )
        else:
            structure.cables[name] = CableGroup.model_construct(
                pairs=named_pairs,
                stiffness=given.stiffness,
                damping=given.damping,
                tension=given.pretension * unit,
            )
    return Tree(written(structure.model_dump()))


def _ignored(builders: dict[str, Builder]) -> list[str] | None:
    """Names of unused parameters that the builders give, if any."""
    given = {name for builder in builders.values() for name in builder.parameters.model_fields_set}
    return [name for name in Unused.model_fields if name in given] or None


def _add_spheres(structure: StructureFile, whole: Assembly, unit: float) -> None:
    """Adds the spheres of nodes that are named as a builder of spheres. A sphere's node may be at
    the place of a node of a pair; then it is removed, as it is the same node."""
    used = {node for pairs in whole.pairs.values() for pair in pairs for node in pair}
    for tags, builder in (DEFAULTS | whole.builders).items():
        if builder.made_as != "tgSphereInfo":
            continue
        nodes = []
        for name in [name for name in whole.nodes if name.rpartition(".")[2] == tags]:
            place = whole.nodes[name]
            here = [one for one in used if np.abs(whole.nodes[one] - place).max() < SAME_PLACE]
            if name not in used and here:
                del whole.nodes[name]
            nodes.append(_without_dots(name if name in used or not here else here[0]))
        if nodes:
            structure.spheres[_without_dots(tags)] = SphereGroup.model_construct(
                nodes=nodes,
                diameter=2.0 * builder.parameters.radius * unit,
                density=builder.parameters.density / unit**3,
            )


def _without_dots(name: str) -> str:
    return name.replace(".", "/")


def _builder_of(tags: str, builders: dict[str, Builder], file: Path) -> Builder:
    """The builder for a pair with these tags: from the file, or NTRT's default."""
    for choice in (builders, DEFAULTS):
        of_pairs = [name for name, one in choice.items() if one.made_as != "tgSphereInfo"]
        fitting = [name for name in of_pairs if set(name.split()) <= set(tags.split())]
        if len(fitting) > 1:
            problem = f"found the builders {' and '.join(fitting)} for '{tags}', expected one"
            raise InputError(file, "builders", problem)
        if fitting:
            return choice[fitting[0]]
    raise InputError(file, "builders", f"found none for '{tags}'; {hint(tags, builders)}")
