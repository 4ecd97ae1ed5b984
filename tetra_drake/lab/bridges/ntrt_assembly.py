"""Assembly of the files of NTRT: a file with its substructures, as TensegrityModel makes it."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tetra_drake.errors import InputError
from tetra_drake.lab.bridges.ntrt_file import Builder, NtrtFile, Substructure
from tetra_drake.scenario.robot_structure import MOST_NODES, MOST_PAIRS, Pair
from tetra_drake.scenario.yaml_text import read_mapping
from tetra_drake.settings.refusals import hint
from tetra_drake.settings.units import LARGEST

MOST_PARTS = MOST_NODES // 2
"""Largest number of substructures, including nested ones."""

LEAST_PAIRS = 3
"""Least number of pairs in a bond of nodes and edges: three points define a plane."""

Tags = frozenset[str]
Ends = tuple[str, str]
"""Names of two nodes."""


class Place(NamedTuple):
    """Where an entry stands in NTRT's files, for error messages: file and dotted key."""

    file: Path
    key: str


class Rule(NamedTuple):
    """Builder (class and parameters of parts), the tags that a pair or a node must have for it, and
    its entry in the files."""

    tags: Tags
    builder: Builder
    place: Place


class TaggedPair(NamedTuple):
    """Two nodes that a rod or cable may join, with the tags that choose its builder."""

    group: str
    """Key of the list that has the pair: tags, separated by single blanks."""
    tags: Tags
    part: str
    """Substructure that the pair belongs to, as the beginning of the names of its nodes."""
    place: Place
    nodes: Ends
    """Paths of the two nodes; before they are looked up, the names that the file gives."""


@dataclass
class Assembly:
    """A file together with its substructures, in NTRT's axes and unit of length."""

    nodes: dict[str, np.ndarray] = field(default_factory=dict)
    """Nodes by path, such as "SUBSTRUCTURE.NODE"."""
    places: dict[str, Place] = field(default_factory=dict)
    """File and key of each node."""
    pairs: list[TaggedPair] = field(default_factory=list)
    rules: list[Rule] = field(default_factory=list)
    """Builders in the order of reading. The last one that fits is used."""
    parts: list[str] = field(default_factory=list)
    """Substructures, each as the beginning of the names of its nodes, such as "SUBSTRUCTURE."; ""
    for the whole."""
    _read: dict[Path, NtrtFile] = field(default_factory=dict)
    """Content of the files that were read. Several substructures may share a file."""

    def add_file(self, file: Path, *, part: str = "", above: tuple[Path, ...] = ()) -> None:
        """Adds the content of a file to the structure, with its substructures.

        The names of its nodes get the prefix `part`, such as "SUBSTRUCTURE."; "" for the whole.
        `above` are the files that have this file as a substructure, at any depth. Raises InputError
        if the file is among them.
        """
        if file not in self._read:
            content = read_mapping(file, "structure file of NTRT", keys=NtrtFile.model_fields)
            self._read[file] = NtrtFile.from_tree(content, file)
        given = self._read[file]
        if file.resolve() in above:
            raise InputError(file, "substructures", "the structure contains itself")
        self.parts.append(part)
        _check_size(len(self.parts), MOST_PARTS, Place(file, "substructures"))
        self._add_parts(given.substructures, file, part, (*above, file.resolve()))
        for tags, builder in given.builders.items():
            place = Place(file, f"builders.{tags}")
            self.rules.append(Rule(frozenset(tags.split()), builder, place))
        self.nodes |= {part + name: np.array(p) for name, p in given.nodes.items()}
        self.places |= {part + name: Place(file, f"nodes.{name}") for name in given.nodes}
        _check_size(len(self.nodes), MOST_NODES, Place(file, "nodes"))
        for tags, pairs in given.pair_groups.items():
            listed = _listed(pairs, tags, part, Place(file, f"pair_groups.{tags}"))
            self._add_pairs(listed, (part, part))
        for outer, groups in given.bond_groups.items():
            for inner, pairs in groups.items():
                bond, tags = (outer, inner) if "/" in outer else (inner, outer)
                place = Place(file, f"bond_groups.{outer}.{inner}")
                self._add_bond(bond, _listed(pairs, tags, part, place), part, place)

    def rule(self, pair: TaggedPair, kind: str) -> Rule | None:
        """Last builder of a kind (struts, cables or spheres) whose tags a pair has; None if there
        is none. The tags of the pair's substructure count as tags of the pair."""
        tags = pair.tags | _tags_of(pair.part)
        fitting = (one for one in reversed(self.rules) if one.tags <= tags)
        return next((one for one in fitting if one.builder.kind == kind), None)

    def _add_parts(
        self, given: dict[str, Substructure], file: Path, part: str, above: tuple[Path, ...]
    ) -> None:
        """Adds the substructures `given` in a file, then rotates all of them, then scales and moves
        them. `part` is the prefix of the file's nodes; `above` are this file and the files that
        contain it."""
        entries: list[tuple[str, int, Substructure, Place]] = []
        for names, entry in given.items():
            place = Place(file, f"substructures.{names}")
            entries += [(name, i, entry, place) for i, name in enumerate(names.split("/"))]
        for name, _, entry, place in entries:
            if entry.path is not None:
                if f"{part}{name}." in self.parts:
                    raise InputError(*place, f"found a second path of '{name}', expected one")
                self.add_file(file.parent / entry.path, part=f"{part}{name}.", above=above)
        for name, _, entry, place in entries:
            if (rotation := entry.rotation) is not None:
                from scipy.spatial import transform

                start, axis = self._part(part, name, place), np.array(rotation.axis)
                if not axis.any():
                    problem = "found a vector of length 0, expected a direction"
                    raise InputError(file, f"{place.key}.rotation.axis", problem)
                axis /= np.abs(axis).max()  # its square must not be 0
                vector = rotation.angle * axis / np.linalg.norm(axis)
                turn = transform.Rotation.from_rotvec(vector, degrees=True).as_matrix()
                self._move(start, place, turn, about=rotation.reference)
        for name, i, entry, place in entries:
            shift = i * np.array(entry.offset) + entry.translation
            self._move(self._part(part, name, place), place, entry.scale * np.eye(3), shift=shift)

    def _move(
        self, part: str, place: Place, matrix: np.ndarray, *, about: Any = None, shift: Any = 0.0
    ) -> None:
        """Rotates and scales a substructure's nodes, whose names begin with `part`, by a matrix
        (3, 3) about a point, by default their mean, and then adds `shift`. Raises InputError with
        `place` if they get too far away."""
        if names := [name for name in self.nodes if name.startswith(part)]:
            p = np.array([self.nodes[name] for name in names])
            centre = p.mean(axis=0) if about is None else np.array(about)
            p = centre + (p - centre) @ matrix.T + shift
            if not (farthest := np.abs(p).max()) <= LARGEST:
                problem = f"'{part[:-1]}' reaches {farthest:g}, expected at most {LARGEST:g}"
                raise InputError(*place, problem)
            self.nodes |= dict(zip(names, p, strict=True))

    def _part(self, part: str, tags: str, place: Place) -> str:
        """Substructure inside `part` whose name has all words of `tags`. If there are several, the
        least nested one. Raises InputError with `place` if there is none."""
        return _least_nested(self.parts, part, tags, place, f"no path of the part '{tags}'")

    def _node(self, part: str, path: str, place: Place) -> str:
        """Full name of the node inside the substructure `part` with a path such as PART.NODE. If
        there are several, the least nested one. Raises InputError with `place` if there is none."""
        *parts, tags = path.split(".")
        for one in parts:
            part = self._part(part, one, place)
        return _least_nested(self.nodes, part, tags, place, f"unknown node '{path}'")

    def _add_pairs(self, listed: list[TaggedPair], starts: Ends) -> None:
        """Adds pairs of nodes, whose names are looked up: the first node of each pair in the first
        substructure of `starts`, the second node in the second one."""
        for pair in listed:
            _check_size(len(self.pairs) + 1, MOST_PAIRS, pair.place)
            first, second = map(self._node, starts, pair.nodes, (pair.place, pair.place))
            self.pairs.append(pair._replace(nodes=(first, second)))

    def _add_bond(self, bond: str, listed: list[TaggedPair], part: str, place: Place) -> None:
        """Adds a bond, which joins substructures inside `part` by the pairs `listed`. For the bond
        "a/b/c/node_node", each pair joins a node of a to one of b, and one of b to one of c. For
        "node_edge", see _bond_edges()."""
        *names, kind = bond.split("/")
        _check_size(len(names), MOST_PARTS, place)
        if kind not in ("node_node", "node_edge") or len(names) < 2:
            expected = "expected parts and a kind, 'A/B/node_node' or 'A/B/node_edge'"
            raise InputError(*place, f"found the bond '{bond}', {expected}")
        for first, second in itertools.pairwise(names):
            starts = self._part(part, first, place), self._part(part, second, place)
            if kind == "node_edge":
                self._bond_edges(listed, starts, place)
            else:  # builders may ask for the names of both parts
                tags = frozenset(f"{first} {second} {first}/{second}".split())
                self._add_pairs([one._replace(tags=one.tags | tags) for one in listed], starts)

    def _bond_edges(self, listed: list[TaggedPair], starts: Ends, place: Place) -> None:
        """Bonds nodes of one substructure to the middles of edges NODE/NODE of another. `starts`
        are the two substructures, `listed` the pairs of node and edge.

        The second substructure is moved onto the first. Then the centres of their bonded points are
        equal, the planes of their first three points are equal, and their first points are in the
        same direction from the centre. Each cable along an edge becomes two cables, from its ends
        to the node. Cables between two bonded nodes are removed. Rods stay, but are refused as
        edges.
        """
        _check_size(len(self.pairs) + len(listed), MOST_PAIRS, place)
        bonds, middles = [], []
        for one in listed:
            ends = [
                [self._node(start, name, one.place) for name in end.split("/", 1)]
                for start, end in zip(starts, one.nodes, strict=True)
            ]
            if sorted(map(len, ends)) != [1, 2]:
                problem = f"found {[*one.nodes]}, expected a node and an edge NODE/NODE"
                raise InputError(*one.place, problem)
            (node,), edge = sorted(ends, key=len)
            bonds.append((node, edge, one))
            middles.append([np.mean([self.nodes[name] for name in end], axis=0) for end in ends])
        there, own = np.array(middles).reshape(-1, 2, 3).swapaxes(0, 1)
        centre = own.mean(axis=0)
        turn = _frame(there, place).T @ _frame(own, place)
        self._move(starts[1], place, turn, about=centre, shift=there.mean(axis=0) - centre)
        nodes = {node for node, _, _ in bonds}
        edges = {frozenset(edge): one.place for _, edge, one in bonds}
        for old in self.pairs.copy():
            joined = frozenset(old.nodes)
            if old.part.startswith(starts) and (joined in edges or joined <= nodes):
                if self.rule(old, "struts") is None:
                    self.pairs.remove(old)
                elif joined in edges:
                    problem = f"found the rod {'/'.join(old.nodes)}, expected an edge of cables"
                    raise InputError(*edges[joined], problem)
        for node, (first, second), one in bonds:
            self.pairs.append(one._replace(nodes=(first, node)))
            self.pairs.append(one._replace(nodes=(node, second)))


def _listed(pairs: list[Pair], tags: str, part: str, place: Place) -> list[TaggedPair]:
    """The pairs of a list in a file, with their tags, substructure `part` and place. `tags` is the
    list's key, tags with blanks between them; `place` is the list's file and key."""
    group, all_tags = " ".join(tags.split()), frozenset(tags.split())
    places = [place._replace(key=f"{place.key}[{number}]") for number in range(len(pairs))]
    return [
        TaggedPair(group, all_tags, part, one, (first, second))
        for (first, second), one in zip(pairs, places, strict=True)
    ]


def _check_size(count: int, most: int, place: Place) -> None:
    """Raises InputError with `place` if `count`, such as the number of nodes, is above `most`."""
    if count > most:
        problem = f"found more than {most} in the whole structure, expected at most as many"
        raise InputError(*place, problem)


def _least_nested(names: Iterable[str], part: str, tags: str, place: Place, what: str) -> str:
    """Name inside the substructure `part` that has all tags; of several, the least nested. `what`
    is for the error message."""
    inside = [name for name in names if name.startswith(part) and name != part]
    fitting = [name for name in inside if _tags_of(name).issuperset(tags.split())]
    if not fitting or not tags:
        close = hint(tags, [name.removeprefix(part).rstrip(".") for name in inside])
        raise InputError(*place, f"found {what}; {close}")
    return min(fitting, key=lambda name: name.count("."))


@functools.lru_cache(maxsize=4096)
def _tags_of(path: str) -> Tags:
    """Tags of a node or a substructure: the words in the last part of its path."""
    return frozenset(path.rstrip(".").rpartition(".")[2].split())


def _frame(p: np.ndarray, place: Place) -> Any:
    """Three orthogonal unit vectors, the rows of a (3, 3) array, which follow from points
    (points, 3). The first is normal to the plane of the first three points. The third is the
    direction from the mean of all points to the first, projected onto this plane. Raises InputError
    with `place` if they are not defined, such as for fewer than three points or for a line."""
    axes = np.zeros((3, 3))
    if len(p) >= LEAST_PAIRS:
        axes[0] = np.cross(p[1] - p[0], p[2] - p[0])
        axes[1] = np.cross(axes[0], p[0] - p.mean(axis=0))
        axes[2] = np.cross(axes[1], axes[0])
    sizes = np.linalg.norm(axes, axis=1, keepdims=True)
    if not sizes.all():
        raise InputError(*place, "the first three pairs form no triangle, expected one")
    return axes / sizes
