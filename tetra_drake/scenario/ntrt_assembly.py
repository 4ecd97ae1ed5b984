"""Assembly of the files of NTRT: a file with its substructures, as TensegrityModel makes it."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from tetra_drake.errors import InputError
from tetra_drake.scenario.ntrt_file import Builder, NtrtFile, Rotation, Substructure
from tetra_drake.scenario.refusals import hint
from tetra_drake.scenario.robot_structure import MOST_NODES, MOST_PAIRS, Pair
from tetra_drake.scenario.section import keys_of
from tetra_drake.scenario.units import LARGEST
from tetra_drake.scenario.yaml_text import read_mapping

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation as Turn

MOST_BYTES = 2**20
"""Largest size of a file in bytes."""

MOST_PARTS = MOST_NODES // 2
"""Largest number of substructures, including nested ones."""

LEAST_PAIRS = 3
"""Least number of pairs in a bond of nodes and edges."""

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
            key = f"pair_groups.{tags}"
            for number, pair in enumerate(pairs):
                place = Place(file, f"{key}[{number}]")
                nodes = self._node(part, pair[0], place), self._node(part, pair[1], place)
                self._add_pair(tags, part, nodes, place)
        for outer, groups in given.bond_groups.items():
            for inner, pairs in groups.items():
                bond, tags = (outer, inner) if "/" in outer else (inner, outer)
                self._add_bond(bond, tags, pairs, part, Place(file, f"bond_groups.{outer}.{inner}"))

    def rule(self, part: str, tags: Tags, rules: Sequence[Rule]) -> Rule | None:
        """The last one of some rules for tags in a part, whose own tags count, too."""
        tags |= _tags(_last(part.removesuffix(".")))
        return next((rule for rule in reversed(rules) if rule.tags <= tags), None)

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
        turn: Turn | None = None,
        about: Sequence[float] | None = None,
        scale: float = 1.0,
        shift: np.ndarray | float = 0.0,
    ) -> None:
        """Turns and scales the nodes of a part about a point, by default their centre, and shifts
        them."""
        names = [name for name in self.nodes if name.startswith(part)]
        if not names:
            return
        p = np.array([self.nodes[name] for name in names])
        centre = p.mean(axis=0) if about is None else np.array(about)
        arms = p - centre if turn is None else turn.apply(p - centre)
        p = centre + scale * arms + shift
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
            for number, pair in enumerate(pairs):
                at = place._replace(key=f"{place.key}[{number}]")
                nodes = self._node(starts[0], pair[0], at), self._node(starts[1], pair[1], at)
                self._add_pair(tags, part, nodes, at, more_tags=more)

    def _bond_edges(
        self, starts: Ends, tags: str, pairs: list[Pair], part: str, place: Place
    ) -> None:
        """Bonds nodes of a part to the middles of edges (NODE/NODE) of another.

        The second part is moved onto the first. Each cable at an edge becomes two cables, from its
        ends to the node. Cables between bonded nodes of one part are removed.
        """
        if len(pairs) < LEAST_PAIRS:
            raise InputError(*place, f"found {len(pairs)} pairs, expected {LEAST_PAIRS} at least")
        nodes, edges, middles = [], [], []
        for number, pair in enumerate(pairs):
            at = place._replace(key=f"{place.key}[{number}]")
            if sum("/" in end for end in pair) != 1:
                raise InputError(*at, f"found {pair}, expected a node and an edge NODE/NODE")
            ends = [
                [self._node(start, name, at) for name in end.split("/", 1)]
                for start, end in zip(starts, pair, strict=True)
            ]
            nodes += [end[0] for end in ends if len(end) == 1]
            edges += [(end[0], end[1]) for end in ends if len(end) == 2]
            middles.append([np.mean([self.nodes[name] for name in end], axis=0) for end in ends])
        there, own = np.swapaxes(np.array(middles), 0, 1)
        self._dock(starts[1], there, own, place)
        self._remove_cables(starts, nodes, edges, place)
        for number, (node, edge) in enumerate(zip(nodes, edges, strict=True)):
            at = place._replace(key=f"{place.key}[{number}]")
            self._add_pair(tags, part, (edge[0], node), at)
            self._add_pair(tags, part, (node, edge[1]), at)

    def _dock(self, part: str, there: np.ndarray, own: np.ndarray, place: Place) -> None:
        """Moves a part so that its `own` points (points, 3) come to points of another part: the
        centres meet, and the planes of the first three points; then the first points have the same
        direction from the centre."""
        normal, own_normal = (np.cross(p[1] - p[0], p[2] - p[0]) for p in (there, own))
        centre, own_centre = there.mean(axis=0), own.mean(axis=0)
        first, own_first = there[0] - centre, own[0] - own_centre
        if not all(map(np.any, (normal, own_normal, first, own_first))):
            raise InputError(*place, "found ends in a line, expected the first three in a triangle")
        turn = _least_turn(own_normal, normal, about=own[1] - own[0])
        self._move(part, place, turn=turn, about=own_centre, shift=centre - own_centre)
        turn = _least_turn(turn.apply(own_first), first, about=normal)
        self._move(part, place, turn=turn, about=centre)

    def _remove_cables(
        self, starts: Ends, nodes: Sequence[str], edges: Sequence[Ends], place: Place
    ) -> None:
        """Removes the cables at edges, and those between some nodes, from two parts. Refuses an
        edge that is a rod."""
        rigid = [rule for rule in self.rules if rule.builder.is_rigid]
        bonded, at_edges, kept = {*nodes}, {frozenset(edge) for edge in edges}, []
        for pair in self.pairs:
            ends = frozenset(pair.nodes)
            is_edge = ends in at_edges
            if pair.part.startswith(starts) and (is_edge or ends <= bonded):
                if not any(rule.tags <= pair.tags for rule in rigid):
                    continue
                if is_edge:
                    found = f"found the rod {'/'.join(pair.nodes)}"
                    raise InputError(*place, f"{found}, expected an edge of cables")
            kept.append(pair)
        self.pairs = kept


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


def _turn(rotation: Rotation) -> Turn:
    from scipy.spatial import transform

    axis = np.array(rotation.axis) / np.abs(rotation.axis).max()  # its square must not be 0
    vector = rotation.angle * axis / np.linalg.norm(axis)
    return transform.Rotation.from_rotvec(vector, degrees=True)


def _least_turn(start: np.ndarray, end: np.ndarray, *, about: np.ndarray) -> Turn:
    """The least rotation from a direction to another; `about` an axis if they are opposite."""
    from scipy.spatial import transform

    a, b = start / np.linalg.norm(start), end / np.linalg.norm(end)
    axis, cosine = np.cross(a, b), float(a @ b)
    if cosine < 0.0 and np.linalg.norm(axis) < _OPPOSITE:
        return transform.Rotation.from_rotvec(np.pi * about / np.linalg.norm(about))
    return transform.Rotation.from_quat([*axis, 1.0 + cosine])


_OPPOSITE = 1e-9
"""Sine of the angle of two directions below which they count as opposite."""
