"""Reader of the YAML structures of NTRT, the NASA Tensegrity Robotics Toolkit.

Files mean here what they mean to NTRT's own reader, TensegrityModel. In NTRT y is up and masses are
in kg. The unit of length is open; forces (kg length/s^2) and densities (kg/length^3) depend on it.
Structures begin anywhere, also below the ground: here the lowest node is set on it. A body of
density 0 is held in space: its nodes are fixed. Then the ground is at y = 0, or lower where the
structure is. Boxes become rods with the same cross-section area. Settings of motors and contacts
are not read, and cables end on the axes of rods.
"""

from __future__ import annotations

import functools
import logging
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tetra_drake.errors import InputError
from tetra_drake.scenario.blueprint import WORLD
from tetra_drake.scenario.ntrt_assembly import Assembly, Ends, Place, Rule
from tetra_drake.scenario.ntrt_file import Builder
from tetra_drake.scenario.refusals import hint
from tetra_drake.scenario.robot_structure import Member, StructureFile, components
from tetra_drake.scenario.section import Tree

SAME_PLACE = 1e-6
"""Distance in NTRT's unit below which nodes are one node."""

DEFAULTS = {
    "rod": "tgRodInfo",
    "string": "tgBasicActuatorInfo",
    "box": "tgBoxInfo",
    "sphere": "tgSphereInfo",
}
"""Classes of the builders for pairs and nodes without a builder in their files, by tag."""

_PARAMETERS = {"diameter": "radius", "tension": "pretension"}
"""NTRT's names of settings with other names here."""

_LOG = logging.getLogger("tetra_drake")


def ntrt_tree(file: Path, *, unit: float) -> Tree:
    """The tree of a structure file for a file of NTRT.

    unit: length of NTRT's unit in m. The axes z, x, y of NTRT are x (forward), y (left), z (up). A
    substructure's nodes are named "SUBSTRUCTURE/NODE", groups by their tags joined by slashes, as
    dots separate keys. What is left out is noted in the log. Raises InputError that names file and
    key, for substructures too.
    """
    defaults = {tag: Builder.model_validate({"class": name}) for tag, name in DEFAULTS.items()}
    at = Place(file, "builders")
    whole = Assembly(rules=[Rule(frozenset([tag]), one, at) for tag, one in defaults.items()])
    whole.add_file(file)
    made = _Translation(whole, unit)
    made.add_all()
    try:
        StructureFile.from_tree(made.tree, file)
    except InputError as error:
        raise made.error_in_file(error, file) from None
    for what, names in made.notes.items():
        _LOG.warning("%s: %s: %s", file, what, ", ".join(names))
    return made.tree


class _Part(NamedTuple):
    """Rod, box, sphere or cable."""

    group: str
    """Tags by which its group is named."""
    ends: Ends
    """Its nodes; the node of a sphere twice."""
    rule: Rule
    place: Place

    @property
    def builder(self) -> Builder:
        """Class and parameters."""
        return self.rule.builder


@dataclass
class _Translation:
    """Tree of a structure file, with the places of its keys in NTRT's files."""

    whole: Assembly
    unit: float
    tree: Tree = field(default_factory=dict)
    notes: dict[str, list[str]] = field(default_factory=dict)
    """What is left out or changed: names by texts."""
    _places: dict[str, Place] = field(default_factory=dict)
    _names: dict[tuple[str, str, Place], str] = field(default_factory=dict)
    """Names of groups by kind, tags, and place of the builder."""

    def add_all(self) -> None:
        """Adds what moves, and what it hangs on."""
        ignored = (name for rule in self.whole.rules for name in rule.builder.parameters.ignored)
        if names := list(dict.fromkeys(ignored)):
            self.tree["ignored"] = self.notes["not used, as the scenario has its own"] = names
        self.tree |= {"nodes": {}, "struts": {}, "cables": {}, "spheres": {}}
        parts = self._parts()
        solids = [part for part in parts if part.builder.kind != "cables"]
        bodies = components(Member("", "", solid.ends) for solid in solids)
        body_of = {node: number for number, nodes in enumerate(bodies) for node in nodes}
        dense = {body_of[solid.ends[0]] for solid in solids if solid.builder.has_mass}
        body_of = {node: body if body in dense else WORLD for node, body in body_of.items()}
        used: dict[str, None] = {}
        for part in self._effective(parts, body_of):
            self._add_part(part)
            used |= dict.fromkeys(part.ends)
        fixed = [name for name in used if body_of.get(name) == WORLD]
        self.tree["anchors"] = {_name(name): "xyz" for name in fixed}
        ground = min((self.whole.nodes[name][1] for name in used), default=0.0)
        if fixed:
            ground = min(0.0, ground - max(solid.builder.parameters.radius for solid in solids))
        self._add_nodes(list(used), ground)
        for name, one in self._one_of.items():
            if one not in used and one not in body_of:
                self._note("left out, as nothing uses them", name)

    def _effective(self, parts: list[_Part], body_of: dict[str, int]) -> Iterator[_Part]:
        """Parts that have an effect. `body_of` has the body of each node of one."""
        solid = {frozenset(part.ends) for part in parts if part.builder.has_mass}
        for part in parts:
            first, second = (body_of.get(end, end) for end in part.ends)
            if part.builder.kind == "cables":
                if first == second and part.ends[0] != part.ends[1]:
                    self._note("left out, as they join a body to itself", " ".join(part.ends))
                    continue
            elif first == WORLD:
                self._note("held in space, as their density is 0", part.group)
                continue
            elif not part.builder.has_mass and frozenset(part.ends) in solid:
                self._note("left out, as parts with mass have their place", part.group)
                continue
            yield part

    def error_in_file(self, error: InputError, file: Path) -> InputError:
        """An error about the tree as one about NTRT's files."""
        keys = [key for key in self._places if re.match(rf"{re.escape(key)}([.[]|$)", error.key)]
        place = self._places[max(keys, key=len)] if keys else Place(file, "pair_groups")
        earlier = r"(struts|cables)\.[^.]+\.pairs\[\d+\]"
        problem = re.sub(earlier, lambda found: self._places[found[0]].key, error.problem)
        return InputError(*place, problem)

    def _note(self, what: str, name: str) -> None:
        names = self.notes.setdefault(what, [])
        if name not in names:
            names.append(name)

    @functools.cached_property
    def _one_of(self) -> dict[str, str]:
        """The node that stands for each node: the first one at its place. Nodes of pairs come
        first."""
        ends = (end for pair in self.whole.pairs for end in pair.nodes)
        names = list(dict.fromkeys([*ends, *self.whole.nodes]))
        p = np.array([self.whole.nodes[name] for name in names]).reshape(-1, 3)
        firsts = [int((np.abs(p - at).max(axis=1) < SAME_PLACE).argmax()) for at in p]
        return {name: names[first] for name, first in zip(names, firsts, strict=True)}

    def _parts(self) -> list[_Part]:
        """Rods, boxes, cables and spheres, with the last builders that fit."""
        whole, parts = self.whole, []
        for pair in whole.pairs:
            kinds = "struts", "cables"
            found = (whole.rule(pair.part, pair.tags, kind) for kind in kinds)
            rule = next(filter(None, found), None)
            if rule is None:
                tags = [" ".join(rule.tags) for rule in whole.rules]
                problem = f"found no builder for '{pair.group}'; {hint(pair.group, tags)}"
                raise InputError(*pair.place, problem)
            first, second = (self._one_of[node] for node in pair.nodes)
            if first == second and rule.builder.kind == "struts" and len({*pair.nodes}) == 2:
                self._note("left out, as their length is 0", pair.group)
                continue
            parts.append(_Part(pair.group, (first, second), rule, pair.place))
        for name in whole.nodes:
            own, one = name.rpartition(".")[2], self._one_of[name]
            rule = whole.rule(name.removesuffix(own), frozenset(own.split()), "spheres")
            if rule is not None:
                group = " ".join(sorted(rule.tags))
                parts.append(_Part(group, (one, one), rule, whole.places[name]))
        return parts

    def _add_part(self, part: _Part) -> None:
        """Adds a part to its group."""
        kind = part.builder.kind
        groups = self.tree[kind]
        made_by = kind, part.group, part.rule.place
        if made_by not in self._names:
            name = _name(part.group.replace(" ", "/"))
            while name in groups:  # pairs with the same tags may have two builders
                name += "+"
            self._names[made_by] = name
            groups[name] = self._settings(part.builder)
            self._places[f"{kind}.{name}"] = part.place
            for ours in groups[name]:
                theirs = f"{part.rule.place.key}.parameters.{_PARAMETERS.get(ours, ours)}"
                self._places[f"{kind}.{name}.{ours}"] = part.rule.place._replace(key=theirs)
            if part.builder.made_as == "tgBoxInfo":
                self._note("round rods in place of boxes", name)
        members = "nodes" if kind == "spheres" else "pairs"
        own = groups[self._names[made_by]].setdefault(members, [])
        self._places[f"{kind}.{self._names[made_by]}.{members}[{len(own)}]"] = part.place
        own.append(_name(part.ends[0]) if kind == "spheres" else [_name(end) for end in part.ends])

    def _settings(self, builder: Builder) -> Tree:
        """Settings of a group."""
        given, unit = builder.parameters, self.unit
        if builder.kind == "cables":
            return {
                "stiffness": f"{given.stiffness!r} N/m",
                "damping": f"{given.damping!r} N*s/m",
                "tension": f"{given.pretension * unit!r} N",
            }
        size = {"diameter": f"{2.0 * given.radius * unit!r} m"}
        size["density"] = f"{given.density / unit**3!r} kg/m^3"
        return size if builder.kind == "spheres" else size | {"node_diameter": "0 m"}

    def _add_nodes(self, names: list[str], ground: float) -> None:
        """Adds nodes in the axes of structure files. `ground` is its height in NTRT's unit."""
        for name in names:
            p = self.unit * (self.whole.nodes[name][[2, 0, 1]] - [0.0, 0.0, ground])
            self.tree["nodes"][_name(name)] = [f"{x!r} m" for x in p.tolist()]
            self._places[f"nodes.{_name(name)}"] = self.whole.places[name]


def _name(path: str) -> str:
    return path.replace(".", "/")
