"""Remarks on settings with which a robot hardly moves, sinks in, or asks too much of actuators.

Each remark is a text without a full stop; it is empty if there is nothing to remark.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from tetra_drake.errors import InputError
from tetra_drake.formatting import rounded
from tetra_drake.laws import cable
from tetra_drake.robot.equilibrium import Equilibrium
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import node_positions
from tetra_drake.scenario.blueprint import SAGS
from tetra_drake.scenario.metrics import looks_for_distance

LEAST_MOTION = 0.01
"""Least change of a cable's length that signals should cause, as a share of the length."""
STILL = 0.1
"""Distance that a robot should move, as a share of its length."""
BINDS = 0.5
"""Share of the time from which on a limit of the actuators is a reason for hardly moving."""
SINKS, BEARS = 0.03, 0.01
"""Depths of a robot at rest in its ground, as shares of its height: from SINKS on it is too deep;
BEARS is usual in a ground that is stiff enough."""
YIELDS = 0.01
"""Displacement of an anchor or joint that is too soft, as a share of the stretch of cables."""

ASIDE = 1e-3
"""Distance of the centre of mass from the point that metrics follow, as a share of the length."""


def gain_remark(robot: Robot) -> str:
    """Remark on a `cpg.gain` (N) whose signals change the length of no cable by 1% (LEAST_MOTION),
    or exceed the limits of the actuators. It is "" if the gain is sensible."""
    cpg, driven = robot.scenario.cpg, robot.structure.cables[robot.driven]
    if not driven.size or robot.scenario.policy is not None:
        return ""
    signal, stretch = _usual_signal(robot)
    share = np.max(stretch / robot.structure.initial_lengths[robot.driven])
    if share < LEAST_MOTION:
        problem = f"move no cable by more than {share:.2g} of its length"
        if share > 0.0:
            enough = cpg.gain * LEAST_MOTION / share
            problem += f"; {enough:.3g} N would move one by {100.0 * LEAST_MOTION:g} %"
    else:
        least = np.min(driven["free_length"] - stretch)
        problem = robot.scenario.actuation.excess(signal, free_length=least)
    return f"with cpg.gain {cpg.gain:.3g} N signals {problem}" if problem else ""


def stillness_remark(robot: Robot, metrics: Mapping[str, float]) -> str:
    """Remark on a robot whose objective rewards a distance or rolling, but which moved by less than
    a tenth of its own length, with the likely reason. `metrics` are by name, in SI units. It is ""
    otherwise."""
    scenario, units = robot.scenario, robot.scenario.units
    distance, objective = metrics["distance"], scenario.objective
    is_to_move = looks_for_distance(objective) or objective.get("rolled", 0.0) > 0.0
    if not is_to_move or not abs(distance) < STILL * robot.structure.length:
        return ""
    remarks = [f"the robot moves {units.shown(distance, 'm')}, less than a tenth of its length"]
    if scenario.policy is None:
        _, stretch = _usual_signal(robot)
        signals = f"signals with cpg.gain {units.shown(scenario.cpg.gain, 'N')}"
        most = units.shown(stretch.max(initial=0.0), "m")
        remarks.append(gain_remark(robot) or f"{signals} stretch cables by {most} at most")
    if metrics["actuator_limited"] > BINDS:
        share = 100.0 * metrics["actuator_limited"]
        remarks.append(f"a limit of the actuators binds {share:.0f} % of the time")
    return "; ".join(remarks)


def start_up_remark(robot: Robot) -> str:
    """Remark on a simulation that ends by the start-up time `cpg.start_up`, before which signals
    are zero, so no cable is ever actuated. It is "" otherwise."""
    start_up, duration = robot.scenario.cpg.start_up, robot.scenario.simulation.duration
    if start_up < duration or robot.scenario.policy is not None:
        return ""
    return f"within {duration:g} s no cable is actuated, as cpg.start_up is {start_up:g} s"


def sinking_remark(robot: Robot) -> str:
    """Remark on a robot that sinks into its ground at rest by more than 3% of its height (SINKS).
    It names a ground stiffness that would bear the robot. It is "" otherwise, and without an
    equilibrium."""
    structure, units, ground = robot.structure, robot.scenario.units, robot.scenario.ground
    equilibrium = _equilibrium(robot) if structure.contacts.size else None
    if equilibrium is None:
        return ""
    z = node_positions(structure, equilibrium.state)[:, 2]
    radius, contacts = structure.contact_radius, structure.contacts
    depth = (radius - z)[contacts].max()
    height = (z + radius).max() - (z - radius).min() or 2.0 * structure.least_radius
    if depth <= SINKS * height:
        return ""
    needed = units.shown(ground.stiffness * depth / (BEARS * height), "N/m")
    sinks = f"the robot sinks into its ground by {units.shown(depth, 'm')}"
    return f"{sinks}; a ground.stiffness of {needed} would bear it"


def yielding_remark(robot: Robot) -> str:
    """Remark on the anchor or joint that gives way most at rest, if by more than 1% (YIELDS) of the
    mean stretch of the cables, or by 0.1% where its default is bounded. It names a stiffness that
    would hold it. It is "" otherwise, and without an equilibrium."""
    structure, units, cables = robot.structure, robot.scenario.units, robot.structure.cables
    anchors, joints = structure.anchors, structure.joint_springs
    names = [f"anchors.{structure.node_names[node]}" for node in anchors.nodes]
    names += structure.joint_keys
    equilibrium = _equilibrium(robot) if names and cables.size else None
    if equilibrium is None:
        return ""
    p_WN = node_positions(structure, equilibrium.state)
    moved = (p_WN[anchors.nodes] - anchors.places) * (anchors.stiffness > 0.0)
    ways = np.linalg.norm([*moved, *(p_WN[joints.node_b] - p_WN[joints.node_a])], axis=1)
    tension = np.maximum(equilibrium.lengths - cables["free_length"], 0.0) @ cables["stiffness"]
    stretch = tension / cables["stiffness"].sum() or 2.0 * SAGS * structure.length / YIELDS
    most = int(ways.argmax())
    way, own = ways[most], [*anchors.stiffness.max(axis=1), *joints.stiffness][most]
    firm, bound = structure.firm_stiffness(robot.scenario.robot.gravity)
    is_bound = own == bound < firm
    if way <= (0.1 if is_bound else 1.0) * YIELDS * stretch:
        return ""
    needed = units.shown(firm if own < firm else own * way / (0.1 * YIELDS * stretch), "N/m")
    share = f"{rounded(100.0 * way / stretch, 2)} % of the" if tension else "without"
    gives = f"at rest {names[most]} gives way by {units.shown(way, 'm')}, {share} stretch of cables"
    light = ", but with shorter steps" if is_bound else ""
    return f"{gives}; {needed} would hold it{light}"


def centre_remark(robot: Robot) -> str:
    """Remark on a robot whose metrics and traces miss its centre of mass by 0.1% (ASIDE) of its
    length, since they follow the nodes, and a given centre is not between these. It is ""
    otherwise."""
    structure = robot.structure
    followed = structure.node_shares @ node_positions(structure, structure.initial_state)
    centre = structure.mass @ structure.p_WB / structure.mass.sum()
    if (aside := math.dist(followed, centre)) <= ASIDE * structure.length:
        return ""
    way = robot.scenario.units.shown(aside, "m")
    return f"metrics and traces follow a point {way} from the centre of mass; more nodes show it"


def overload_remark(robot: Robot, tensions: np.ndarray) -> str:
    """Remark on the cable whose tension, of the greatest `tensions` (cables,) in N, exceeds its
    limit most; see `max_tension` and `max_stretch` of cables. It is "" if none does."""
    limits, units = robot.structure.cable_limits, robot.scenario.units
    if not limits.size or (tensions <= limits).all():
        return ""
    most = int((tensions / limits).argmax())
    reached, limit = (units.shown(x[most], "N") for x in (tensions, limits))
    return f"{robot.structure.cable_names[most]} reaches {reached}, its limit is {limit}"


def _equilibrium(robot: Robot) -> Equilibrium | None:
    """The equilibrium of a robot; None if it has none."""
    try:
        return robot.equilibrium
    except InputError:
        return None


def _usual_signal(robot: Robot) -> tuple[float, np.ndarray]:
    """Typical amplitude (N) of a network's signals, and the elastic stretch (driven cables,) in m
    of each driven cable under a force of this size."""
    cpg, law = robot.scenario.cpg, cable.CableLaw.of(robot.structure.cables[robot.driven])
    signal = cpg.usual_amplitude
    return signal, np.asarray(cable.elastic_stretch(signal, law))
