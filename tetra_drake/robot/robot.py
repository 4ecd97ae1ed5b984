"""Robot of a scenario: structure, constants of the kernels, network, start."""

from __future__ import annotations

import dataclasses
import functools
import numbers
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Self

import numpy as np

from tetra_drake.errors import InputError
from tetra_drake.kernels.packed import Packed
from tetra_drake.laws import cable
from tetra_drake.laws.actuator import DrivenCables
from tetra_drake.laws.capsules import NearStruts, find_near_struts, find_touch
from tetra_drake.laws.contact import MODE_COLUMNS, Ground, NormalForce
from tetra_drake.laws.feedback import Senses
from tetra_drake.laws.forces import Forces
from tetra_drake.laws.mode_change import modes_after_step
from tetra_drake.laws.model import Bodies, Model
from tetra_drake.laws.oscillator import CpgSection, Network, steered_input
from tetra_drake.laws.terrain import Flat
from tetra_drake.robot.elastic_struts import axial_forces, elastic_struts, with_elongations
from tetra_drake.robot.equilibrium import Equilibrium, Unactuated, find_equilibrium
from tetra_drake.robot.gait import Gait, check_gait
from tetra_drake.robot.ground import START_DEPTH, make_ground
from tetra_drake.robot.structure import Structure, moved_nodes, node_positions, turn_with_slope
from tetra_drake.robot.weights import Weights
from tetra_drake.scenario.metrics import looks_for_distance
from tetra_drake.scenario.scenario import Scenario

AMPLITUDE = 0.5
"""Typical amplitude of y_extensor - y_flexor, as a share of u0; 0.44 to 0.53 in random gaits."""
LEAST_MOTION = 0.01
"""Least change of a cable's length that signals should cause, as a share of the length."""
STILL = 0.1
"""Distance that a robot should walk, as a share of its length."""
SINKS, BEARS = 0.03, 0.01
"""Depths of a robot in its ground, as shares of its height: too deep, and as deep as in a ground
that bears it."""
DEEPEST = 1e-3
"""Largest depth of a node in the ground at the start, as a share of the structure's height."""
MOST_CORRECTIONS = 100
"""Upper limit of the corrections of the lengths of elastic struts."""
SAME_LENGTH = 1e-10
"""Change (m) of a strut's length below which its correction ends."""
MEETING = 1e-12
"""Distance (m) of the axes of two struts up to which they meet, except for rounding."""
SteeringSignal = Callable[[float], float]
"""Function from time (s) to the turn, -1 to 1."""


@dataclass(frozen=True)
class Robot:
    """A robot on its ground, ready to be simulated."""

    scenario: Scenario
    structure: Structure
    model: Model
    """Constants of bodies, cables and ground, in the form of the kernels."""
    first_signals: np.ndarray
    """Signals (m,) in N at t = 0, which the actuators follow already."""

    @classmethod
    def of(cls, scenario: Scenario, structure: Structure | None = None) -> Self:
        """The robot of a scenario, by default with the scenario's structure.

        Raises InputError if it would start in the ground or outside its terrain.
        """
        structure = structure or make_structure(scenario)
        model = make_model(scenario, structure)
        return cls(scenario, structure, model, first_signals=np.zeros(structure.signals))

    @property
    def driven(self) -> np.ndarray:
        """Indices of the driven cables, oscillator by oscillator in the order of the scenario.
        Commands, actions and loads have this order."""
        groups = self.structure.groups
        return np.array([number for group in groups for number in group], dtype=np.int64)

    @property
    def cables_of_drives(self) -> np.ndarray:
        """Indices of the driven cables in the order of the structure's cables, as states of the
        actuators have it."""
        return np.sort(self.driven)

    @property
    def ground(self) -> Ground:
        """The ground under the robot."""
        return self.model.ground

    @property
    def weight(self) -> float:
        """Weight of the robot in N."""
        return float(self.structure.mass.sum()) * self.scenario.robot.gravity

    @functools.cached_property
    def equilibrium(self) -> Equilibrium:
        """Equilibrium of the robot on flat ground without actuation. The scenario's terrain and
        offsets are ignored. Raises InputError if there is no equilibrium."""
        if self.structure.equilibrium is not None:
            return self.structure.equilibrium
        return equilibrium_of(self.scenario, undisturbed_structure(self.scenario))

    @functools.cached_property
    def senses(self) -> Senses:
        """Constants of the oscillators' sensors. Raises InputError if there is no equilibrium."""
        return self.senses_of(self.scenario.cpg.feedback)

    def senses_of(self, pathways: Collection[str]) -> Senses:
        """As `senses`, for these pathways of feedback."""
        drivers = self.structure.drivers
        groups = drivers - cable.PASSIVE
        sizes = np.bincount(groups)[groups]  # of each cable's group
        neutral = self.equilibrium.lengths if "length" in pathways else np.ones(len(drivers))
        per_load = 1.0 / self.weight if "load" in pathways else 0.0
        return Senses(
            drivers=drivers,
            ahead=self.structure.ahead,
            carriers=self.ground.carriers,
            neutral_length=neutral,
            per_length=1.0 / (neutral * sizes),
            per_load=np.array([per_load]),
        )

    def network(self, gait: Gait) -> Network:
        """The network of a gait. Raises InputError if the gait does not fit the scenario."""
        cpg = self.scenario.cpg
        weights = Weights(self.structure, cpg.reach)
        check_gait(gait, self.scenario, weights, source=f"gait {gait.name}")
        neurons = np.arange(2 * self.structure.signals)
        inhibition = np.zeros((neurons.size, neurons.size))
        inhibition[neurons, neurons ^ 1] = cpg.partner_weight
        inhibition[tuple(weights.couplings.T)] = gait.weights
        return Network.of(
            inhibition,
            tau_a=gait.tau_a,
            tau_b=gait.tau_b,
            self_inhibition_weight=cpg.self_inhibition_weight,
        )

    def turns(self, gait: Gait, steering: SteeringSignal | None = None) -> np.ndarray:
        """The turns at multiples of `cpg.listing_step`. A single value without `steering`.

        Raises InputError if a turn is not between -1 and 1, or if the robot cannot be steered.
        """
        if steering is None:
            return np.array([gait.turn])
        if not self.structure.sides.any():
            raise InputError("steering", "", "no oscillator is on one side of the robot")
        step = self.scenario.cpg.listing_step
        times = step * np.arange(round(self.scenario.simulation.duration / step) + 1)
        return np.array([checked_turn(steering(time), time=time) for time in times.tolist()])

    def tonic_input(self, turns: np.ndarray) -> np.ndarray:
        """Input u0 of each neuron (..., 2m), for turns (...); see
        laws.oscillator.steered_input()."""
        sides, u0 = np.repeat(self.structure.sides, 2), self.scenario.cpg.external_input
        return np.asarray(steered_input(u0, turns[..., np.newaxis], sides))

    def gain_remark(self) -> str:
        """Warning if signals with this `cpg.gain` hardly move the cables, or exceed the limits of
        the actuators; empty if neither."""
        cpg, driven = self.scenario.cpg, self.structure.cables[self.driven]
        signal = self._usual_signal()
        moved = self._elastic_stretch(signal)
        share = np.max(moved / self.structure.initial_lengths[self.driven])
        if share < LEAST_MOTION:
            problem = f"move no cable by more than {share:.2g} of its length"
        else:
            least = np.min(driven["free_length"] - moved)
            problem = self.scenario.actuation.excess(signal, free_length=least)
        return f"with cpg.gain {cpg.gain:.3g} N signals {problem}" if problem else ""

    def stillness_remark(self, distance: float) -> str:
        """Remark on a robot that has walked a `distance` (m) of less than STILL of its length,
        although it was to walk; empty for another one."""
        scenario, units = self.scenario, self.scenario.units
        length = np.ptp(self.structure.p_WN, axis=0).max()
        if not looks_for_distance(scenario.objective) or not abs(distance) < STILL * length:
            return ""
        moved = np.max(self._elastic_stretch(self._usual_signal()))
        signals = f"signals with cpg.gain {units.shown(scenario.cpg.gain, 'N')}"
        way = f"walks {units.shown(distance, 'm')}, less than a tenth of its length"
        return f"the robot {way}; {signals} stretch cables by {units.shown(moved, 'm')} at most"

    def start_up_remark(self) -> str:
        """Warning if a simulation ends before the cables are actuated; empty if it does not."""
        start_up, duration = self.scenario.cpg.start_up, self.scenario.simulation.duration
        if start_up < duration:
            return ""
        return f"within {duration:g} s no cable is actuated, as cpg.start_up is {start_up:g} s"

    def sinking_remark(self) -> str:
        """Warning if the robot at rest is in its ground by more than SINKS of its height, with a
        stiffness that would bear it; empty if it is not, or if it has no equilibrium."""
        units, ground = self.scenario.units, self.scenario.ground
        if not self.structure.contacts.size:
            return ""
        try:
            z = node_positions(self.structure, self.equilibrium.state)[:, 2]
        except InputError:
            return ""
        radius, contacts = self.structure.contact_radius, self.structure.contacts
        depth = (radius - z)[contacts].max()
        height = (z + radius).max() - (z - radius).min() or 2.0 * self.structure.least_radius
        if depth <= SINKS * height:
            return ""
        needed = units.shown(ground.stiffness * depth / (BEARS * height), "N/m")
        sinks = f"the robot sinks into its ground by {units.shown(depth, 'm')}"
        return f"{sinks}; a ground.stiffness of {needed} would bear it"

    def _usual_signal(self) -> float:
        """Typical amplitude (N) of the signals."""
        cpg = self.scenario.cpg
        return abs(cpg.gain) * AMPLITUDE * cpg.external_input

    def _elastic_stretch(self, force: float) -> np.ndarray:
        """Stretch (driven cables,) in m of the driven cables by a force (N)."""
        law = cable.CableLaw.of(self.structure.cables[self.driven])
        return np.asarray(cable.elastic_stretch(force, law))

    def starting_drives(self) -> np.ndarray:
        """States of the actuators at t = 0 (drives,); see laws.actuator and
        cables_of_drives."""
        cables = self._at_start(self.cables_of_drives)
        return np.asarray(self.scenario.actuation.drives(cables))

    def starting_cables(self) -> DrivenCables:
        """Properties of the driven cables at t = 0."""
        return self._at_start(self.driven)

    def _at_start(self, indices: np.ndarray) -> DrivenCables:
        cables, lengths = self.structure.cables[indices], self.structure.initial_lengths[indices]
        law, signal = cable.CableLaw.of(cables), self.first_signals[cables["signal"]]
        return DrivenCables.at_rest(law, lengths, signal)

    @functools.cached_property
    def starting_modes(self) -> np.ndarray:
        """Modes of the contact nodes at t = 0 (see laws.contact). A node that touches the ground
        sticks."""
        modes = np.zeros((len(self.structure.contacts), MODE_COLUMNS))
        parts = Packed((self.model, Forces.of(self.model)))
        modes_after_step(parts, self.structure.initial_state, modes)
        return modes


def make_structure(scenario: Scenario) -> Structure:
    """The structure of a scenario's robot at its start: displaced by `robot.offsets`, and turned
    with an incline. Raises InputError if it cannot start there."""
    structure = undisturbed_structure(scenario)
    p_WB, slope = structure.p_WB, scenario.terrain.plane_slope or 0.0
    if slope and structure.held.any():
        problem = "found an incline under a robot with anchors, expected level ground"
        raise InputError(scenario.name, "terrain", problem)
    if scenario.robot.offsets:
        offsets, anchors = np.array(scenario.robot.offsets), structure.anchors
        # Nothing moves along an axis that an anchor holds.
        np.multiply.at(offsets, anchors.carriers, anchors.stiffness == 0.0)
        p_WB = p_WB + offsets
        check_apart(scenario, dataclasses.replace(structure, p_WB=p_WB))
    p_WB, q_WB = turn_with_slope(p_WB, structure.q_WB, slope)
    return dataclasses.replace(structure, p_WB=p_WB, q_WB=q_WB)


def undisturbed_structure(scenario: Scenario, *, may_overlap: bool = False) -> Structure:
    """The structure of a scenario's robot at its start on flat ground, without offsets. With
    `may_overlap`, struts that touch may overlap at the given positions: the search for equilibrium
    moves them apart."""
    blueprint = scenario.robot.blueprint()
    if not scenario.terrain.is_ground:
        blueprint = dataclasses.replace(blueprint, contacts=np.array([], dtype=np.int64))
    placed = Structure.of(blueprint)
    check_apart(scenario, placed, may_overlap=may_overlap)
    if not blueprint.settles:
        return placed
    up = np.array([0.0, 0.0, _lift(scenario, placed)])
    resting = _at_rest(scenario, dataclasses.replace(placed, p_WB=placed.p_WB + up))
    if not elastic_struts(blueprint).size:
        return resting
    elongation = np.zeros(len(blueprint.struts))
    for _ in range(MOST_CORRECTIONS):
        before = elongation
        elongation = axial_forces_at_rest(scenario, resting) / blueprint.strut_stiffness
        longer = with_elongations(placed, elongation)
        longer = dataclasses.replace(longer, q_WB=resting.q_WB, p_WB=resting.p_WB)
        resting = _at_rest(scenario, longer)
        if np.abs(elongation - before).max() < SAME_LENGTH:
            return resting
    problem = "are too soft: their lengths find no equilibrium; give more axial_stiffness"
    raise InputError(scenario.name, "robot.struts", problem)


def _at_rest(scenario: Scenario, structure: Structure) -> Structure:
    """The structure in equilibrium, near its initial pose."""
    equilibrium = equilibrium_of(scenario, structure)
    poses = equilibrium.state[: 7 * len(structure.bodies)].reshape(-1, 7)
    q_WB, p_WB = poses[:, :4], poses[:, 4:]
    return dataclasses.replace(structure, q_WB=q_WB, p_WB=p_WB, equilibrium=equilibrium)


def axial_forces_at_rest(scenario: Scenario, structure: Structure) -> np.ndarray:
    """Axial forces (struts,) in N on the struts of a structure in equilibrium; negative in
    compression."""
    model = make_model(scenario.with_sections(terrain=Flat()), structure)
    return axial_forces(structure, Unactuated(model), structure.initial_state)


def _lift(scenario: Scenario, placed: Structure) -> float:
    """Distance (m) to move a structure up so that its feet stand on the ground. A structure that is
    held along z or without ground is not moved; one with other anchors is not moved down. Raises
    InputError if a contact node, or a foot of a structure that is held along z, is clearly below
    the ground."""
    if not placed.contacts.size:
        return 0.0
    stays, shown, heights = placed.held[:, 2].any(), scenario.units.shown, placed.p_WN[:, 2]
    radius, depths = placed.contact_radius[placed.contacts], -heights[placed.contacts]
    below = radius + depths if stays else depths
    i = below.argmax()
    if below[i] > DEEPEST * (np.ptp(heights) or radius.max()):
        key = f"robot.nodes.{placed.node_names[placed.contacts[i]]}"
        what = f"a foot of radius {shown(radius[i], 'm')}" if stays and radius[i] else "it"
        found = f"{what} starts {shown(below[i], 'm')} below the ground"
        raise InputError(scenario.name, key, f"{found}, expected on it or above")
    lift = 0.0 if stays else float((radius + depths).max())
    return max(0.0, lift) if placed.held.any() else lift


def check_apart(scenario: Scenario, structure: Structure, *, may_overlap: bool = False) -> None:
    """Raises InputError if struts that touch overlap in the initial pose of a structure, by more
    than the robot's weight would press them. With `may_overlap`, only if their axes meet, as no
    direction leads them apart then."""
    if not scenario.strut_contact.law(structure.strut_search).acts:
        return
    found = overlaps(scenario, structure, structure.initial_state)
    for (first, second), (depth, distance) in found.items():
        struts = f"struts '{first}' and '{second}'"
        if distance <= MEETING:
            problem = f"the axes of {struts} meet at the start; move their nodes"
            raise InputError(scenario.name, "strut_contact", problem)
        if not may_overlap:
            advice = "move their nodes, make them thinner, or set strut_contact to !Nothing"
            problem = f"{struts} overlap by {1e3 * depth:.3g} mm at the start; {advice}"
            raise InputError(scenario.name, "strut_contact", problem)


def overlaps(
    scenario: Scenario, structure: Structure, state: np.ndarray
) -> dict[tuple[str, str], tuple[float, float]]:
    """Struts of different bodies that overlap in a state (13 bodies,), by their names: depths and
    distances of their axes, in m. Depths by which the robot's weight presses touching struts do not
    count."""
    struts, contact = structure.strut_table, scenario.strut_contact.law(structure.strut_search)
    allowed = START_DEPTH * structure.scale
    if contact.acts:
        weight = float(structure.mass.sum()) * scenario.robot.gravity
        allowed += weight / NormalForce(*contact.normal).stiffness
    near, nodes = NearStruts.of(struts), moved_nodes(structure, state)
    find_near_struts(struts, contact, structure.radius, state, nodes, near)
    found = {}
    for i, j in near.pairs[: near.count[0]].tolist():
        depth = find_touch(struts, nodes, i, j).depth
        if depth > allowed:
            names = structure.strut_name(i), structure.strut_name(j)
            found[names] = depth, struts.radius[i] + struts.radius[j] - depth
    return found


def equilibrium_of(
    scenario: Scenario, structure: Structure, start: np.ndarray | None = None
) -> Equilibrium:
    """Equilibrium of a structure without actuation, on flat ground if it has contact nodes.

    The search begins at the state `start` (13 bodies,), by default the structure's initial state.
    Raises InputError if there is no equilibrium.
    """
    model = make_model(scenario.with_sections(terrain=Flat()), structure)
    start = structure.initial_state if start is None else start
    return find_equilibrium(model, start, bodies=structure.bodies, source=scenario.name)


def make_model(scenario: Scenario, structure: Structure) -> Model:
    """Constants of a structure and its laws, in the form of the kernels."""
    touching = scenario.strut_contact.law(structure.strut_search)
    return Model(
        p_BN=structure.p_BN,
        first_node=structure.first_node,
        cables=cable.Cables.of(structure.cables),
        actuator=scenario.actuation.actuator(),
        couplings=structure.couplings,
        ground=make_ground(scenario, structure),
        anchors=structure.anchors,
        loads=structure.loads,
        bodies=Bodies(
            mass=structure.mass,
            inertia=structure.mass[:, np.newaxis] * structure.unit_inertia,
            radius=structure.radius,
            weight=structure.mass * scenario.robot.gravity,
        ),
        struts=structure.strut_table,
        strut_contact=touching._replace(acts=touching.acts and structure.struts.size > 0),
        isotropic=structure.isotropic,
        slack=structure.slack,
    )


def constant_steering(turn: float) -> SteeringSignal:
    """Steering with a constant turn. Raises InputError if it is not a number."""
    if isinstance(turn, bool) or not isinstance(turn, numbers.Real):
        expected = "a number from -1 to 1, or a function of the time in s"
        raise InputError("steering", "", f"found {turn!r}, expected {expected}")
    return lambda time: turn


def checked_turn(turn: float, *, time: float) -> float:
    """The turn, if it is between -1 and 1. Raises InputError otherwise; `time` (s) is for the
    message."""
    if not isinstance(turn, numbers.Real) or not abs(turn) <= 1.0:
        raise InputError("steering", f"at {time:g} s", f"found {turn!r:.60}, expected -1 to 1")
    return float(turn)


def initial_neurons(cpg: CpgSection, oscillators: int) -> np.ndarray:
    """State of the neurons at t = 0 (4n,): u of all neurons, then v (Table 4)."""
    inner_state, extensor_self_inhibition, flexor_self_inhibition = cpg.initial_state
    u = np.full(2 * oscillators, inner_state)
    v = np.tile([extensor_self_inhibition, flexor_self_inhibition], oscillators)
    return np.concatenate([u, v])
