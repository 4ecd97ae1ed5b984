"""Robot of a scenario: structure, constants of the kernels, network, start."""

from __future__ import annotations

import dataclasses
import functools
import numbers
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import NoneType
from typing import TYPE_CHECKING, Self

import numpy as np
from scipy import linalg

from tetra_drake.errors import InputError, check_type
from tetra_drake.kernels.packed import Packed
from tetra_drake.laws import cable
from tetra_drake.laws.actuator import DrivenCables
from tetra_drake.laws.contact import MODE_COLUMNS, Ground, NormalForce
from tetra_drake.laws.feedback import PATHWAYS, Senses
from tetra_drake.laws.forces import Forces
from tetra_drake.laws.mode_change import modes_after_step
from tetra_drake.laws.model import Bodies, Model
from tetra_drake.laws.oscillator import GaitParameter, Oscillators, steered_input
from tetra_drake.laws.terrain import Flat
from tetra_drake.robot.bodies import body_inertias
from tetra_drake.robot.gait import Gait, SteeringSignal, check_parameters, checked_turn
from tetra_drake.robot.ground import make_ground
from tetra_drake.robot.structure import Structure, with_origins
from tetra_drake.robot.struts import check_apart, strut_contact_law
from tetra_drake.scenario.events import Event, blueprint_after, up_to_each
from tetra_drake.scenario.start import Push
from tetra_drake.scenario.world import World

if TYPE_CHECKING:
    from tetra_drake.robot.equilibrium import Equilibrium
    from tetra_drake.scenario.scenario import Scenario

LIGHT, LEAST = 0.05, 1e-4
"""Damping ratios: below the first one damping is light; steps preserve the second one at least."""


@dataclass(frozen=True)
class Robot:
    """A robot of a scenario on its ground at t = 0: what an engine needs for a simulation, except
    a gait or other signals."""

    scenario: Scenario
    structure: Structure
    model: Model
    """Constants of bodies, cables and ground, as arguments of the compiled kernels."""
    first_signals: np.ndarray
    """Signals (m,) in N at t = 0. The actuators start in the state that fits these signals."""
    has_network: bool = True
    """False if the signals are given, by a command or a controller."""
    before: Robot | None = None
    """The robot at t = 0, if this one is what events have left of it; otherwise None."""

    @classmethod
    def of(cls, scenario: Scenario, *, at_rest: bool = False) -> Self:
        """The robot of a scenario at its start: in equilibrium if its settings say so, then turned
        by its `start` and moved by the offsets of its bodies, on the scenario's terrain.

        Args:
            at_rest: leaves out the start, the offsets and the events. Also allows struts to overlap
                at the positions of the settings, because the search for the equilibrium may move
                them apart.

        Raises:
            InputError: if the robot has no equilibrium, or would start in the ground, outside its
                terrain or with struts that overlap, or its start moves what is held.
        """
        scenario = scenario.with_sections(events=[]) if at_rest else scenario
        placed = structure = Structure.of(scenario.blueprint())
        check_apart(scenario, placed, may_overlap=at_rest)
        model = make_model(scenario.with_sections(terrain=Flat()), placed)
        start = None if at_rest else placed.start
        if placed.settles and (start is None or start.rest):
            from tetra_drake.robot.settling import settled

            structure, model = settled(scenario, placed, model)
        if start:
            from tetra_drake.robot.start import started

            structure = started(scenario, structure, start)
        if placed.offsets.any() and not at_rest:
            # Nothing moves along an axis that an anchor holds.
            offsets, anchors = placed.offsets.copy(), placed.anchors
            np.multiply.at(offsets, anchors.carriers, anchors.stiffness == 0.0)
            structure = dataclasses.replace(structure, p_WB=structure.p_WB + offsets)
        if not at_rest and (start or placed.offsets.any()):
            check_apart(scenario, structure)

        slope = scenario.terrain.plane_slope or 0.0
        if slope and structure.held.any():
            problem = "found an incline under a robot with anchors, expected level ground"
            raise InputError(scenario.name, "terrain", problem)
        structure = structure.turned(slope)

        loses = any(event.lose for event in scenario.events)
        isotropic = model.isotropic and not loses  # a lost mass may change the moments of inertia
        model = model._replace(ground=make_ground(scenario, structure), isotropic=isotropic)
        return cls(scenario, structure, model, first_signals=np.zeros(structure.signals))

    def without_network(self) -> Robot:
        """A copy of the robot for given signals in place of oscillators: one signal for each driven
        cable, in the order of `driven`.

        If the software of the actuators imitates a cable's spring and damper, the driven cables of
        the copy have none: a given signal is the whole tension.
        """
        names, laws = self.structure.cable_names, [*self.structure.cable_laws]
        if self.scenario.actuation.plays_cable:
            for number in self.driven:
                own = laws[number]
                laws[number] = own.cut()._replace(free_length=0.0, intact=own.intact)
        structure = dataclasses.replace(
            self.structure,
            cable_laws=tuple(laws),
            oscillators=tuple(names[number] for number in self.driven),
            groups=tuple((int(number),) for number in self.driven),
        )
        cables = cable.Cables.of(structure.cables, structure.cable_rings)
        model = self.model._replace(cables=cables)
        still = np.zeros(structure.signals)
        return Robot(self.scenario, structure, model, first_signals=still, has_network=False)

    @functools.cached_property
    def controlled(self) -> Robot:
        """A copy of the robot without its network, for a controller or a policy. Its first signals
        let the actuators start in the same state as with the network."""
        actuation, robot = self.scenario.actuation, self.without_network()
        setpoints = actuation.commands(self.starting_cables())
        law = cable.CableLaw.of(robot.structure.cables[robot.driven])
        return dataclasses.replace(robot, first_signals=actuation.signals(setpoints, law))

    @property
    def driven(self) -> np.ndarray:
        """Indices (driven cables,) of the cables that have actuators, in the order of the
        oscillators. Commands, a program's actions, and loads on actuators have this order. States
        of the actuators have the order of the cables, ascending."""
        groups = self.structure.groups
        return np.array([number for group in groups for number in group], dtype=np.int64)

    @property
    def ground(self) -> Ground:
        """Laws, heights and contact nodes of the ground under the robot, for kernels."""
        return self.model.ground

    @property
    def weight(self) -> float:
        """Weight of the robot in N."""
        return float(self.structure.mass.sum()) * self.scenario.robot.gravity

    @functools.cached_property
    def equilibrium(self) -> Equilibrium:
        """Equilibrium of the robot on flat ground without actuation, found at the first use. The
        scenario's terrain and the offsets of the bodies at the start are ignored. Raises InputError
        if there is no equilibrium."""
        if self.before is not None:
            return self.before.equilibrium
        if self.structure.equilibrium is not None:
            return self.structure.equilibrium
        placed = Structure.of(self.scenario.blueprint())
        if placed.settles:
            return Robot.of(self.scenario, at_rest=True).equilibrium
        return equilibrium_of(self.scenario, placed)

    @functools.cached_property
    def damping_ratio(self) -> float:
        """Least damping ratio c / (2 sqrt(k m)) of a cable, anchor or joint with the stiffness k
        and the damping c, for the mass m of the robot; 0 without them."""
        springs = self.model.cables.law, self.model.anchors, self.model.joints
        k = np.concatenate([spring.stiffness.ravel() for spring in springs])
        c = np.concatenate([spring.damping.ravel() for spring in springs])[k > 0.0]
        return float(min(0.5 * c / np.sqrt(k[k > 0.0] * self.structure.mass.sum()), default=0.0))

    @functools.cached_property
    def longest_step(self) -> float:
        """Longest step (s) that keeps light damping; infinite if `damping_ratio` is not light.

        Tolerances do not see the smallest vibrations, and long steps damp them: a step h adds the
        ratio (w h)³ / 72 to a mode of the frequency w (rad/s) with radau3, / 112 with ROS2, / 24
        with runge_kutta3. So (w h)³ is `damping_ratio` for the fastest lightly damped mode.
        """
        if self.damping_ratio >= LIGHT:
            return np.inf
        from tetra_drake.robot.equilibrium import (
            Unactuated,
            damping_at_rest,
            mass_matrix,
            stiffness_at_rest,
        )

        aloft = Unactuated(self.model._replace(ground=Ground()))
        damping = damping_at_rest(aloft, self.structure.initial_state)
        squares, modes = linalg.eigh(stiffness_at_rest(aloft).toarray(), mass_matrix(aloft))
        rates = np.sqrt(np.maximum(squares, 0.0))
        is_light = (modes * (damping @ modes)).sum(axis=0) < 2.0 * LIGHT * rates
        return float(np.cbrt(max(self.damping_ratio, LEAST)) / rates[is_light].max(initial=1e-9))

    @functools.cached_property
    def senses(self) -> Senses:
        """Constants for the feedback from cable lengths and contacts to the oscillators; see
        laws.feedback. Raises InputError if the feedback of lengths needs the robot's equilibrium
        and there is none."""
        if self.before is not None:
            senses = self.before.senses
            return senses._replace(per_length=senses.per_length * self.model.cables.law.intact)
        structure, pathways = self.structure, self.scenario.cpg.feedback if self.has_network else []
        drivers = structure.cables["signal"].copy()
        last = [max(structure.bodies_at(cables)) for cables in structure.groups]
        groups = drivers - cable.PASSIVE
        sizes = np.bincount(groups)[groups]  # of each cable's group
        neutral = self.equilibrium.lengths if "length" in pathways else np.ones(len(drivers))
        per_load = 1.0 / self.weight if "load" in pathways else 0.0
        return Senses(
            drivers=drivers,
            ahead=np.array(last, dtype=np.int64),
            carriers=self.ground.carriers,
            neutral_length=neutral,
            per_length=1.0 / (neutral * sizes),
            per_load=np.array([per_load]),
        )

    @functools.cached_property
    def phases(self) -> tuple[Phase, ...]:
        """The robot from t = 0 on, and after each event of the scenario, in the order of time."""
        start = Phase(0.0, self, np.zeros_like(self.structure.p_WB))
        return start, *map(self._after, up_to_each(self.scenario.events))

    def _after(self, events: Sequence[Event]) -> Phase:
        """What is left of the robot after `events`, with its nodes at the same places."""
        left = blueprint_after(self.structure, events)
        mass, p_FC, unit_inertia = body_inertias(left)
        p_BC = p_FC - body_inertias(self.structure)[1]
        state = with_origins(self.structure.initial_state, p_BC)
        structure = dataclasses.replace(
            left,
            p_BN=left.p_BN - np.vstack([p_BC, np.zeros(3)])[left.carriers],
            mass=mass,
            unit_inertia=unit_inertia,
            p_WB=state[: 7 * len(mass)].reshape(-1, 7)[:, 4:],
        )
        changed = self.scenario.after(events)
        normal = NormalForce(changed.ground.stiffness, changed.ground.damping)
        ground = self.ground._replace(normal=np.array(normal), friction=changed.friction.law())
        model = make_model(changed.with_sections(terrain=Flat()), structure)
        model = model._replace(ground=ground, isotropic=self.model.isotropic)
        robot = dataclasses.replace(
            self, scenario=changed, structure=structure, model=model, before=self
        )
        return Phase(events[-1].at, robot, p_BC, events[-1].push)

    def oscillators(self, gait: Gait) -> Oscillators:
        """Oscillators with the numbers of a gait, for kernels. Raises InputError if the gait does
        not fit them."""
        cpg, source = self.scenario.cpg, f"gait {gait.name}"
        values = check_parameters(gait.parameters, self._parameters, source, "parameters")
        gains = np.array([values.get(f"gain {name}", 0.0) for name in PATHWAYS])
        return Oscillators(cpg.own, *cpg.network(self.structure, values), gains)

    @functools.cached_property
    def _parameters(self) -> Mapping[str, GaitParameter]:
        return self.scenario.cpg.parameters(self.structure)

    def turns(self, gait: Gait, steering: SteeringSignal | None = None) -> np.ndarray:
        """Turns, -1 to 1: how much more input left oscillators have than right ones.

        They are the values of `steering` at multiples of `cpg.listing_step` from t = 0 to the end.
        If it is a number there is one value, and without it one, the gait's turn. At 1 only the
        left oscillators have input, at -1 only the right ones. Raises InputError if a value is not
        between -1 and 1, or if no oscillator is on one side of the robot.
        """
        check_type("steering", "", steering, numbers.Real, Callable, NoneType)
        turn = gait.turn if steering is None else steering
        if turn and not self.structure.sides.any():
            source = f"gait {gait.name}" if steering is None else "steering"
            raise InputError(source, "", "turns, but no oscillator is on one side of the robot")
        if not callable(turn):
            return np.array([checked_turn(turn, time=0.0)])
        step = self.scenario.cpg.listing_step
        times = step * np.arange(round(self.scenario.simulation.duration / step) + 1)
        return np.array([checked_turn(turn(time), time=time) for time in times.tolist()])

    def tonic_input(self, turns: np.ndarray) -> np.ndarray:
        """Tonic input of both inputs of m oscillators (..., 2m), for turns (...) from -1 to 1. It
        is u0 (1 + turn) on the left, u0 (1 - turn) on the right, u0 for neither side."""
        sides, u0 = np.repeat(self.structure.sides, 2), self.scenario.cpg.tonic
        return np.asarray(steered_input(u0, turns[..., np.newaxis], sides))

    def starting_drives(self) -> np.ndarray:
        """States of the actuators at t = 0 (drives,), in the order of the cables: free lengths (m)
        of winches, tensions (N) of motors. Empty if the kind of actuators has no states."""
        cables = self.starting_cables(np.sort(self.driven))
        return np.asarray(self.scenario.actuation.drives(cables))

    def starting_cables(self, numbers: np.ndarray | None = None) -> DrivenCables:
        """Driven cables at rest at t = 0, for methods of the actuators: lengths, signals, tensions
        and constants.

        Args:
            numbers: indices of the cables among all cables; by default all driven ones, in the
                order of `driven`.
        """
        which = self.driven if numbers is None else numbers
        cables, lengths = self.structure.cables[which], self.structure.initial_lengths[which]
        signals = self.first_signals[cables["signal"]]
        return DrivenCables.at_rest(cable.CableLaw.of(cables), lengths, signals)

    @functools.cached_property
    def starting_modes(self) -> np.ndarray:
        """Table `modes` (contacts, 12) of laws.contact, the states of the contact nodes, at t = 0.
        A contact node that touches the ground sticks at its position."""
        modes = np.zeros((len(self.structure.contacts), MODE_COLUMNS))
        parts = Packed((self.model, Forces.of(self.model)))
        modes_after_step(parts, self.structure.initial_state, modes)
        return modes


@dataclass(frozen=True)
class Phase:
    """A robot between two events."""

    begins: float
    """Time (s) of the event before; 0 at the start."""
    robot: Robot
    p_BC: np.ndarray
    """Positions (bodies, 3) in m of its bodies' centres of mass, the origins of their frames now,
    in the frames that they have at t = 0."""
    push: Push | None = None
    """Push at its beginning."""

    def entered(self, states: np.ndarray, before: Phase) -> np.ndarray:
        """States [q; v] (..., 13*bodies) at the beginning of this phase, from those at the end of
        the phase `before`. The nodes are at the same places, and move on unless they are pushed."""
        states = with_origins(states, self.p_BC - before.p_BC)
        if not self.push:
            return states
        from tetra_drake.robot.start import pushed

        return pushed(states, self.robot.structure, self.push)


def equilibrium_of(
    scenario: World, structure: Structure, start: np.ndarray | None = None
) -> Equilibrium:
    """Equilibrium of a structure without actuation, on flat ground if it has contact nodes.

    The search begins at `start` (13*bodies,), a state [q; v], by default the structure's initial
    state. Raises InputError if there is no equilibrium.
    """
    from tetra_drake.robot.equilibrium import find_equilibrium

    model = make_model(scenario.with_sections(terrain=Flat()), structure)
    start = structure.initial_state if start is None else start
    return find_equilibrium(model, start, bodies=structure.bodies, source=scenario.name)


def make_model(scenario: World, structure: Structure) -> Model:
    """Constants of a robot as arguments of the compiled kernels: its structure, and the physical
    laws of the scenario. Raises InputError if the structure starts in the ground or outside the
    terrain; see make_ground()."""
    return Model(
        p_BN=structure.p_BN,
        first_node=structure.first_node,
        cables=cable.Cables.of(structure.cables, structure.cable_rings),
        actuator=scenario.actuation.actuator(),
        couplings=structure.couplings,
        ground=make_ground(scenario, structure),
        anchors=structure.anchors,
        joints=structure.joint_springs,
        loads=structure.loads,
        bodies=Bodies(
            mass=structure.mass,
            inertia=structure.mass[:, np.newaxis] * structure.unit_inertia,
            radius=structure.radius,
            weight=structure.mass * scenario.robot.gravity,
        ),
        struts=structure.strut_table,
        strut_contact=strut_contact_law(scenario, structure),
        isotropic=structure.isotropic,
        slack=structure.slack,
    )
