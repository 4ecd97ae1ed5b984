"""Graphs of structure files: struts and cables, and the bodies that struts make."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Hashable, Iterable, Iterator, Mapping, Sequence
from typing import Annotated, Any, NamedTuple, TypeVar

from tetra_drake.settings.quantities import TWO

NodeT = TypeVar("NodeT", bound=Hashable)

Pair = Annotated[list[str], TWO]
"""Names of two nodes."""


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


def members(key: str, groups: Mapping[str, Any]) -> Iterator[Member]:
    """Struts or cables of `groups`, a section of the file, in the order of the file. `key` is the
    section, such as "struts"."""
    for name, group in groups.items():
        for place, nodes in enumerate(group.pairs):
            yield Member(f"{key}.{name}.pairs[{place}]", name, tuple(nodes))


def nodes_of(key: str, entries: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Keys and names of the nodes that entries list, such as "joints.knee.nodes[0]" and "a". `key`
    is their section, such as "joints"."""
    for name, entry in entries.items():
        for place, node in enumerate(entry.nodes):
            yield f"{key}.{name}.nodes[{place}]", node


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
