"""Graphs of structure files: struts and cables, the bodies that struts make, and pinned nodes."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Hashable, Iterable, Iterator, Mapping, Sequence
from typing import Annotated, Any, NamedTuple, Protocol, TypeVar

from pydantic import BaseModel, ValidationError

from tetra_drake.settings.quantities import TWO, Keyed
from tetra_drake.settings.refusals import hint, refuse
from tetra_drake.settings.section import Tree, tree_value

NodeT = TypeVar("NodeT", bound=Hashable)

Pair = Annotated[list[str], TWO]
"""Names of two nodes."""


class HasPairs(Protocol):
    """Group of struts or cables."""

    @property
    def pairs(self) -> list[list[str]]: ...


class Member(NamedTuple):
    """A strut or a cable of a structure file."""

    key: str
    """Key in the file, such as "cables.side.pairs[0]"."""
    group: str
    nodes: tuple[str, ...]
    """Nodes from one end to the other; a cable that runs over rings has more than two."""

    @property
    def names(self) -> tuple[str, str]:
        """Name in the order of the file, such as "side n1 n2", and with the nodes reversed."""
        return " ".join((self.group, *self.nodes)), " ".join((self.group, *self.nodes[::-1]))


def members(key: str, groups: Mapping[str, HasPairs]) -> Iterator[Member]:
    """Struts or cables in the order of the file. `key` is their section, such as "struts"."""
    for name, group in groups.items():
        for place, nodes in enumerate(group.pairs):
            yield Member(f"{key}.{name}.pairs[{place}]", name, tuple(nodes))


def struts_by_name(struts: Iterable[Member]) -> dict[str, list[Member]]:
    """Struts by the names that `bodies` may use: a group, such as "bar", or one strut, such as "bar
    a b", whose nodes may have either order."""
    found: dict[str, list[Member]] = {}
    for strut in struts:
        for name in (strut.group, *strut.names):
            found.setdefault(name, []).append(strut)
    return found


def components(groups: Iterable[Sequence[NodeT]]) -> list[list[NodeT]]:
    """Connected components of a graph that has edges between all nodes of each group. Each is a
    list of nodes, in the order of the groups."""
    first_node: dict[NodeT, NodeT] = {}
    for group in groups:
        start, *others = (first_node.setdefault(node, node) for node in group)
        for joined in others:
            if start != joined:
                first_node |= {node: start for node, old in first_node.items() if old == joined}
    found: dict[NodeT, list[NodeT]] = {}
    for node, start in first_node.items():
        found.setdefault(start, []).append(node)
    return [*found.values()]


def unused_name(name: str, taken: Collection[str]) -> str:
    """The name itself; if it is taken, the first of "n-2", "n-3" and so on that is not."""
    names = (f"{name}-{number}" for number in itertools.count(2))
    return next(one for one in itertools.chain([name], names) if one not in taken)


class _Group(BaseModel, extra="allow"):
    pairs: list[Pair]


class _Body(BaseModel, extra="allow"):
    struts: list[str] = []
    nodes: list[str] = []


class _Pinned(BaseModel):
    """The parts of a structure file that pinned nodes change."""

    pinned: list[str]
    nodes: Keyed[str, Any]
    struts: Keyed[str, _Group] = {}
    bodies: Keyed[str, _Body] = {}
    joints: Keyed[str, Any] = {}

    def expand(self) -> None:
        """Gives each body but the first at a pinned node a copy of the node and a joint to it.

        Nodes that are not pinned weld struts together, and so do the entries of `bodies`.
        """
        struts = [*members("struts", self.struts)]
        named, index = struts_by_name(struts), {strut.key: i for i, strut in enumerate(struts)}
        parts = [pair for group in self.struts.values() for pair in group.pairs]
        parts += [body.nodes for body in self.bodies.values()]
        welded: list[list[str | int]] = [
            [part, *(node for node in nodes if node not in self.pinned)]
            for part, nodes in enumerate(parts)
        ]
        for own, body in zip(welded[len(struts) :], self.bodies.values(), strict=True):
            own += [index[strut.key] for name in body.struts for strut in named.get(name, ())]
        body_of = {part: i for i, body in enumerate(components(welded)) for part in body}

        for place, node in enumerate(self.pinned):
            if node not in self.nodes:
                found = f"found unknown node '{node}'; {hint(node, self.nodes)}"
                refuse(f"pinned[{place}]", found)
            here: dict[int, list[list[str]]] = {}
            for part, nodes in enumerate(parts):
                if node in nodes:
                    here.setdefault(body_of[part], []).append(nodes)
            if len(here) < 2:
                expected = "expected a node that struts of two bodies share"
                refuse(f"pinned[{place}]", f"found '{node}', {expected}")
            for of_body in [*here.values()][1:]:
                copy = unused_name(node, self.nodes | self.joints)
                self.nodes[copy], self.joints[copy] = self.nodes[node], {"nodes": [node, copy]}
                for nodes in of_body:
                    nodes[:] = [copy if one == node else one for one in nodes]

        renamed = dict[str, str]()
        for old, new in zip(struts, members("struts", self.struts), strict=True):
            renamed |= dict.fromkeys(old.names, new.names[0])
        for entry in self.bodies.values():
            entry.struts = [renamed.get(name, name) for name in entry.struts]


def with_joints(tree: Tree) -> Tree:
    """Content of a structure file with joints in place of its pinned nodes.

    Struts that share a pinned node are one body there only if they also share another node, or if
    `bodies` joins them. The body of the first strut at the node keeps it. Each other one has a copy
    of it, named "l-2", "l-3" and so on for the node l, and a joint with the name of the copy.

    Raises InputError, naming the key, for a pinned node that no two bodies share.
    """
    tree = tree_value(tree)
    try:
        given = _Pinned.model_validate(tree)
    except ValidationError:  # the check of the whole structure tells what is wrong
        return tree
    given.expand()
    changed = given.model_dump(exclude_unset=True)
    return tree | changed | {"joints": given.joints, "pinned": []}
