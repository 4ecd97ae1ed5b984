"""Structure of a robot: its blueprint, with the inertia and the initial poses of its bodies."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np
import numpy.typing as npt
from pydrake.geometry import Cylinder, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    Frame,
    RigidBody,
    SpatialInertia,
    UnitInertia,
)

from tetra_drake.laws import cable, kinematics
from tetra_drake.laws.model import WORLD, AnchorSprings, Couplings, Joints, NodeLoads
from tetra_drake.laws.struts import Struts
from tetra_drake.robot.bodies import body_inertias, strut_pose
from tetra_drake.scenario.blueprint import Blueprint

if TYPE_CHECKING:
    from tetra_drake.robot.equilibrium import Equilibrium

STRUT_COLOUR, NODE_COLOUR = (0.33, 0.55, 0.72, 1.0), (0.13, 0.15, 0.18, 1.0)
PASSIVE_COLOUR, ACTUATED_COLOUR = (0.0, 0.62, 0.45, 1.0), (0.76, 0.09, 0.36, 1.0)
"""Colours of struts, spheres and cables in Drake's SceneGraph and in files for simulators."""
SLENDERNESS = 100.0
"""Size of a robot without struts, divided by the least radius that is shown."""


@dataclass(frozen=True, kw_only=True)
class Structure(Blueprint):
    """A blueprint whose bodies have masses, inertias and poses at t = 0: rigid bodies joined by
    cables; SI units. A body consists of struts between nodes."""

    p_BN: np.ndarray
    """Positions of the nodes (nodes, 3) in the frames of their bodies; of fixed nodes in the world.
    The origin of a frame is the body's centre of mass."""
    mass: np.ndarray
    """Masses (bodies,)."""
    unit_inertia: np.ndarray
    """Unit inertias (bodies, 6) in m²: xx, yy, zz, xy, xz, yz of each body about its origin, in its
    frame, divided by its mass."""
    p_WB: np.ndarray
    """Positions of the bodies (bodies, 3) at t = 0."""
    q_WB: np.ndarray
    """Quaternions of the bodies (bodies, 4) at t = 0, w first."""
    v_WB: np.ndarray | None = None
    """Angular velocities (rad/s) and velocities (m/s) of the bodies (bodies, 6) at t = 0. None if
    they rest."""
    equilibrium: Equilibrium | None = None
    """Equilibrium at the start, before offsets and slope. None if the structure starts where its
    blueprint places it."""

    @classmethod
    def of(cls, blueprint: Blueprint) -> Self:
        """The structure of a blueprint, at the blueprint's positions. The frames of the bodies have
        the axes of the world."""
        mass, p_FB, unit_inertia = body_inertias(blueprint)
        given = {one.name: getattr(blueprint, one.name) for one in dataclasses.fields(Blueprint)}
        return cls(
            **given,
            p_BN=blueprint.p_FN - np.vstack([p_FB, np.zeros(3)])[blueprint.carriers],
            mass=mass,
            unit_inertia=unit_inertia,
            p_WB=blueprint.p_WF + p_FB,
            q_WB=np.tile([1.0, 0.0, 0.0, 0.0], (len(mass), 1)),
        )

    def turned(self, slope: float) -> Self:
        """A copy of the structure that stands on an incline as it did on flat ground. The incline
        rises by the angle `slope` (rad) along x, falls if it is negative. All bodies and their
        velocities are rotated about the world's y axis through the origin."""
        s, c = math.sin(slope / 2), math.cos(slope / 2)
        turn, v_WB = np.array([c, 0.0, -s, 0.0]), self.v_WB
        if v_WB is not None:
            v_WB = rotated(turn, v_WB.reshape(-1, 3)).reshape(-1, 6)
        # Written out, because processors round a product of matrices differently.
        w, x, y, z = self.q_WB.T
        q_WB = np.stack([c * w + s * y, c * x - s * z, c * y - s * w, c * z + s * x], axis=1)
        return dataclasses.replace(self, p_WB=rotated(turn, self.p_WB), q_WB=q_WB, v_WB=v_WB)

    @functools.cached_property
    def cables(self) -> np.ndarray:
        """Cables with their nodes, signals and constants: records (cables,) of
        laws.cable.cable_type(). Their `signal` is the index of the oscillator that drives the
        cable, or laws.cable.PASSIVE without actuator."""
        cables = cable.CableLaw.put(self.cable_laws, *self.cable_ends.T)
        for oscillator, driven in enumerate(self.groups):
            cables["signal"][list(driven)] = oscillator
        return cables

    @functools.cached_property
    def strut_table(self) -> Struts:
        """Struts as arrays for the kernels: nodes, lengths (m), radii (m)."""
        node_a, node_b = self.struts.T
        return Struts(
            node_a.copy(),
            node_b.copy(),
            place_a=self.places[node_a],
            place_b=self.places[node_b],
            first_strut=np.searchsorted(self.carriers[node_a], np.arange(len(self.bodies) + 1)),
            length=np.linalg.norm(self.p_BN[node_b] - self.p_BN[node_a], axis=1),
            radius=self.strut_radius,
        )

    @property
    def least_radius(self) -> float:
        """Radius (m) of the thinnest strut. Without struts it is a hundredth of the robot's largest
        extent along an axis. Shapes that are drawn have at least this radius."""
        radii = self.strut_radius
        return float(radii.min()) if radii.size else self.length / SLENDERNESS

    @property
    def radius(self) -> np.ndarray:
        """Radius (bodies,) in m of each body: the largest distance of its nodes from its centre of
        mass."""
        distances = np.linalg.norm(self.p_BN[: self.first_node[-1]], axis=1)
        return np.asarray(np.maximum.reduceat(distances, self.first_node[:-1]))

    def strut_name(self, strut: int) -> str:
        """Name of the strut with the index `strut`: the names of its two nodes, with a space in
        between."""
        return " ".join(self.node_names[node] for node in self.struts[strut])

    @property
    def couplings(self) -> Couplings:
        """Pairs of bodies that straight cables join, in the order of the cables, for kernels that
        go through the cables pair by pair. Raises ValueError if the cables of a pair are not next
        to each other, cables from fixed nodes are not first, or routed cables are not last."""
        straight = len(self.cable_ends) - len(self.cable_rings)
        pairs = self.carriers[self.cable_ends[:straight]]
        held = int(np.count_nonzero(pairs[:, 0] == WORLD))
        begins = held + np.flatnonzero(np.any(np.diff(pairs[held:], axis=0, prepend=-1), axis=1))
        first, second = pairs[begins].T
        is_ordered = (pairs[:held, 0] == WORLD).all() and (first < second).all()
        is_ordered &= min(self.cable_rings, default=straight) >= straight
        if not is_ordered or len(np.unique(pairs[held:], axis=0)) < len(begins):
            raise ValueError("the cables are not in the order of the bodies that they join")
        first_cable, held_bodies = np.append(begins, len(pairs)), pairs[:held, 1].copy()
        return Couplings(first.copy(), second.copy(), first_cable, held_bodies)

    @property
    def anchors(self) -> AnchorSprings:
        """Springs that hold nodes of bodies at their positions in the settings; only the nodes with
        such a spring."""
        nodes = np.flatnonzero(self.anchor_stiffness.any(axis=1))
        return AnchorSprings(
            nodes,
            carriers=self.carriers[nodes],
            places=self.p_WN[nodes],
            stiffness=self.anchor_stiffness[nodes],
            damping=self.anchor_damping[nodes],
        )

    @property
    def joint_springs(self) -> Joints:
        """Springs that hold the nodes of ball joints together, for kernels."""
        node_a, node_b = self.joints.T.copy()
        body_a, body_b = self.carriers[node_a], self.carriers[node_b]
        springs = self.joint_stiffness, self.joint_damping, self.joint_friction
        return Joints(node_a, node_b, body_a, body_b, *springs)

    @property
    def loads(self) -> NodeLoads:
        """The constant forces (N) on nodes from the settings; only the nodes with a load."""
        nodes = np.flatnonzero(self.node_load.any(axis=1))
        return NodeLoads(nodes, self.node_load[nodes])

    @functools.cached_property
    def node_shares(self) -> np.ndarray:
        """Factors of the nodes (nodes,), without unit, for the robot's centre of mass: in every
        pose of the bodies it is the sum of the node positions times these factors. They are 0 for
        fixed nodes, may be negative, and their sum is 1."""
        *of_bodies, fixed = np.split(self.p_BN, self.first_node[1:])
        shares = []
        for p_BN, mass in zip(of_bodies, self.mass, strict=True):
            # Weights with the sum 1, whose weighted sum of the nodes is the body's origin, the
            # centre of mass, or next to it where a given centre is beside all nodes.
            middle = p_BN.mean(axis=0)
            weights = 1.0 / len(p_BN) - np.linalg.lstsq((p_BN - middle).T, middle, rcond=1e-9)[0]
            # Rounded, because LAPACK's last digits depend on the processor.
            shares.append(mass * weights.round(12))
        return np.concatenate([*shares, np.zeros(len(fixed))]) / self.mass.sum()

    @property
    def isotropic(self) -> bool:
        """True if each body has the same moment of inertia about all axes, except for rounding."""
        moments, products = self.unit_inertia[:, :3], self.unit_inertia[:, 3:]
        allowed = 1e-12 * moments.max()
        return bool(np.ptp(moments, axis=1).max() <= allowed and abs(products).max() <= allowed)

    @property
    def initial_state(self) -> np.ndarray:
        """State [q; v] (13*bodies,) at t = 0."""
        poses = np.hstack([self.q_WB, self.p_WB]).ravel()
        velocities = np.zeros(6 * len(self.bodies)) if self.v_WB is None else self.v_WB.ravel()
        return np.concatenate([poses, velocities])

    @property
    def initial_lengths(self) -> np.ndarray:
        """Lengths of the cables (cables,) in m at t = 0."""
        node_a, node_b = node_positions(self, self.initial_state)[self.segments.ends.T]
        return self.along_cables(np.linalg.norm(node_b - node_a, axis=1))


def followed_nodes(p_WN: np.ndarray, structure: Structure) -> np.ndarray:
    """Positions in m of the points whose motion is shown: of the structure's markers (..., markers,
    3), which are some of the nodes p_WN (..., nodes, 3). Without markers it is the centre of mass
    (..., 1, 3)."""
    if structure.markers.size:
        return p_WN[..., structure.markers, :]
    return np.einsum("n,...na->...a", structure.node_shares, p_WN)[..., np.newaxis, :]


def node_positions(structure: Structure, state: np.ndarray) -> np.ndarray:
    """Positions p_WN (nodes, 3) of the nodes in m, for a state [q; v] (13*n,) of the n bodies."""
    return moved_nodes(structure, state)[:, kinematics.P_WN : kinematics.P_WN + 3]


def moved_nodes(structure: Structure, state: np.ndarray) -> np.ndarray:
    """Table `nodes` of laws.kinematics (nodes, NODE_COLUMNS) for a state [q; v] (13*n,) of the n
    bodies: positions (m) and velocities (m/s) in the world. Its columns of forces are 0."""
    nodes = np.empty((len(structure.node_names), kinematics.NODE_COLUMNS))
    kinematics.move_nodes(state, structure.p_BN, structure.first_node, nodes)
    return nodes


def with_origins(states: np.ndarray, p_BC: np.ndarray) -> np.ndarray:
    """States [q; v] (..., 13*n) of the same motion of n bodies, after the origins of their frames
    were moved to the points p_BC (n, 3) in m. Nothing is computed where no point is moved."""
    if not p_BC.any():
        return states
    bodies, xyz = np.arange(len(p_BC))[:, np.newaxis], np.arange(3)
    q, v = 7 * bodies, 7 * len(p_BC) + 6 * bodies
    p_BC_W, moved = rotated(states[..., q + np.arange(4)], p_BC), states.copy()
    moved[..., q + 4 + xyz] += p_BC_W
    moved[..., v + 3 + xyz] += np.cross(states[..., v + xyz], p_BC_W)
    return moved


def rotated(q: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Vectors p (..., 3) after rotations by quaternions q (..., 4), w first, of any length."""
    scalar, vector = q[..., :1], q[..., 1:]
    turn = 2.0 * np.cross(vector, p)
    turn /= scalar**2 + (vector**2).sum(axis=-1, keepdims=True)
    return np.asarray(p + scalar * turn + np.cross(vector, turn))


def turned_back(q: np.ndarray, p_W: np.ndarray) -> np.ndarray:
    """Vectors (..., 3) of the world in the frames of bodies with quaternions (..., 4), w first: the
    inverse of rotated()."""
    return rotated(q * [1.0, -1.0, -1.0, -1.0], p_W)


def AddBodies(plant: MultibodyPlant, structure: Structure) -> list[RigidBody]:
    """Adds the bodies of a structure, as free bodies, to a plant that is not finalized, and returns
    them in the structure's order. If the plant has a SceneGraph, struts and spheres are shown."""
    given = zip(structure.bodies, structure.mass, structure.unit_inertia, strict=True)
    bodies = [
        plant.AddRigidBody(name, SpatialInertia(mass, np.zeros(3), UnitInertia(*unit)))
        for name, mass, unit in given
    ]
    if plant.geometry_source_is_registered():
        for shape in shapes_of(structure):
            solid = Cylinder(shape.radius, shape.length) if shape.length else Sphere(shape.radius)
            body = bodies[shape.body]
            plant.RegisterVisualGeometry(body, shape.X_BS, solid, shape.name, shape.colour)
    return bodies


class Shape(NamedTuple):
    """Visible shape fixed to a body: a cylinder along the z axis of the shape's frame S, or a
    sphere about the origin of S."""

    name: str
    body: int
    X_BS: RigidTransform
    radius: float
    length: float
    """Length of the cylinder in m; 0 for a sphere."""
    colour: tuple[float, ...]


def shapes_of(structure: Structure) -> Iterator[Shape]:
    """Visible shapes of a structure: its struts as cylinders, then the spheres at its nodes."""
    table, p_BN = structure.strut_table, structure.p_BN
    for strut, (a, b) in enumerate(structure.struts):
        name, X_BS = f"strut {structure.strut_name(strut)}", strut_pose(p_BN[a], p_BN[b])
        size = table.radius[strut], table.length[strut]
        yield Shape(name, structure.carriers[a], X_BS, *size, STRUT_COLOUR)
    for node in np.flatnonzero(structure.node_radius):
        name, X_BS = f"sphere {structure.node_names[node]}", RigidTransform(p_BN[node])
        radius = structure.node_radius[node]
        yield Shape(name, structure.carriers[node], X_BS, radius, 0.0, NODE_COLOUR)


def AddNodes(
    plant: MultibodyPlant, structure: Structure, bodies: Sequence[RigidBody]
) -> list[Frame]:
    """Adds a frame "node NAME" for each node of a structure to a plant that is not finalized, and
    returns these frames. `bodies` are from AddBodies(); fixed nodes get frames of the world."""
    carriers = [*bodies, plant.world_body()]
    nodes = zip(structure.node_names, structure.carriers, structure.p_BN, strict=True)
    return [
        AddFrame(plant, f"node {name}", carriers[carrier].body_frame(), p_BN)
        for name, carrier, p_BN in nodes
    ]


def AddFrame(plant: MultibodyPlant, name: str, parent: Frame, p: npt.ArrayLike) -> Frame:
    """Adds a frame to a plant that is not finalized. The frame is fixed in `parent`, at the
    position p (3,) in m, with the axes of `parent`."""
    offset = RigidTransform(np.asarray(p, dtype=float))
    return plant.AddFrame(FixedOffsetFrame(name, parent, offset))


def node_motions(structure: Structure, state: np.ndarray, motions: np.ndarray) -> np.ndarray:
    """Displacements (k, nodes, 3) of a structure's nodes, in the world frame, for k small motions
    of its bodies (k, bodies, 6) from a state [q; v] (13*bodies,). A motion has a rotation vector
    (rad), then a translation (m), for each body. Fixed nodes do not move."""
    p_WN = node_positions(structure, state)
    p_WB = state[: 7 * len(structure.bodies)].reshape(-1, 7)[:, 4:]
    moved = np.zeros((len(motions), *p_WN.shape), dtype=motions.dtype)
    for body, p_WO in enumerate(p_WB):
        own = slice(structure.first_node[body], structure.first_node[body + 1])
        moved[:, own] = np.einsum(
            "nij,kj->kni", kinematics.rigid_motions(p_WN[own] - p_WO), motions[:, body]
        )
    return moved
