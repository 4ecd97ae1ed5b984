"""The same robot in MuJoCo (https://mujoco.org), as one of its users would model it.

Bodies, cables, actuation and gravity are ours, save that cables never go slack. The ground is
MuJoCo's soft contact with a cone of friction, calibrated as closely as that allows:

- The normal force has our stiffness, but a constant damping: ours at the depth of rest. Our
  damping grows with depth, from none at the surface.
- A node that sticks is held by our viscous stiction damping, but breaks free where that exceeds
  a coefficient of friction times the normal force; ours breaks free after a way, the stiction
  range, whatever the normal force, and then slides almost freely.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from xml.etree import ElementTree

import numpy as np

from tetra_drake.physics.cable import PASSIVE
from tetra_drake.robot.bodies import tetrahedron_inertia
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.signals import signal_samples
from tetra_drake.robot.structure import BOTTOM_LEFT, MakeStructure, Structure
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.units import INCH

INSTALL = 'pip install "mujoco>=3.13"'
"""The first version with the integrator `discrete`."""

FRICTION = 0.5
"""The coefficient of friction, as of metal on a floor. To calibrate it makes no sense: with
0.03, 0.1, 0.2, 0.35, 0.5, 1 and 2, random gaits end 2.4 to 3.7 in (median) from where ours do."""

_IMPEDANCE = 0.5
"""Of contacts. Nothing at rest depends on it, nor do converged distances by more than 0.01 in;
with a smaller one friction chatters in steps beyond 0.06 ms, with a larger one errors grow."""

_POINT = 1e-5
"""Radius (m) of the spheres that touch the floor: the ground acts on the centre of a node."""

_MAX_SPEED = 1.0
"""Of a body (m/s); who is faster has been thrown about by an unstable step. In a walking robot
it is below 0.2 m/s."""

_STRETCH = 1.0
"""Simulated time (s) between two looks at whether a simulation is still stable."""


def installed() -> bool:
    """Whether there is a MuJoCo that has the integrators that are measured."""
    try:
        import mujoco.rollout
    except ImportError:
        return False
    return hasattr(mujoco.mjtIntegrator, "mjINT_DISCRETE")


def make_mjcf(scenario: Scenario, *, integrator: str, step: float) -> str:
    """The robot of a scenario in MuJoCo's format, with one motor a driven cable.

    `integrator` by MuJoCo's name of it, `step` in s.
    """
    structure = MakeStructure(scenario.robot, scenario.cables)
    model = ElementTree.Element("mujoco", model=scenario.name)
    _add(model, "compiler", inertiafromgeom="false")
    _add(
        model,
        "option",
        integrator=integrator,
        timestep=_text(step),
        gravity=_text(0.0, 0.0, -scenario.robot.gravity),
        cone="elliptic",
    )
    _add_bodies(model, scenario, structure)
    _add_cables(model, structure)
    return ElementTree.tostring(model, encoding="unicode")


def _add_bodies(model: ElementTree.Element, scenario: Scenario, structure: Structure) -> None:
    """The tetrahedra, with a site at each node, and the floor, which only contact nodes touch."""
    inertia = tetrahedron_inertia(structure)
    mass = inertia.get_mass()
    moments = mass * inertia.get_unit_inertia().get_moments()
    contact = _contact(scenario, structure, mass=mass)
    world, pairs = _add(model, "worldbody"), _add(model, "contact")
    alone = {"contype": "0", "conaffinity": "0"}  # only the pairs touch each other
    place = {"pos": _text(0.0, 0.0, -_POINT), "size": "0 0 1"}
    _add(world, "geom", name="floor", type="plane", **place, **alone)
    names = iter(enumerate(structure.node_names))
    for body_name, p_WB in zip(structure.bodies, structure.p_WB, strict=True):
        body = _add(world, "body", name=body_name, pos=_text(*p_WB))
        _add(body, "freejoint")
        _add(body, "inertial", pos="0 0 0", mass=_text(mass), diaginertia=_text(*moments))
        for p_BN in structure.p_BN:
            node, name = next(names)
            place = {"name": name, "pos": _text(*p_BN), "size": _text(_POINT)}
            _add(body, "site", **place)
            if node in structure.contacts:
                _add(body, "geom", **place, **alone)
                _add(pairs, "pair", geom1="floor", geom2=name, **contact)


def _contact(scenario: Scenario, structure: Structure, *, mass: float) -> dict[str, str]:
    """How the floor acts on a node of a body of `mass` (kg)."""
    ground = scenario.ground
    weight = mass * len(structure.bodies) * scenario.robot.gravity
    rest_damping = ground.damping * weight / len(structure.contacts) / ground.stiffness
    # MuJoCo wants accelerations for forces, and divides them by 1 - impedance.
    per_mass = (1.0 - _IMPEDANCE) / mass
    stiffness = -ground.stiffness * per_mass  # the signs tell it what kind of numbers these are
    return {
        "condim": "3",
        "friction": _text(FRICTION, FRICTION, 0.0, 0.0, 0.0),
        "solref": _text(stiffness, -rest_damping * per_mass),
        "solreffriction": _text(stiffness, -scenario.friction.stiction_damping * per_mass),
        "solimp": _text(_IMPEDANCE, _IMPEDANCE, 1.0, 0.5, 1.0),
    }


def _add_cables(model: ElementTree.Element, structure: Structure) -> None:
    """A tendon for each cable, and a motor for each that is driven."""
    tendons, actuators = _add(model, "tendon"), _add(model, "actuator")
    for name, cable in zip(structure.cable_names, structure.cables, strict=True):
        tendon = _add(
            tendons,
            "spatial",
            name=name,
            stiffness=_text(cable["stiffness"]),
            damping=_text(cable["damping"]),
            springlength=_text(cable["free_length"]),
        )
        for node in (cable["node_a"], cable["node_b"]):
            _add(tendon, "site", site=structure.node_names[node])
        if cable["signal"] != PASSIVE:  # a motor's force lengthens its tendon, ours shortens it
            _add(actuators, "motor", name=name, tendon=name, gear="-1")


def walk_in_mujoco(gait: Gait, *, scenario: Scenario, integrator: str, step: float) -> float:
    """How far (in) a gait goes in MuJoCo, in steps of `step` (s); NaN if that is unstable.

    `integrator` by MuJoCo's name of it. Other threads run meanwhile.
    """
    import mujoco
    from mujoco.rollout import Rollout

    mjcf = make_mjcf(scenario, integrator=integrator, step=step)
    model = mujoco.MjModel.from_xml_string(mjcf)
    data = mujoco.MjData(model)
    kind = mujoco.mjtState.mjSTATE_FULLPHYSICS  # time, positions, velocities
    state = np.empty(mujoco.mj_stateSize(model, kind))
    mujoco.mj_getState(model, data, state, kind)
    mujoco.mj_kinematics(model, data)
    start = data.site_xpos[BOTTOM_LEFT, 0]
    steps = max(1, round(scenario.simulation.duration / step))
    stretch = max(1, round(_STRETCH / step))
    control = control_signals(scenario, gait, step=step, steps=steps)
    with Rollout(nthread=0) as rollout:
        for i in range(0, steps, stretch):
            states, _ = rollout.rollout(model, data, state[None], control[None, i : i + stretch])
            state = states[0, -1]
            v_WB = states[0, :, 1 + model.nq :].reshape(-1, model.nbody - 1, 6)[:, :, :3]
            warned = any(warning.number for warning in data.warning)
            if warned or not np.abs(v_WB).max() <= _MAX_SPEED:
                return math.nan
    mujoco.mj_setState(model, data, state, kind)
    mujoco.mj_kinematics(model, data)
    return float(data.site_xpos[BOTTOM_LEFT, 0] - start) / INCH


def control_signals(scenario: Scenario, gait: Gait, *, step: float, steps: int) -> np.ndarray:
    """(steps, driven cables): the motors' forces in N at the start of each step."""
    structure = MakeStructure(scenario.robot, scenario.cables)
    samples = signal_samples(scenario, gait)
    times = step * np.arange(steps)
    grid = scenario.cpg.listing_step * np.arange(len(samples))
    signals = np.column_stack([np.interp(times, grid, column) for column in samples.T])
    signals[times < scenario.cpg.start_up - 0.5 * step] = 0.0
    driven = structure.cables["signal"]
    return signals[:, driven[driven != PASSIVE]]


@contextlib.contextmanager
def mujoco_kept_quiet() -> Iterator[None]:
    """Keeps MuJoCo from printing that a simulation is unstable, and from writing that to a log
    in the current folder."""
    import mujoco

    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda message: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)


def _add(parent: ElementTree.Element, tag: str, **attributes: str) -> ElementTree.Element:
    return ElementTree.SubElement(parent, tag, attributes)


def _text(*numbers: float) -> str:
    return " ".join(repr(float(number)) for number in numbers)
