"""Reader of MJCF models with tendons, as structures.

Spatial tendons over sites become cables, routed ones where they have more than two sites. A body
with a free or a ball joint becomes a rigid body, with the parts that are welded to it and with
MuJoCo's mass, centre and inertia. Its sites are nodes. A capsule or a cylinder between two nodes is
a strut. Sites of the world are fixed nodes. The places are those at MuJoCo's initial state, qpos0,
or in the first key frame with velocities, with which the robot then starts. Nodes where spheres and
capsules touch a level plane are feet, and the plane becomes the ground at z = 0. A free robot that
is lower is raised to it.
Actuators of tendons become oscillators. What an actuator exerts at control 0 belongs to its cable,
or to its site. A limit of a tendon is a stiff cable.

Tendons of MuJoCo push below their spring length, and their dampers also act where a cable is slack.
Cables do neither. A scenario has its own friction, ground and solver. Cameras, lights, materials
and sensors are no part of a structure. Everything else that is left out is told.
"""

from __future__ import annotations

import itertools
import logging
import re
import textwrap
from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tetra_drake.errors import InputError, escaped
from tetra_drake.lab.bridges.mjcf_file import compiled_model
from tetra_drake.lab.bridges.mjcf_forces import (
    actuator_laws,
    limit_laws,
    obey_flags,
    tendon_laws,
)
from tetra_drake.scenario.blueprint import TOLERANCE
from tetra_drake.scenario.robot_structure import MOST_NODES
from tetra_drake.scenario.structure_graph import unused_name
from tetra_drake.settings.section import Tree

SAME_HEIGHT = 1e-6
"""Height (m) of a plane up to which nodes keep their coordinates and feet change their radii."""
_LARGEST_GAP = 1000.0
"""Largest gap of a joint that is closed, as a multiple of the distance that makes two nodes one."""
_WORLD = 0
_NODE = -2

_LOG = logging.getLogger("tetra_drake")


def mjcf_tree(file: Path, *, without: Collection[str] = ()) -> Tree:
    """Converts an MJCF file to the content of a structure file, `without` bodies of these names.

    The log names what is left out, and the key `ignored` lists it. Names that structure files
    refuse are changed: "_" takes the place of blanks, dots, commas and brackets. Raises InputError
    that names the file.
    """
    model, removed = compiled_model(file, without=without)
    if model.nsite > MOST_NODES:
        problem = f"found {model.nsite} sites, expected at most {MOST_NODES}"
        raise InputError(file, "worldbody", problem)
    with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is refused later
        made = _MjcfTranslation(model)
        tree = made.tree()
    notes = {"settings of earlier versions of MuJoCo": removed, "bodies, left out": without}
    notes |= made.notes
    tree["ignored"] = [f"{what}: {', '.join(names)}" for what, names in notes.items() if names]
    if not tree["cables"]:
        problem = "has no spatial tendon that can be a cable, expected one"
        reasons = [line for line in tree["ignored"] if line.startswith("tendons")]
        short = [textwrap.shorten(line, 60, placeholder=" ...") for line in reasons]
        raise InputError(file, "tendon", "; ".join([problem, *short]))
    for line in tree["ignored"]:
        _LOG.warning("%s: %s", file, line)
    return {key: part for key, part in tree.items() if part}


class _MjcfPart(NamedTuple):
    """Cable, strut or foot."""

    name: str
    """Name of the tendon or geom."""
    nodes: list[str]
    settings: Tree


class _Push(NamedTuple):
    """Force that an actuator exerts on a node from the world at control 0."""

    actuator: int
    node: str
    load: np.ndarray
    """Constant force (3,) in the world."""
    axis: str
    """Axis of its spring and its damper, such as x."""
    law: tuple[float, float]
    """Stiffness and damping."""


class _MjcfTranslation:
    """Conversion of a compiled model to the content of a structure file."""

    def __init__(self, model: Any) -> None:
        import mujoco

        obey_flags(model)
        self.mujoco, self.model, self.data = mujoco, model, mujoco.MjData(model)
        self.key = next(iter(np.flatnonzero(model.key_qvel.any(axis=1)).tolist()), None)
        """Index of the key frame at which the robot starts; None if it starts at rest."""
        if self.key is not None:
            mujoco.mj_resetDataKeyframe(model, self.data, self.key)
        mujoco.mj_kinematics(model, self.data)
        mujoco.mj_comPos(model, self.data)
        mujoco.mj_comVel(model, self.data)
        self.nodes: dict[str, np.ndarray] = {}
        """Position (3,) of each node in the world."""
        self.root_of: dict[str, int] = {}
        """First of the bodies in MuJoCo that make each node's rigid body; 0 for the world."""
        self.notes: dict[str, list[str]] = {}
        """Names of elements that are changed or left out, by what is told of them."""
        is_on_tendon = model.actuator_trntype == mujoco.mjtTrn.mjTRN_TENDON
        self.driven = np.where(is_on_tendon, model.actuator_trnid[:, 0], -1)
        """Tendon that each actuator drives (actuators,); _NODE if it pushes a node, -1 for an
        actuator of something else."""
        self.is_linear, self.control, self.pushes = actuator_laws(model)
        size = np.ptp(np.vstack([self.data.site_xpos, self.data.xpos]), axis=0)
        self.near = TOLERANCE * float(np.linalg.norm(size))
        """Distance up to which two points are one node."""
        self.is_ball = model.jnt_type == mujoco.mjtJoint.mjJNT_BALL
        self.is_free = model.jnt_type == mujoco.mjtJoint.mjJNT_FREE
        self.roots = np.arange(model.nbody)
        """First body of the rigid body that each body belongs to (bodies,); 0 for the world. Only
        free and ball joints part bodies."""
        moving = model.jnt_bodyid[self.is_free | self.is_ball]
        for body in np.flatnonzero(~np.isin(self.roots, moving)).tolist():
            self.roots[body] = self.roots[model.body_parentid[body]]
        for eq in self._equalities(mujoco.mjtEq.mjEQ_WELD):
            first, second = sorted(root for root, _ in self._ends_of(eq))
            self.roots[self.roots == second] = first
        self.pivots = [*self._pivots()]
        """Name, ends and dry friction of each connect and ball joint; see _ends_of()."""
        self.laws = tendon_laws(model, self.driven)
        """Stiffness, damping and free length of each tendon, or of its limit (tendons, 3)."""
        self.is_string = model.tendon_limited & (self.laws[:, 0] <= 0.0)
        self.laws[self.is_string] = limit_laws(model)[self.is_string]
        poly, is_driven = model.tendon_stiffnesspoly, np.isin(np.arange(model.ntendon), self.driven)
        self.hardens = poly.any(axis=1) & (poly >= 0.0).all(axis=1) & ~is_driven & ~self.is_string
        """Tendons whose springs are polynomials of the stretch (tendons,)."""
        for what, kind, is_changed in self._changes():
            for number in np.flatnonzero(is_changed).tolist():
                self._note(what, kind, number)

    def tree(self) -> Tree:
        """Content of the structure file."""
        paths, roots = dict(self._paths()), self.roots[self.model.site_bodyid].tolist()
        on_paths = {*itertools.chain(*paths.values())}
        reached = {root for _, ends, _ in self.pivots for root, _ in ends}
        used = sorted(({roots[site] for site in on_paths} | reached) - {_WORLD})
        for root in sorted({*self.roots.tolist()} - {*used, _WORLD}):
            self._note("bodies that no tendon and no joint reaches, left out", "body", root)
        places = self._places(self.model.site_bodyid, self.model.site_pos)
        self.node_of = {
            site: self._node(root, place, self._name("site", site))
            for site, (root, place) in enumerate(zip(roots, places, strict=True))
            if site in on_paths or root in used
        }
        joints, anchors = self._joints()
        level, is_touching = self._floor()
        ground = 0.0 if level is None or abs(level) < SAME_HEIGHT else level
        rods, feet = self._rods_and_feet(used, is_touching, (level or 0.0) - ground)
        touching = [*feet] or self._nodes_of(*used)
        if level is not None and not feet:
            self.notes["floors that nothing touches in MuJoCo, but every node here"] = ["1"]
        held = self._held(used, anchors)
        is_held = self._nodes_of(_WORLD) or held["anchors"]
        if level is None or not is_held:  # a free robot may stand in the soft floor
            lows = [place[2] - feet.get(name, 0.0) for name, place in self.nodes.items()]
            ground = min([ground, *lows])
        spheres = [  # a foot of radius 0 has none
            _MjcfPart("foot", [node], {"diameter": _text(2.0 * radius, "m"), "density": "0 kg/m^3"})
            for node, radius in feet.items()
            if radius > 0.0
        ]
        for _, (node,), settings in spheres:  # the default is 0 where an anchor holds the node
            settings["contact_radius"] = _text(feet[node], "m")
        struts, strut_names = _grouped(rods, "pairs")
        cables, cable_names = _grouped(itertools.starmap(self._cable, paths.items()), "pairs")
        self._close(joints)
        bodies = self._bodies(used, dict(zip(strut_names, rods, strict=True)), ground)
        motions = dict(zip(bodies, map(self._motion, used), strict=True))
        return {
            "nodes": {node: _coordinates(place, ground) for node, place in self.nodes.items()},
            "struts": struts,
            "cables": cables,
            "spheres": _grouped(spheres, "nodes")[0],
            "bodies": bodies,
            "start": {} if self.key is None else {"rest": False, "bodies": motions},
            "joints": joints,
            **held,
            "anchors": dict.fromkeys(self._nodes_of(_WORLD), "xyz") | held["anchors"],
            "actuated": self._actuated(dict(zip(paths, cable_names, strict=True))),
            "contacts": [] if {*touching} == {*self._nodes_of(*used)} else touching,
            "gravity": _text(self._gravity(), "m/s^2"),
        }

    def _name(self, kind: str, number: int) -> str:
        """Name of an element, such as a site; its kind and number if it has none."""
        return escaped(getattr(self.model, kind)(number).name) or f"{kind}{number}"

    def _note(self, what: str, kind: str, number: int) -> None:
        self.notes.setdefault(what, []).append(self._name(kind, number))

    def _equalities(self, kind: Any) -> list[int]:
        """Indices of the active equality constraints of a kind."""
        is_active = self.model.eq_active0.astype(bool)
        return np.flatnonzero(is_active & (self.model.eq_type == kind)).tolist()

    def _places(self, bodies: Any, points: np.ndarray) -> np.ndarray:
        """Positions (n, 3) in the world of points (n, 3) of bodies (n,) of MuJoCo. MuJoCo's own
        position of a site is the body's if it is less than 1e-6 m away."""
        axes = self.data.xmat[bodies].reshape(-1, 3, 3)
        return np.asarray(self.data.xpos[bodies] + (axes @ points[:, :, np.newaxis])[:, :, 0])

    def _ends_of(self, eq: int) -> list[tuple[int, np.ndarray]]:
        """The two rigid bodies of a connect or weld, each with the point (3,) of the connect on it,
        in the world."""
        model = self.model
        ends = [model.eq_obj1id[eq], model.eq_obj2id[eq]]
        points = model.eq_data[eq, :6].reshape(2, 3)
        if model.eq_objtype[eq] == int(self.mujoco.mjtObj.mjOBJ_SITE):
            points, ends = model.site_pos[ends], model.site_bodyid[ends]
        return [*zip(self.roots[ends].tolist(), self._places(ends, points), strict=True)]

    def _nodes_of(self, *roots: int) -> list[str]:
        """Names of the nodes of rigid bodies."""
        return [node for node, root in self.root_of.items() if root in roots]

    def _found(self, root: int, place: np.ndarray) -> str | None:
        """Node of a rigid body at a place (3,) in the world; None if there is none."""
        gaps = ((node, np.linalg.norm(self.nodes[node] - place)) for node in self._nodes_of(root))
        return next((node for node, gap in gaps if gap <= self.near), None)

    def _node(self, root: int, place: np.ndarray, name: str) -> str:
        """Node of a rigid body at a place; a new one of this name if there is none."""
        found = self._found(root, place) or _plain(name, self.nodes)
        self.nodes.setdefault(found, place)
        self.root_of.setdefault(found, root)
        return found

    def _paths(self) -> Iterator[tuple[int, list[int]]]:
        """Spatial tendons that can be cables, each with its sites in order."""
        model, wrap = self.model, self.mujoco.mjtWrap
        for tendon, first in enumerate(model.tendon_adr):
            own = slice(first, first + model.tendon_num[tendon])
            kinds = model.wrap_type[own]
            sites = model.wrap_objid[own][kinds == wrap.mjWRAP_SITE].tolist()
            if np.isin(kinds, [wrap.mjWRAP_JOINT, wrap.mjWRAP_PULLEY]).any():
                self._note("tendons over joints or pulleys, left out", "tendon", tendon)
            elif len({*self.roots[model.site_bodyid[sites]].tolist()}) == 1:
                self._note("tendons that join a body to itself, left out", "tendon", tendon)
            elif self.laws[tendon, 0] <= 0.0:
                self._note("tendons without stiffness or limit, left out", "tendon", tendon)
            else:
                if len(sites) < len(kinds):
                    what = "tendons around surfaces, read as straight between sites"
                    self._note(what, "tendon", tendon)
                yield tendon, sites

    def _cable(self, tendon: int, sites: list[int]) -> _MjcfPart:
        """Cable of a tendon over sites."""
        law = map(_text, self.laws[tendon], ["N/m", "N*s/m", "m"])
        settings = dict(zip(["stiffness", "damping", "free_length"], law, strict=True))
        if self.hardens[tendon]:
            terms = map(_text, self.model.tendon_stiffnesspoly[tendon], ["N/m^2", "N/m^3"])
            settings |= zip(["quadratic", "cubic"], terms, strict=True)
        path = [node for node, _ in itertools.groupby(sites, self.node_of.__getitem__)]
        return _MjcfPart(self._name("tendon", tendon), path, settings)

    def _floor(self) -> tuple[float | None, np.ndarray]:
        """Height of the first level plane, and a mask (geoms,) of what can touch it."""
        model = self.model
        kinds, others = model.geom_contype, model.geom_conaffinity
        is_plane = model.geom_type == self.mujoco.mjtGeom.mjGEOM_PLANE
        is_level = self.data.geom_xmat[:, 8] > 1.0 - TOLERANCE**2
        floor = np.flatnonzero(is_plane & is_level)[:1]
        is_solid = (self.roots[model.geom_bodyid] == _WORLD) & ((kinds | others) != 0)
        is_solid[floor] = False
        for geom in np.flatnonzero(is_solid).tolist():
            self._note("shapes of the world, left out", "geom", geom)
        if not floor.size:
            return None, np.zeros(model.ngeom, dtype=bool)
        level = self._places(model.geom_bodyid[floor], model.geom_pos[floor])[0, 2]
        pairs = np.stack([model.pair_geom1, model.pair_geom2], axis=1)
        paired = np.isin(np.arange(model.ngeom), pairs[(pairs == floor).any(axis=1)])
        masks = (kinds & others[floor]) | (kinds[floor] & others)
        return float(level), paired | (masks != 0)

    def _rods_and_feet(
        self, used: list[int], is_touching: np.ndarray, sunk: float
    ) -> tuple[list[_MjcfPart], dict[str, float]]:
        """Capsules and cylinders between two nodes, and the radius (m) of each node that touches
        the floor: spheres, and ends of capsules. `sunk` is added to the radii."""
        model, kinds = self.model, self.mujoco.mjtGeom
        rods: dict[frozenset[str], _MjcfPart] = {}
        feet: dict[str, float] = {}
        is_round = np.isin(model.geom_type, [kinds.mjGEOM_SPHERE, kinds.mjGEOM_CAPSULE])
        is_rod = np.isin(model.geom_type, [kinds.mjGEOM_CYLINDER, kinds.mjGEOM_CAPSULE])
        roots = self.roots[model.geom_bodyid].tolist()
        middles = self._places(model.geom_bodyid, model.geom_pos)
        axes = self.data.geom_xmat[:, 2::3] * model.geom_size[:, 1:2]  # 0 for a sphere
        of_used = np.flatnonzero(np.isin(roots, used)).tolist()
        for geom in sorted(of_used, key=model.geom_type.__getitem__):
            radius = model.geom_size[geom, 0]
            root, name = roots[geom], self._name("geom", geom)
            places = [middles[geom] - axes[geom], middles[geom] + axes[geom]]
            if is_touching[geom] and is_round[geom]:
                for node in [self._node(root, place, name) for place in places]:
                    feet[node] = max(feet.get(node, 0.0), radius + sunk)
            elif is_touching[geom]:
                self._note("shapes that touch the floor in MuJoCo, but not here", "geom", geom)
            ends = [end for place in places if (end := self._found(root, place))]
            if is_rod[geom] and len({*ends}) == len(places):
                given = model.geom(geom).name or "strut"
                settings = {"diameter": _text(2.0 * radius, "m"), "node_diameter": "0 m"}
                settings["density"] = "0 kg/m^3"
                rods.setdefault(frozenset(ends), _MjcfPart(given, ends, settings))
        if feet:
            for rod in rods.values():
                rod.settings["contact_radius"] = "0 m"
        return [*rods.values()], feet

    def _bodies(self, used: list[int], struts: dict[str, _MjcfPart], ground: float) -> Tree:
        """Mass, centre of mass and inertia of the rigid bodies, with their struts and nodes."""
        model, data = self.model, self.data
        bodies: Tree = {}
        for root in used:
            parts, mass, centres, centre = self._masses(root)
            inertia = np.zeros((3, 3))
            for part in parts:
                axes = data.ximat[part].reshape(3, 3)
                inertia += axes * model.body_inertia[part] @ axes.T
            for own, arm in zip(mass, centres - centre, strict=True):
                inertia += own * (arm @ arm * np.eye(3) - np.outer(arm, arm))
            moments = np.append(inertia.diagonal(), inertia[[0, 0, 1], [1, 2, 2]])
            moments[np.abs(moments) < TOLERANCE**2 * moments.max()] = 0.0
            nodes = self._nodes_of(root)
            own = [name for name, strut in struts.items() if strut.nodes[0] in nodes]
            on_struts = {node for name in own for node in struts[name].nodes}
            bodies[_plain(self._name("body", root), bodies)] = {
                "struts": own,
                "nodes": [node for node in nodes if node not in on_struts],
                "mass": _text(mass.sum(), "kg"),
                "centre": _coordinates(centre, ground),
                "inertia": [f"{moment:.15g} kg*m^2" for moment in moments],
            }
        return bodies

    def _masses(self, root: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Parts of a rigid body, their masses (parts,) and centres (parts, 3), and its centre."""
        parts = np.flatnonzero(self.roots == root)
        mass = self.model.body_mass[parts]
        centres = self._places(parts, self.model.body_ipos[parts])
        return parts, mass, centres, mass @ centres / mass.sum()

    def _motion(self, root: int) -> Tree:
        """Velocity of the centre of mass, and spin, of a rigid body at the start."""
        spin, velocity = np.split(self.data.cvel[root], 2)
        arm = self._masses(root)[-1] - self.data.subtree_com[self.model.body_rootid[root]]
        along = velocity + np.cross(spin, arm)
        return {
            "velocity": [_text(x, "m/s") for x in along.tolist()],
            "spin": [_text(x, "rad/s") for x in spin.tolist()],
        }

    def _pivots(self) -> Iterator[tuple[str, list[tuple[int, np.ndarray]], float]]:
        """See `pivots`. Actuators that brake a connect, as make_mjcf() writes them, are its
        friction, and drive nothing else."""
        model, mujoco = self.model, self.mujoco
        is_brake = model.actuator_forcelimited & (self.pushes[:, 2] < 0.0)
        is_brake &= model.actuator_trntype == mujoco.mjtTrn.mjTRN_SITE
        for eq in self._equalities(mujoco.mjtEq.mjEQ_CONNECT):
            ends = model.eq_obj2id[eq], model.eq_obj1id[eq]
            brakes = is_brake & (model.actuator_trnid == ends).all(axis=1)
            brakes &= model.eq_objtype[eq] == mujoco.mjtObj.mjOBJ_SITE
            self.driven[brakes] = _NODE
            friction = model.actuator_forcerange[brakes, 1].max(initial=0.0)
            yield self._name("equality", eq), self._ends_of(eq), float(friction)
        for joint in np.flatnonzero(self.is_ball).tolist():
            body = model.jnt_bodyid[joint]
            roots = self.roots[[model.body_parentid[body], body]].tolist()
            places = [(root, self.data.xanchor[joint]) for root in roots]
            friction = model.dof_frictionloss[model.jnt_dofadr[joint]]
            yield self._name("joint", joint), places, float(friction)

    def _joints(self) -> tuple[Tree, Tree]:
        """Joints of two bodies, and anchors, from joints with the world."""
        joints: Tree = {}
        anchors: Tree = {}
        for given, both, friction in self.pivots:
            ends = [end for end in both if end[0] != _WORLD]
            name = _plain(given, joints)
            nodes = [self._node(*end, f"{name}-{i}") for i, end in enumerate(ends, 1)]
            if len(nodes) == 1:
                anchors[nodes[0]] = "xyz"
                if friction:
                    self.notes.setdefault("friction at anchors, left out", []).append(given)
            elif len({*nodes}) > 1:
                joints[name] = {"nodes": nodes, "friction": _text(friction, "N*m")}
        return joints, anchors

    def _held(self, used: list[int], anchors: Tree) -> Tree:
        """Loads of nodes, from compensated gravity and actuators at sites; and `anchors`, or else
        anchors for springs of actuators that are all alike."""
        model, gravity = self.model, np.array([0.0, 0.0, self._gravity()])
        loads: defaultdict[str, np.ndarray] = defaultdict(lambda: np.zeros(3))
        tree: Tree = {"anchors": anchors}
        lifts = model.body_mass * model.body_gravcomp
        for body in np.flatnonzero(np.isin(self.roots, used) & (lifts != 0.0)).tolist():
            root, name = int(self.roots[body]), self._name("body", body)
            loads[self._node(root, self.data.xipos[body], name)] += lifts[body] * gravity
        pushes = [*self._pushes(used)]
        laws = [push.law for push in pushes if any(push.law)]
        axes = {(push.node, push.axis) for push in pushes if any(push.law)}
        are_alike = len({*laws}) == 1 and laws[0][0] > 0.0 and len(axes) == len(laws)
        for actuator, node, load, axis, (stiffness, damping) in pushes:
            if (stiffness or damping) and (anchors or not are_alike):
                continue
            self.driven[actuator] = _NODE
            loads[node] += load
            if stiffness:
                tree["anchor_stiffness"] = _text(stiffness, "N/m")
                tree["anchor_time_constant"] = _text(damping / stiffness, "s")
                tree["anchors"] = {**tree["anchors"], node: tree["anchors"].get(node, "") + axis}
        held = {node: load.tolist() for node, load in loads.items() if load.any()}
        return tree | {"loads": {node: [_text(x, "N") for x in held[node]] for node in held}}

    def _pushes(self, used: list[int]) -> Iterator[_Push]:
        """Actuators that push a site along an axis of a site of the world."""
        model, roots = self.model, self.roots[self.model.site_bodyid]
        places = self._places(model.site_bodyid, model.site_pos)
        is_on_site = model.actuator_trntype == self.mujoco.mjtTrn.mjTRN_SITE
        for actuator in np.flatnonzero(self.is_linear & is_on_site).tolist():
            (site, origin), (push, *law) = model.actuator_trnid[actuator], self.pushes[actuator]
            gear = model.actuator_gear[model.actuator_outadr[actuator]]
            axis = self.data.site_xmat[origin].reshape(3, 3) @ gear[:3]
            axis[np.abs(axis) <= TOLERANCE * np.abs(axis).max()] = 0.0
            is_askew = gear[3:].any() or (any(law) and np.count_nonzero(axis) > 1)
            is_held = origin >= 0 and roots[origin] == _WORLD and roots[site] in used
            if is_held and not is_askew and max(law) <= 0.0:
                gap = axis @ (places[site] - places[origin])
                is_closed = abs(gap) <= _LARGEST_GAP * self.near * np.abs(axis).max()
                load = push + law[0] * (0.0 if is_closed else gap)
                stiffness, damping = (-(axis @ axis) * np.array(law)).tolist()
                along = "xyz"[int(np.abs(axis).argmax())]
                yield _Push(actuator, self.node_of[site], axis * load, along, (stiffness, damping))

    def _close(self, joints: Tree) -> None:
        """Moves the second node of each joint with a small gap to the first."""
        for name, joint in joints.items():
            first, second = joint["nodes"]
            gap = float(np.linalg.norm(self.nodes[first] - self.nodes[second]))
            if self.near < gap <= _LARGEST_GAP * self.near:
                self.nodes[second] = self.nodes[first]
                self.notes.setdefault("joints with a gap, which is closed", []).append(name)

    def _actuated(self, cables: dict[int, str]) -> Tree:
        """Oscillators: actuators of cables, from the name of each tendon's cable. Actuators whose
        names differ only by the names of their tendons are one oscillator."""
        actuated: Tree = {}
        keys: dict[str, str] = {}
        for actuator, tendon in enumerate(self.driven.tolist()):
            if tendon == _NODE:
                continue
            if tendon not in cables or not self.is_linear[actuator]:
                self._note("actuators of no cable here, or its second ones", "actuator", actuator)
                continue
            name = self._name("actuator", actuator).removesuffix(f" {self._name('tendon', tendon)}")
            key = keys.setdefault(name, _plain(name, actuated))
            actuated.setdefault(key, []).append(cables.pop(tendon))
        return actuated

    def _gravity(self) -> float:
        """Acceleration of gravity along -z."""
        option = self.model.opt
        x, y, z = option.gravity
        if x or y or z > 0.0:
            self.notes["gravity that is not along -z, left out"] = [f"{x:g} {y:g} {z:g}"]
        if option.density or option.viscosity:
            self.notes["fluid around the robot, left out"] = ["density, viscosity, wind"]
        return max(0.0, -z)

    def _changes(self) -> Iterator[tuple[str, str, Any]]:
        """What is told of elements that are changed or left out, their kind, and a mask of them."""
        mujoco, model = self.mujoco, self.model
        yield "other joints, read as rigid", "joint", ~(self.is_free | self.is_ball)
        acting = {"stiffness": model.jnt_stiffness, "stiffnesspoly": model.jnt_stiffnesspoly}
        acting["range"] = model.jnt_range
        for name in ("damping", "dampingpoly", "armature", "frictionloss"):
            acting[name] = getattr(model, f"dof_{name}")[model.jnt_dofadr]
        for name, values in acting.items():
            is_acting = np.atleast_2d(values.T).any(axis=0)
            yield f"the {name} of free joints, left out", "joint", is_acting & self.is_free
            if name != "frictionloss":
                yield f"the {name} of ball joints, left out", "joint", is_acting & self.is_ball
        kinds = [mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD]
        is_known = np.isin(model.eq_type, kinds) & model.eq_active0.astype(bool)
        yield "other equality constraints, left out", "equality", ~is_known
        is_pushing = (model.tendon_lengthspring[:, 0] > 0.0) & (model.tendon_stiffness > 0.0)
        what = "springs that push below their length, read as cables that go slack"
        yield what, "tendon", is_pushing
        yield "limits of tendons, read as stiff cables", "tendon", self.is_string
        is_set = model.tendon_limited & ~self.is_string
        yield "the setting 'limited' of tendons, left out", "tendon", is_set
        is_low = self.is_string & (model.tendon_range[:, 0] > 0.0)
        yield "lower limits of tendons, left out", "tendon", is_low
        is_left = model.tendon_stiffnesspoly.any(axis=1) & ~self.hardens
        yield "the setting 'stiffnesspoly' of tendons, left out", "tendon", is_left
        names = "actfrclimited frictionloss armature dampingpoly springyield"
        for name in names.split():  # earlier versions of MuJoCo have not all of them
            values = getattr(model, f"tendon_{name}", np.zeros(model.ntendon))
            is_set = [np.any(value) for value in values]
            yield f"the setting '{name}' of tendons, left out", "tendon", is_set
        acts, drives = self.pushes.any(axis=1), self.driven >= 0
        for control in np.unique(self.control[acts & drives]).tolist():
            what = f"actuators with springs or forces, read at control {control:g}"
            yield what, "actuator", acts & drives & (self.control == control)
        is_limited = self.pushes[:, 1:].any(axis=1) & model.actuator_forcelimited
        is_limited &= self.driven != _NODE
        yield "limits of the force of springs of actuators, left out", "actuator", is_limited
        of_both = np.append(model.tendon_stiffness > 0.0, False)[self.driven]
        what = "springs of actuators and their tendons, read as one, with one free length"
        yield what, "actuator", of_both & self.pushes[:, 1].astype(bool)
        has_none = np.append((self.laws[:, 0] <= 0.0) | self.is_string, False)
        is_alone = drives & acts & has_none[self.driven]
        yield "forces on tendons without stiffness, left out", "actuator", is_alone
        yield "the armature of actuators, left out", "actuator", model.actuator_armature
        yield "mocap bodies, read as fixed", "body", model.body_mocapid >= 0
        yield "plug-ins, left out", "body", model.body_plugin >= 0
        yield "key frames, left out", "key", np.arange(model.nkey) != self.key
        yield "flexible parts, left out", "flex", np.ones(model.nflex)


def _grouped(parts: Iterable[_MjcfPart], key: str) -> tuple[Tree, list[str]]:
    """Groups of the parts with equal settings and the same beginning of the name: its first word,
    or what is before its first digit. Returns the groups, with the parts under `key`, and the full
    name of each part, such as "side n1 n2". The same nodes are in a group only once."""
    groups: Tree = {}
    names: list[str] = []
    group_of: dict[tuple[Any, ...], str] = {}
    copies: Counter[frozenset[str]] = Counter()
    for name, nodes, settings in parts:
        word = name.split()[0] if " " in name else re.split(r"\d", name)[0].strip("_-") or "part"
        alike = word, copies[frozenset(nodes)], *settings.values()
        copies[frozenset(nodes)] += 1
        group = group_of.setdefault(alike, _plain(word, groups))
        groups.setdefault(group, settings | {key: []})[key] += [nodes] if key == "pairs" else nodes
        names.append(" ".join([group, *nodes]))
    return groups, names


def _plain(name: str, taken: Collection[str]) -> str:
    """Name without the characters that structure files refuse, numbered if it is taken."""
    return unused_name(re.sub(r"[\s.,\[\]]+", "_", name), taken)


def _text(number: float, unit: str) -> str:
    return f"{number:.12g} {unit}"


def _coordinates(place: np.ndarray, ground: float) -> list[str]:
    """Coordinates in a structure file, from the position in MuJoCo's world and the height of the
    ground there. They are rounded to 1e-12 m."""
    return [_text(round(x, 12) + 0.0, "m") for x in (place - [0.0, 0.0, ground]).tolist()]
