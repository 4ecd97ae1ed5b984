"""Assembly of the files of NTRT: a file with its substructures, as TensegrityModel makes it."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tetra_drake.errors import InputError
from tetra_drake.scenario.ntrt_file import Builder, NtrtFile, Rotation, Substructure
from tetra_drake.scenario.refusals import hint
from tetra_drake.scenario.robot_structure import MOST_NODES, MOST_PAIRS, Pair
from tetra_drake.scenario.section import keys_of
from tetra_drake.scenario.units import LARGEST
from tetra_drake.scenario.yaml_text import read_mapping

MOST_BYTES = 2**20
"""Largest size of a file in bytes."""

MOST_PARTS = MOST_NODES // 2
"""Largest number of substructures, including nested ones."""

LEAST_PAIRS = 3
"""Least number of pairs in a bond of nodes and edges."""

_NO_TURN = np.eye(3)

Tags = frozenset[str]
Ends = tuple[str, str]
"""Names of two nodes."""


class Place(NamedTuple):
    """Place in a file, for messages."""

    file: Path
    key: str


class Rule(NamedTuple):
    """Builder with the tags that a pair or a node must have."""

    tags: Tags
    builder: Builder
    place: Place


class TaggedPair(NamedTuple):
    """Pair of nodes."""

    group: str
    """Key of its list: tags, separated by single blanks."""
    tags: Tags
    part: str
    """Beginning of the names of nodes in the part that the pair belongs to."""
    nodes: Ends
    place: Place


@dataclass
class Assembly:
    """A file together with its substructures, in NTRT's axes and unit of length."""

    nodes: dict[str, np.ndarray] = field(default_factory=dict)
    """Nodes by path, such as "SUBSTRUCTURE.NODE"."""
    places: dict[str, Place] = field(default_factory=dict)
    """Places of the nodes."""
    pairs: list[TaggedPair] = field(default_factory=list)
    rules: list[Rule] = field(default_factory=list)
    """Builders in the order of reading. Later ones come first."""
    parts: list[str] = field(default_factory=list)
    """Beginnings of the names of nodes in each part, such as "SUBSTRUCTURE."; "" for the whole."""
    _read: dict[Path, NtrtFile] = field(default_factory=dict)
    """Content of the files that were read. Several substructures may share a file."""

    def add_file(self, file: Path, *, part: str = "", above: tuple[Path, ...] = ()) -> None:
        """Adds a file. `above` are the files that contain it. The names of its nodes begin with
        `part`."""
        given = self._content(file)
        if file.resolve() in above:
            raise InputError(file, "substructures", "the structure contains itself")
        self.parts.append(part)
        _check_size(len(self.parts), MOST_PARTS, Place(file, "substructures"))
        self._add_parts(given, file, part, (*above, file.resolve()))
        for tags, builder in given.builders.items():
            self.rules.append(Rule(_tags(tags), builder, Place(file, f"builders.{tags}")))
        self.nodes |= {part + name: np.array(p) for name, p in given.nodes.items()}
        self.places |= {part + name: Place(file, f"nodes.{name}") for name in given.nodes}
        _check_size(len(self.nodes), MOST_NODES, Place(file, "nodes"))
        for tags, pairs in given.pair_groups.items():
            for pair, place in _numbered(pairs, Place(file, f"pair_groups.{tags}")):
                nodes = self._node(part, pair[0], place), self._node(part, pair[1], place)
                self._add_pair(tags, part, nodes, place)
        for outer, groups in given.bond_groups.items():
            for inner, pairs in groups.items():
                bond, tags = (outer, inner) if "/" in outer else (inner, outer)
                self._add_bond(bond, tags, pairs, part, Place(file, f"bond_groups.{outer}.{inner}"))

    def rule(self, part: str, tags: Tags, kind: str) -> Rule | None:
        """The last rule of a kind for tags in a part, whose own tags count, too."""
        tags |= _tags(_last(part.removesuffix(".")))
        fitting = (one for one in reversed(self.rules) if one.tags <= tags)
        return next((one for one in fitting if one.builder.kind == kind), None)

    def _content(self, file: Path) -> NtrtFile:
        if file not in self._read:
            keys, what = keys_of(NtrtFile), "structure file of NTRT"
            content = read_mapping(file, what, keys=keys, most=MOST_BYTES)
            self._read[file] = NtrtFile.from_tree(content, file)
        return self._read[file]

    def _add_parts(self, given: NtrtFile, file: Path, part: str, above: tuple[Path, ...]) -> None:
        """Adds the substructures of a file, then turns all, then scales and moves them."""
        entries: list[tuple[str, int, Substructure, Place]] = []
        for names, entry in given.substructures.items():
            place = Place(file, f"substructures.{names}")
            entries += [(name, i, entry, place) for i, name in enumerate(names.split("/"))]
        for name, _, entry, place in entries:
            if entry.path is not None:
                if f"{part}{name}." in self.parts:
                    raise InputError(*place, f"found a second path of '{name}', expected one")
                self.add_file(file.parent / entry.path, part=f"{part}{name}.", above=above)
        for name, _, entry, place in entries:
            start = self._part(part, name, place)
            if entry.rotation is not None:
                self._move(start, place, turn=_turn(entry.rotation), about=entry.rotation.reference)
        for name, i, entry, place in entries:
            shift = i * np.array(entry.offset) + entry.translation
            self._move(self._part(part, name, place), place, scale=entry.scale, shift=shift)

    def _move(
        self,
        part: str,
        place: Place,
        *,
        turn: np.ndarray = _NO_TURN,
        about: Sequence[float] | None = None,
        scale: float = 1.0,
        shift: np.ndarray | float = 0.0,
    ) -> None:
        """Turns and scales the nodes of a part about a point, by default their centre, and shifts
        them. `turn` is a matrix."""
        if names := [name for name in self.nodes if name.startswith(part)]:
            p = np.array([self.nodes[name] for name in names])
            centre = p.mean(axis=0) if about is None else np.array(about)
            p = centre + scale * (p - centre) @ turn.T + shift
            if not (farthest := np.abs(p).max()) <= LARGEST:
                problem = f"'{part[:-1]}' reaches {farthest:g}, expected at most {LARGEST:g}"
                raise InputError(*place, problem)
            self.nodes |= dict(zip(names, p, strict=True))

    def _part(self, part: str, tags: str, place: Place) -> str:
        """The least nested part with all tags inside a part."""
        inside = [one for one in self.parts if one.startswith(part) and one != part]
        fitting = [one for one in inside if _tags(tags) <= _tags(_last(one[:-1]))]
        if not fitting:
            names = [one.removeprefix(part)[:-1] for one in inside]
            raise InputError(*place, f"found no path of the part '{tags}'; {hint(tags, names)}")
        return min(fitting, key=lambda one: one.count("."))

    def _node(self, part: str, path: str, place: Place) -> str:
        """The least nested node with a path, such as PART.NODE, inside a part."""
        start, (*parts, tags) = part, path.split(".")
        for one in parts:
            start = self._part(start, one, place)
        inside = [name for name in self.nodes if name.startswith(start)]
        fitting = [name for name in inside if _tags(tags) <= _tags(_last(name))]
        if not fitting or not tags:
            names = [name.removeprefix(part) for name in inside]
            raise InputError(*place, f"found unknown node '{path}'; {hint(path, names)}")
        return min(fitting, key=lambda name: name.count("."))

    def _add_pair(
        self, tags: str, part: str, nodes: Ends, place: Place, *, more_tags: str = ""
    ) -> None:
        _check_size(len(self.pairs) + 1, MOST_PAIRS, place)
        group, all_tags = " ".join(tags.split()), _tags(f"{tags} {more_tags}")
        self.pairs.append(TaggedPair(group, all_tags, part, nodes, place))

    def _add_bond(self, bond: str, tags: str, pairs: list[Pair], part: str, place: Place) -> None:
        """Adds the pairs of a bond such as "a/b/c/node_node" between neighbours in a row of
        parts."""
        *names, kind = bond.split("/")
        _check_size(len(names), MOST_PARTS, place)
        if kind not in ("node_node", "node_edge") or len(names) < 2:
            expected = "expected parts and a kind, 'A/B/node_node' or 'A/B/node_edge'"
            raise InputError(*place, f"found the bond '{bond}', {expected}")
        for first, second in itertools.pairwise(names):
            starts = self._part(part, first, place), self._part(part, second, place)
            if kind == "node_edge":
                self._bond_edges(starts, tags, pairs, part, place)
                continue
            # Builders may ask for the names of both parts.
            more = f"{first} {second} {first}/{second}"
            for pair, at in _numbered(pairs, place):
                nodes = self._node(starts[0], pair[0], at), self._node(starts[1], pair[1], at)
                self._add_pair(tags, part, nodes, at, more_tags=more)

    def _bond_edges(
        self, starts: Ends, tags: str, pairs: list[Pair], part: str, place: Place
    ) -> None:
        """Bonds nodes of a part to the middles of edges NODE/NODE of another.

        The second part is moved onto the first. Each cable at an edge becomes two cables, from its
        ends to the node. Cables between the nodes are removed.
        """
        bonds, middles = [], []
        for pair, at in _numbered(pairs, place):
            ends = [
                [self._node(start, name, at) for name in end.split("/", 1)]
                for start, end in zip(starts, pair, strict=True)
            ]
            if sorted(map(len, ends)) != [1, 2]:
                raise InputError(*at, f"found {pair}, expected a node and an edge NODE/NODE")
            (node,), edge = sorted(ends, key=len)
            bonds.append((node, edge, at))
            middles.append([np.mean([self.nodes[name] for name in end], axis=0) for end in ends])
        self._dock(starts[1], *np.array(middles).reshape(-1, 2, 3).swapaxes(0, 1), place=place)
        self._remove_cables(starts, {node for node, _, _ in bonds}, place, inside=True)
        for node, edge, at in bonds:
            self._remove_cables(starts, {*edge}, at)
            self._add_pair(tags, part, (edge[0], node), at)
            self._add_pair(tags, part, (node, edge[1]), at)

    def _dock(self, part: str, there: np.ndarray, own: np.ndarray, *, place: Place) -> None:
        """Moves a part so that its `own` points (points, 3) come to points of another part: the
        centres meet, and the planes of the first three points; then the first points have the same
        direction from the centre."""
        frames = [_frame(p) for p in (there, own)]
        if not np.isfinite(frames).all():
            raise InputError(*place, "the first three pairs form no triangle, expected one")
        centre = own.mean(axis=0)
        turn, shift = frames[0].T @ frames[1], there.mean(axis=0) - centre
        self._move(part, place, turn=turn, about=centre.tolist(), shift=shift)

    def _remove_cables(
        self, starts: Ends, nodes: set[str], place: Place, *, inside: bool = False
    ) -> None:
        """Removes the cables among some nodes from two parts. Rods are refused, or stay if they are
        `inside`."""
        rods = [rule for rule in self.rules if rule.builder.kind == "struts"]
        found = [one for one in self.pairs if nodes >= {*one.nodes} and one.part.startswith(starts)]
        stay = [one for one in found if any(rule.tags <= one.tags for rule in rods)]
        if stay and not inside:
            problem = f"found the rod {'/'.join(stay[0].nodes)}, expected an edge of cables"
            raise InputError(*place, problem)
        self.pairs = [one for one in self.pairs if one not in found or one in stay]


def _numbered(pairs: list[Pair], place: Place) -> Iterator[tuple[Pair, Place]]:
    """Pairs of a list with their places. `place` is the list's."""
    for number, pair in enumerate(pairs):
        yield pair, place._replace(key=f"{place.key}[{number}]")


def _check_size(count: int, most: int, place: Place) -> None:
    """Refuses a structure that has become too large."""
    if count > most:
        problem = f"found more than {most} in the whole structure, expected at most as many"
        raise InputError(*place, problem)


@functools.lru_cache(maxsize=4096)
def _tags(text: str) -> Tags:
    return frozenset(text.split())


def _last(path: str) -> str:
    return path.rpartition(".")[2]


def _turn(rotation: Rotation) -> np.ndarray:
    """Matrix (3, 3) of a rotation."""
    from scipy.spatial import transform

    axis = np.array(rotation.axis) / np.abs(rotation.axis).max()  # its square must not be 0
    vector = rotation.angle * axis / np.linalg.norm(axis)
    matrix: np.ndarray = transform.Rotation.from_rotvec(vector, degrees=True).as_matrix()
    return matrix


def _frame(p: np.ndarray) -> np.ndarray:
    """Axes (3, 3) of points (points, 3), in rows: across the plane of the first three, along it
    towards the first one from the centre, and across both. Not finite if there is no plane."""
    if len(p) < LEAST_PAIRS:
        return np.full((3, 3), np.nan)
    normal = np.cross(p[1] - p[0], p[2] - p[0])
    across = np.cross(normal, p[0] - p.mean(axis=0))
    axes = np.array([normal, across, np.cross(across, normal)])
    with np.errstate(invalid="ignore"):
        unit: np.ndarray = axes / np.linalg.norm(axes, axis=1)[:, np.newaxis]
    return unit
