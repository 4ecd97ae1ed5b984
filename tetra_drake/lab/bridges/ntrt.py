"""Reader of the YAML structures of NTRT, the NASA Tensegrity Robotics Toolkit.

Files mean here what they mean to NTRT's own reader, TensegrityModel. In NTRT y is up and masses are
in kg. The unit of length is not fixed; forces (kg length/s^2) and densities (kg/length^3) depend on
it. A file may place a structure at any height; the reader sets its lowest node on the ground. A
body of density 0 is held in space: its nodes are fixed. With fixed nodes, the ground is at y = 0,
or lower if the structure reaches lower. Boxes become rods with the same cross-section area.
Settings of motors and contacts are not read, and cables end on the axes of rods.
"""

from __future__ import annotations

import functools
import logging
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tetra_drake.errors import InputError
from tetra_drake.lab.bridges.ntrt_assembly import Assembly, Place, Rule, TaggedPair
from tetra_drake.lab.bridges.ntrt_file import CLASSES, Builder
from tetra_drake.laws.model import WORLD
from tetra_drake.scenario.robot_structure import StructureFile, components
from tetra_drake.settings.refusals import hint
from tetra_drake.settings.section import Tree

SAME_PLACE = 1e-6
"""Distance, in the file's unit of length, below which two nodes count as the same."""

_PARAMETERS = {"diameter": "radius", "tension": "pretension"}
"""NTRT's names of settings, by the names in structure files."""

_LOG = logging.getLogger("tetra_drake")


def ntrt_tree(file: Path, *, unit: float) -> Tree:
    """Converts a file of NTRT to the content of a structure file.

    `unit` is the file's unit of length in m. The axes z, x, y of NTRT become x (forward), y (left),
    z (up). A node of a substructure is named "SUBSTRUCTURE/NODE". A group is named by its tags,
    joined by slashes, because dots separate keys. The log names what is left out. Raises InputError
    that names file and key, also of the file of a substructure.
    """
    whole = Assembly()
    for name, (_, _, tag) in CLASSES.items():
        builder = Builder.model_validate({"class": name})
        whole.rules += [Rule(frozenset([tag]), builder, Place(file, "builders"))] if tag else []
    whole.add_file(file)
    made = _Translation(whole, unit)
    made.add_all()
    try:
        StructureFile.from_tree(made.tree, file)
    except InputError as error:
        key = error.key
        keys = [one for one in made.places if re.match(rf"{re.escape(one)}([.[]|$)", key)]
        place = made.places[max(keys, key=len)] if keys else Place(file, "pair_groups")
        earlier = r"(struts|cables)\.[^.]+\.pairs\[\d+\]"
        problem = re.sub(earlier, lambda found: made.places[found[0]].key, error.problem)
        raise InputError(*place, problem) from None
    for what, names in made.notes.items():
        _LOG.warning("%s: %s: %s", file, what, ", ".join(names))
    return made.tree


_Part = tuple[TaggedPair, Builder, Place]
"""Rod, box, cable or sphere; its builder; file and key of the builder. A sphere is a pair of equal
nodes."""


@dataclass
class _Translation:
    """Conversion of NTRT's files, read into `whole`, to `tree`, the content of a structure file.
    `places` has the file and key of NTRT that each key of `tree` comes from. `unit` is NTRT's unit
    of length in m."""

    whole: Assembly
    unit: float
    tree: Tree = field(default_factory=dict)
    places: dict[str, Place] = field(default_factory=dict)
    notes: dict[str, dict[str, None]] = field(default_factory=dict)
    """Remarks for the log, such as "left out, as nothing uses them", with the names that they apply
    to."""

    def add_all(self) -> None:
        """Adds to `tree` all rods, spheres and cables that can move, and the fixed nodes that
        cables join to them."""
        ignored = [name for rule in self.whole.rules for name in rule.builder.ignored]
        for name in ignored:
            self._note("not used, as the scenario has its own", name)
        self.tree |= {"ignored": list(dict.fromkeys(ignored))} if ignored else {}
        self.tree |= {"nodes": {}, "struts": {}, "cables": {}, "spheres": {}}
        parts = list(self._parts())
        solids = [(pair.nodes, made) for pair, made, _ in parts if made.kind != "cables"]
        bodies = components(nodes for nodes, _ in solids)
        body_of = {node: number for number, nodes in enumerate(bodies) for node in nodes}
        dense = {body_of[first] for (first, _), made in solids if made.parameters.density}
        body_of = {node: body if body in dense else WORLD for node, body in body_of.items()}
        used: dict[str, None] = {}
        groups: dict[tuple[str, str, Place], list[_Part]] = {}
        dense_pairs = {frozenset(pair.nodes) for pair, made, _ in parts if made.parameters.density}
        for part in parts:
            pair, builder, at = part
            (first, second), is_cable = pair.nodes, builder.kind == "cables"
            body, other = body_of.get(first, first), body_of.get(second, second)
            is_massless = not is_cable and not builder.parameters.density
            if is_cable and body == other and first != second:
                self._note("left out, as they join a body to itself", f"{first} {second}")
            elif body == WORLD and not is_cable:
                self._note("held in space, as their density is 0", pair.group)
            elif is_massless and frozenset(pair.nodes) in dense_pairs:
                self._note("left out, as parts with mass have their place", pair.group)
            else:
                groups.setdefault((builder.kind, pair.group, at), []).append(part)
                used |= dict.fromkeys(pair.nodes)
        for group in groups.values():
            self._add_group(group)
        fixed = [name for name in used if body_of.get(name) == WORLD]
        self.tree["anchors"] = {_name(name): "xyz" for name in fixed}
        ground = min((self.whole.nodes[name][1] for name in used), default=0.0)
        if fixed:
            ground = min(0.0, ground - max(made.parameters.radius for _, made in solids))
        for name in used:  # in the axes of structure files
            p = self.unit * (self.whole.nodes[name][[2, 0, 1]] - [0.0, 0.0, ground])
            self.tree["nodes"][_name(name)] = [f"{x!r} m" for x in p.tolist()]
            self.places[f"nodes.{_name(name)}"] = self.whole.places[name]
        for name, one in self._one_of.items():
            if one not in used and one not in body_of:
                self._note("left out, as nothing uses them", name)

    def _note(self, what: str, name: str) -> None:
        self.notes.setdefault(what, {})[name] = None

    @functools.cached_property
    def _one_of(self) -> dict[str, str]:
        """For each node, the node that stands for it: the first with the same coordinates. Nodes of
        pairs come first."""
        ends = (end for pair in self.whole.pairs for end in pair.nodes)
        names = list(dict.fromkeys([*ends, *self.whole.nodes]))
        p = np.array([self.whole.nodes[name] for name in names]).reshape(-1, 3)
        firsts = [int((np.abs(p - at).max(axis=1) < SAME_PLACE).argmax()) for at in p]
        return {name: names[first] for name, first in zip(names, firsts, strict=True)}

    def _parts(self) -> Iterator[_Part]:
        """Rods, boxes, cables and spheres, each with its builder: the last one in the files whose
        tags it has. Raises InputError for a pair without a builder."""
        whole = self.whole
        for pair in whole.pairs:
            rule = whole.rule(pair, "struts") or whole.rule(pair, "cables")
            if rule is None:
                tags = [" ".join(rule.tags) for rule in whole.rules]
                problem = f"found no builder for '{pair.group}'; {hint(pair.group, tags)}"
                raise InputError(*pair.place, problem)
            first, second = (self._one_of[node] for node in pair.nodes)
            if first == second and rule.builder.kind == "struts" and len({*pair.nodes}) == 2:
                self._note("left out, as their length is 0", pair.group)
            else:
                yield pair._replace(nodes=(first, second)), rule.builder, rule.place
        for name, place in whole.places.items():
            (part, _, own), one = name.rpartition("."), self._one_of[name]
            pair = TaggedPair(own, frozenset(own.split()), part, place, (one, one))
            if rule := whole.rule(pair, "spheres"):
                yield pair._replace(group=" ".join(sorted(rule.tags))), rule.builder, rule.place

    def _add_group(self, parts: list[_Part]) -> None:
        """Adds rods, spheres or cables with the same tags and builder, as one group of the
        structure file."""
        (pair, builder, at), unit = parts[0], self.unit
        kind, given = builder.kind, builder.parameters
        name = _name(pair.group.replace(" ", "/"))
        while name in self.tree[kind]:  # pairs with the same tags may have two builders
            name += "+"
        if builder.made_as == "tgBoxInfo":
            self._note("round rods in place of boxes", name)
        if kind == "cables":
            settings = {
                "stiffness": f"{given.stiffness!r} N/m",
                "damping": f"{given.damping!r} N*s/m",
                "tension": f"{given.pretension * unit!r} N",
            }
        else:
            size, density = 2.0 * given.radius * unit, given.density / unit**3
            settings = {"diameter": f"{size!r} m", "density": f"{density!r} kg/m^3"}
        if kind == "struts":
            settings["node_diameter"] = "0 m"
        key, members = f"{kind}.{name}", "nodes" if kind == "spheres" else "pairs"
        self.places[key] = pair.place
        for ours in settings:
            theirs = f"{at.key}.parameters.{_PARAMETERS.get(ours, ours)}"
            self.places[f"{key}.{ours}"] = at._replace(key=theirs)
        for i, (one, _, _) in enumerate(parts):
            self.places[f"{key}.{members}[{i}]"] = one.place
        ends = [[_name(node) for node in one.nodes] for one, _, _ in parts]
        all_members = [node for node, _ in ends] if kind == "spheres" else ends
        self.tree[kind][name] = settings | {members: all_members}


def _name(path: str) -> str:
    return path.replace(".", "/")
