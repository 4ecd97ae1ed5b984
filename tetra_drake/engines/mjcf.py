"""Model of a robot and its ground for MuJoCo, in MuJoCo's XML format MJCF.

Bodies, cables, actuation and gravity are the same as in the other engines; for the ground see
engines.mujoco.
"""

from __future__ import annotations

import itertools
import math
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
from pydrake.multibody.tree import RotationalInertia

from tetra_drake.errors import InputError
from tetra_drake.laws.actuator import has_drive
from tetra_drake.laws.cable import tendon_coefficients, tendon_faults
from tetra_drake.laws.contact import NormalForce
from tetra_drake.laws.dry_friction import SPIN_CREEP
from tetra_drake.laws.inertia import XX
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import (
    ACTUATED_COLOUR,
    NODE_COLOUR,
    PASSIVE_COLOUR,
    STRUT_COLOUR,
    Structure,
    turned_back,
)
from tetra_drake.robot.xml_elements import add_comment, add_element, xml_text
from tetra_drake.scenario.engine_kinds import Mujoco
from tetra_drake.scenario.events import up_to_each
from tetra_drake.scenario.world import World

_IMPRATIO = 1000.0
"""MuJoCo's option impratio: the ratio of the impedances of friction and normal force. In MuJoCo the
normal force on a slipping node grows by 1 / impratio of the force that would hold the node. With
the default 1, nodes are thrown up and chatter."""
_IMPEDANCE = 1.0 / (1.0 + _IMPRATIO)
"""Impedance of contacts. It adds inertia to a contact: the body's mass along the ground, which
keeps friction stable in long steps, and 1 / _IMPRATIO of the mass along the normal."""
_IMPACT_SPEED = 1.0  # m/s
_POINT = 1e-8
"""Radius (m) of the spheres that touch the floor in place of points. Radii of feet are larger by
it, and the floor is lower."""
LEAST_MOMENT = 1e-14
"""Least principal moment of inertia (kg m²) of a body in MuJoCo: mjEPS of its compiler."""
_LEAST_FRICTION = 1e-5
"""Least coefficient of friction in MuJoCo. MJX has no contacts without friction (condim 1) beside
elliptic cones."""
_ALONG, _ABOUT = np.split(np.eye(6), 2)
"""Gears of actuators (3, 6) along axes, and about axes."""
_ALONE = {"contype": "0", "conaffinity": "0"}  # only the pairs in `contact` can touch
_SOFT = {"condim": "3", "solimp": [_IMPEDANCE, _IMPEDANCE, 1, 0.5, 1]}
"""Settings of all contacts."""


def check_mjcf(scenario: World) -> None:
    """Raises InputError, which names the scenario's key, if MuJoCo cannot simulate the scenario's
    terrain or its law of friction."""
    if scenario.terrain.plane_slope is None:
        kind = type(scenario.terrain).__name__
        problem = f"found !{kind}, but mujoco simulates only planes, or no ground"
        raise InputError(scenario.name, "terrain", problem)
    for events in ([], *up_to_each(scenario.events)):
        after = scenario.after(events)
        after.friction.cone(scenario.name)  # raises InputError for a law without a cone


def make_mjcf(robot: Robot, *, rest: np.ndarray | None = None, own_laws: bool = False) -> str:
    """MJCF text of a robot's MuJoCo model: a tendon for each cable and a motor for each driven one.

    If actuators bear the whole tension, tendons have no springs: a motor for each cable exerts its
    tension. Motors are in the order of their cables. The motor of a driven cable has the name of
    the oscillator that drives the cable; if this drives several cables, the name of the cable is
    added. The motor of another cable has the cable's name.

    Args:
        robot: the robot at its start.
        rest: state [q; v] (13*bodies,) that becomes a key frame with the name `rest`, beside which
            there is a key frame `start` if the settings have a `start`. Without it there is a key
            frame `start` if the robot moves.
        own_laws: True for an engine that computes contacts of struts by its own law, and tensions
            where is_pulled() is true. The model then leaves these to the engine.

    Raises:
        InputError: if MuJoCo does not know the terrain or the friction.
    """
    scenario = robot.scenario
    check_mjcf(scenario)
    model = Element("mujoco", model=scenario.name)
    pulled = is_pulled(robot) if own_laws else not scenario.actuation.keeps_spring
    integrator, step = integrator_of(robot, pulled=pulled), scenario.settings_of(Mujoco).step
    steps = {"integrator": integrator, "timestep": step}
    add_element(model, "compiler", inertiafromgeom="false")
    contact = {"cone": "elliptic", "impratio": _IMPRATIO}
    add_element(model, "option", gravity=[0.0, 0.0, -scenario.robot.gravity], **contact, **steps)
    if not own_laws and (remark := loose_remark(robot)):
        add_comment(model, remark)
    world = add_element(model, "worldbody")
    if scenario.terrain.is_ground:
        slope = scenario.terrain.plane_slope or 0.0
        pos = [_POINT * math.sin(slope), 0.0, -_POINT * math.cos(slope)]
        quat = [math.cos(slope / 2), 0.0, -math.sin(slope / 2), 0.0]
        floor = {"name": "floor", "type": "plane", "size": "0 0 1", "pos": pos, "quat": quat}
        add_element(world, "geom", **floor, **_ALONE)
    structure = robot.structure
    for node in range(structure.first_node[-1], len(structure.node_names)):  # fixed nodes
        add_element(world, "site", name=structure.node_names[node], pos=structure.p_BN[node])
    _add_bodies(model, world, robot)
    moving = structure if rest is None or not scenario.robot.start else Robot.of(scenario).structure
    states = {"rest": rest, "start": None if moving.v_WB is None else moving.initial_state}
    for name, state in states.items():
        if state is not None:
            _add_key(model, structure, name, state)
    if robot.model.strut_contact.acts and not own_laws:
        _add_strut_contacts(model, robot)
    _add_cables(model, robot, pulled=pulled)
    _add_joints(model, structure, step=step)
    _add_pushes(model, world, structure)
    _check_names(model, scenario.name)
    return xml_text(model)


def _check_names(model: Element, source: str) -> None:
    """Raises InputError, naming `source`, for a name that MuJoCo refuses: two things of a kind may
    not have it, and a body may not be the world."""
    seen = {("body", "world")}
    for element in model.iter():
        kind = "actuator" if element.tag in ("motor", "general") else element.tag
        if (name := element.get("name")) is not None:
            if (kind, name) in seen:
                raise InputError(source, "robot", f"mujoco cannot have another {kind} '{name}'")
            seen.add((kind, name))


def is_pulled(robot: Robot) -> bool:
    """True if MuJoCo's tendons cannot exert the tensions. Then this package computes them, and
    motors exert them.

    This is so if actuators have states of their own (winches and tension motors), if driven cables
    go slack, or if tendon_faults() finds a cable.
    """
    structure = robot.structure
    faults = tendon_faults(structure.cables, slack=structure.slack).values()
    loosens = structure.slack and robot.driven.size > 0
    return has_drive(robot.model.actuator) or loosens or any(cables.any() for cables in faults)


def loose_remark(robot: Robot) -> str:
    """Remark on differences between MuJoCo's tendons and the robot's cables, with names of such
    cables; "" if there are none. See tendon_faults() of laws.cable."""
    structure = robot.structure
    rubs = ", ".join(key for key in structure.rubbing if key not in structure.joint_keys)
    remarks = [f"friction at rings, left out: {rubs}"] if rubs else []
    if not robot.scenario.actuation.keeps_spring:
        return "".join(remarks)
    for fault, cables in tendon_faults(structure.cables, slack=structure.slack).items():
        names = [name for name, has_it in zip(structure.cable_names, cables, strict=True) if has_it]
        some = ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
        remarks += [f"{fault}: {some}"] if names else []
    return "; ".join(remarks)


def integrator_of(robot: Robot, *, pulled: bool) -> str:
    """Name of MuJoCo's integrator for a robot: implicitfast, but Euler if its tendons are damped.

    With `pulled`, motors exert the tensions, so that no tendon is damped; see is_pulled().

    The implicit integrators know how a damper's force on a body depends on this body's velocity,
    but not on the other body's. Damped tendons would brake the robot as if their other ends were
    fixed: in steps of 0.125 ms, the mast would fall with 0.76 g.
    """
    has_dampers = robot.structure.cables["damping"].any() and not pulled
    return "Euler" if has_dampers else "implicitfast"


def _add_bodies(model: Element, world: Element, robot: Robot) -> None:
    """Adds the bodies: a site at each node, shown at least as thick as the thinnest strut; a sphere
    at each contact node, its foot; and struts."""
    structure, bodies = robot.structure, robot.model.bodies
    radii = structure.node_radius.clip(min=structure.least_radius)
    pairs = add_element(model, "contact")
    for i, body_name in enumerate(structure.bodies):
        pos, quat = structure.p_WB[i], structure.q_WB[i]
        body = add_element(world, "body", name=body_name, pos=pos, quat=quat)
        add_element(body, "freejoint")
        mass, inertia = bodies.mass[i], bodies.inertia[i]
        principal = np.linalg.eigvalsh(RotationalInertia(*inertia).CopyToFullMatrix3())
        nodes = range(structure.first_node[i], structure.first_node[i + 1])
        is_bar = _bar_axis(structure, i).any()
        if is_bar:
            # A bar gets a larger moment of inertia about its axis: the same as across it. A spin
            # about the axis moves no node; bars start without it, and cables cause none. But
            # MuJoCo's contact points are above the nodes by half the depth, so friction would soon
            # spin a thin bar.
            moments = {"diaginertia": 3 * [principal[-1]]}
        elif structure.isotropic:
            moments = {"diaginertia": 3 * [inertia[XX]]}
        else:
            moments = {"fullinertia": inertia}
        least = principal[-1 if is_bar else 0]
        if least < LEAST_MOMENT:
            found = f"'{body_name}' has a moment of inertia of {least:.3g} kg m^2"
            problem = f"{found}, but mujoco takes at least {LEAST_MOMENT:g}"
            raise InputError(robot.scenario.name, "robot", problem)
        add_element(body, "inertial", pos="0 0 0", mass=mass, **moments)
        contact = _contact(robot, mass)
        for node in nodes:
            name, p_BN = structure.node_names[node], structure.p_BN[node]
            add_element(body, "site", name=name, pos=p_BN, size=radii[node], rgba=NODE_COLOUR)
            if node in structure.contacts:
                size = structure.contact_radius[node] + _POINT
                foot = f"foot {name}"
                add_element(body, "geom", name=foot, pos=p_BN, size=size, **_ALONE)
                add_element(pairs, "pair", geom1="floor", geom2=foot, **contact)
        for strut in np.flatnonzero(structure.carriers[structure.struts[:, 0]] == i):
            ends = structure.p_BN[structure.struts[strut]]
            size = structure.strut_radius[strut]
            geom = {"name": f"strut {strut}", "type": "capsule", "fromto": ends, "size": size}
            add_element(body, "geom", **geom, rgba=STRUT_COLOUR, **_ALONE)


def _bar_axis(structure: Structure, body: int) -> np.ndarray:
    """Unit vector (3,) along a body that is a bar, in the body's frame; zero for other bodies."""
    first, end = structure.first_node[body : body + 2]
    feet = np.intersect1d(range(first, end), structure.contacts).astype(int)
    if end - first != 2 or structure.contact_radius[feet].any() or body in structure.given_inertia:
        return np.zeros(3)
    length = structure.p_BN[end - 1] - structure.p_BN[first]
    return np.asarray(length / np.linalg.norm(length))


def _add_key(model: Element, structure: Structure, name: str, state: np.ndarray) -> None:
    """Adds a key frame for a state [q; v] (13*bodies,). Bars do not spin about their axes."""
    poses, velocities = np.split(state, [7 * len(structure.bodies)])
    q_WB, p_WB = np.split(poses.reshape(-1, 7), [4], axis=1)
    w_WB, v_WB = np.split(velocities.reshape(-1, 6), 2, axis=1)
    w_WB_B = turned_back(q_WB, w_WB)
    axes = np.array([_bar_axis(structure, body) for body in range(len(structure.bodies))])
    w_WB_B = w_WB_B - axes * (axes * w_WB_B).sum(axis=1, keepdims=True)
    motion = {"qvel": np.hstack([v_WB, w_WB_B])} if velocities.any() else {}
    keys = add_element(model, "keyframe")
    add_element(keys, "key", name=name, qpos=np.hstack([p_WB, q_WB]), **motion)


def _contact(robot: Robot, mass: float) -> dict:
    """Attributes of an MJCF contact pair of the floor and a node of a body of this mass (kg)."""
    ground, structure = robot.scenario.ground, robot.structure
    cone = robot.scenario.friction.cone(robot.scenario.name)
    # Nodes that bear the weight are as in the blueprint, or in equilibrium if there is one.
    known, at_rest = structure.feet, structure.equilibrium
    borne = robot.weight / max(1, known or (at_rest.feet if at_rest else len(structure.contacts)))
    rest_damping = ground.damping * borne / ground.stiffness
    # MuJoCo's numbers are per mass, divided by 1 - impedance, and for friction multiplied by
    # impratio. Negative numbers mean stiffness and damping.
    per_mass = -(1.0 - _IMPEDANCE) / mass
    return {
        **_SOFT,
        "friction": [cone.coefficient, cone.coefficient, 0, 0, 0],
        "solref": [ground.stiffness * per_mass, rest_damping * per_mass],
        "solreffriction": [ground.stiffness * per_mass, cone.damping * per_mass / _IMPRATIO],
    }


def _add_strut_contacts(model: Element, robot: Robot) -> None:
    """Adds contacts between all struts of different bodies, with the least friction that MuJoCo
    takes.

    The damping of a contact is constant; the other engines' damping grows with depth. It is chosen
    so that both take the same energy from a weakly damped impact at 1 m/s between the middles of
    struts.
    """
    normal = NormalForce(*robot.model.strut_contact.normal)
    add_comment(model, f"the struts' damping is right for impacts at {_IMPACT_SPEED:g} m/s")
    bodies = robot.structure.carriers[robot.structure.struts[:, 0]]
    pairs, friction = add_element(model, "contact"), [_LEAST_FRICTION, _LEAST_FRICTION, 0, 0, 0]
    places = robot.structure.places[robot.structure.struts]
    for i, j in itertools.combinations(range(len(bodies)), 2):
        if bodies[i] == bodies[j] or np.isin(places[i], places[j]).any():
            continue
        per_mass = (1.0 / robot.structure.mass[bodies[[i, j]]]).sum()
        depth = 4.0 / (3.0 * math.pi) * _IMPACT_SPEED / math.sqrt(normal.stiffness * per_mass)
        scale = -(1.0 - _IMPEDANCE) * per_mass
        solref = [normal.stiffness * scale, normal.damping * depth * scale]
        ends = {"geom1": f"strut {i}", "geom2": f"strut {j}"}
        add_element(pairs, "pair", **ends, friction=friction, solref=solref, **_SOFT)


def _add_cables(model: Element, robot: Robot, *, pulled: bool) -> None:
    """Adds a tendon for each cable and a motor for each driven cable. With `pulled`, tendons exert
    no force, and there is a motor for each cable, which exerts its whole tension."""
    structure, motors = robot.structure, {}
    for oscillator, group in zip(structure.oscillators, structure.groups, strict=True):
        for cable in (structure.cable_names[i] for i in group):
            motors[cable] = oscillator if len(group) == 1 else f"{oscillator} {cable}"
    tendons, actuators = add_element(model, "tendon"), add_element(model, "actuator")
    width = structure.least_radius / 2
    for number, cable in enumerate(structure.cables):
        name = structure.cable_names[number]
        coefficients = tendon_coefficients(cable["curve"]) or cable["stiffness"]
        law = {"stiffness": coefficients, "damping": cable["damping"]}
        least = 0.0 if structure.slack else cable["free_length"]
        springlength = [least, cable["free_length"]]  # the spring exerts no force in between
        colour = ACTUATED_COLOUR if name in motors else PASSIVE_COLOUR
        own = {} if pulled else {"springlength": springlength, **law}
        tendon = add_element(tendons, "spatial", name=name, width=width, rgba=colour, **own)
        for node in (cable["node_a"], *structure.cable_rings.get(number, ()), cable["node_b"]):
            add_element(tendon, "site", site=structure.node_names[node])
        if pulled or name in motors:
            motor = motors.get(name, name)
            # A motor's force lengthens its tendon, ours shortens it; a cut cable has none.
            gear = f"{-cable['intact']:g}"
            add_element(actuators, "motor", name=motor, tendon=name, gear=gear)


def _add_pushes(model: Element, world: Element, structure: Structure) -> None:
    """Adds MuJoCo actuators: one for each axis of an anchor, which holds a node by a damped spring,
    one for each component of a load, a constant force on a node, and three dampers with the torque
    limit of each joint with friction, about the axes of its first body."""
    actuators, anchors, loads = add_element(model, "actuator"), structure.anchors, structure.loads
    laws = np.stack([0.0 * anchors.stiffness, -anchors.stiffness, -anchors.damping], axis=2)
    for node, place, of_axes in zip(anchors.nodes, anchors.places, laws, strict=True):
        name = structure.node_names[node]
        add_element(world, "site", name=f"anchor {name}", pos=place)
        _add_push(actuators, f"anchor {name}", of_axes, site=name, refsite=f"anchor {name}")
    for node, force in zip(loads.nodes, loads.forces, strict=True):
        name, of_axes = structure.node_names[node], np.outer(force, [1.0, 0.0, 0.0])
        add_element(world, "site", name=f"load {name}", pos=np.zeros(3))
        _add_push(actuators, f"load {name}", of_axes, site=name, refsite=f"load {name}")
    for (first, second), limit in zip(structure.joints, structure.joint_friction, strict=True):
        of_axes = np.tile([0.0, 0.0, -limit / SPIN_CREEP], (3, 1))
        ends = {"site": structure.node_names[second], "refsite": structure.node_names[first]}
        name = f"friction {ends['refsite']} {ends['site']}"
        _add_push(actuators, name, of_axes, axes=_ABOUT, **ends, forcerange=[-limit, limit])


def _add_joints(model: Element, structure: Structure, *, step: float) -> None:
    """Adds a constraint for each joint that holds its nodes together with the joint's stiffness K
    and damping C.

    MuJoCo's constraint with the constants k and b, the impedance d and the inverse mass A of both
    bodies exerts the force -d / ((1 - d) A) (k x + b v + a), with the displacement x of the nodes,
    its rate v and its acceleration a, which hardly acts in a stiff joint. Here k is a quarter of
    the largest one that is stable in explicit steps.
    """
    constraints, joints = add_element(model, "equality"), structure.joint_springs
    for first, second, body_a, body_b, stiffness, damping, _ in zip(*joints, strict=True):
        time_constant = damping / stiffness
        k = 1.0 / (step * (step + 2.0 * time_constant))
        per_mass = 1.0 / structure.mass[body_a] + 1.0 / structure.mass[body_b]
        impedance = stiffness * per_mass / (k + stiffness * per_mass)
        ends = {"site1": structure.node_names[first], "site2": structure.node_names[second]}
        solref = [-k * impedance, -k * time_constant * impedance]
        solimp = [impedance, impedance, 1, 0.5, 1]
        add_element(constraints, "connect", **ends, solref=solref, solimp=solimp)


def _add_push(
    actuators: Element, name: str, laws: np.ndarray, axes: np.ndarray = _ALONG, **settings: Any
) -> None:
    """Adds MuJoCo actuators that push a site along the axes of another site, and this the other
    way; one for each axis whose law is not zero.

    `laws` (3, 3) has a row per axis: a constant force (N), the force per displacement in N/m, and
    the force per velocity in N s/m. A spring and a damper have negative numbers. With `_ABOUT` as
    `axes`, they are torques. `settings` are the sites `site` and `refsite`, and others in MJCF.
    """
    for axis, gear, law in zip("xyz", axes, laws, strict=True):
        if law.any():
            force = {"gear": gear, "gainprm": "0", "biastype": "affine", "biasprm": law}
            add_element(actuators, "general", name=f"{name} {axis}", **force, **settings)
