"""World: a robot, its surroundings and what drives it, and how all are simulated."""

from __future__ import annotations

import dataclasses
import math
import operator
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal, Self, TypeVar

from pydantic import ConfigDict, Field, model_validator

from tetra_drake.errors import InputError
from tetra_drake.laws.actuator import Actuation, Force
from tetra_drake.laws.capsules import NoStrutContact, StrutContactKind
from tetra_drake.laws.contact import GroundSection
from tetra_drake.laws.friction import Friction
from tetra_drake.laws.oscillator import CpgKind
from tetra_drake.laws.terrain import Flat, Terrain
from tetra_drake.scenario.blueprint import Blueprint, cable_numbers
from tetra_drake.scenario.engine_kinds import Compiled, Drake, EngineKind, Mujoco
from tetra_drake.scenario.events import Event, check_taken, up_to_each
from tetra_drake.scenario.policies import Policy
from tetra_drake.scenario.robot_settings import RobotKind
from tetra_drake.scenario.sensing import Sensing
from tetra_drake.settings.quantities import Speed, Time
from tetra_drake.settings.refusals import TAG, hint, refuse
from tetra_drake.settings.section import Kinds, Section, Tree, flattened, parts_of
from tetra_drake.settings.units import SYSTEMS, Units, current, fitting

EngineT = TypeVar("EngineT", Drake, Compiled, Mujoco)

CHANGEABLE = "friction.", "ground."
"""First parts of the keys whose numbers an event may change."""

MOST_SAMPLES = 2_000_000
"""Largest number of recorded poses of all bodies in one simulation. They need about 2 GB."""

LONGEST_SETTLING = 3.0
"""Upper limit (s) of the default of SimulationSection.steady_from."""

_CPGS = ["tetra_drake.laws.matsuoka:Matsuoka", "tetra_drake.laws.phase:PhaseOscillators"]
Cpg = Annotated[CpgKind, Kinds(CpgKind, more=_CPGS, plain=True)]
"""Oscillators of any kind, with their settings. A mapping without a tag is a !Matsuoka, and written
so."""


class SimulationSection(Section):
    """Duration and sampling of a simulation, and limits beyond which it fails."""

    duration: Time = Field(gt=0, le=1e5)
    """Simulated time."""
    steady_from: Time | None = Field(default=None, ge=0)
    """Time at which the steady walk begins, for fitness and metrics (section 2.3). By default a
    quarter of the duration, at most 3 s."""
    max_evaluations: int = Field(ge=1)
    """Largest number of evaluations of the derivatives in a simulation."""
    sample_period: Time = Field(gt=0)
    """Time between samples of a recorded trajectory."""
    control_period: Time = Field(default=0.02, gt=0)
    """Time between actions of a controller."""
    max_speed: Speed | None = Field(default=None, gt=0)
    """Speed of a body above which a simulation has diverged. By default more than fall, cables and
    actuators give; at least 10.16 m/s."""

    @property
    def settling_time(self) -> float:
        """Time (s) at which the steady walk begins: `steady_from`, or its default."""
        default = min(LONGEST_SETTLING, self.duration / 4.0)
        return default if self.steady_from is None else self.steady_from

    @model_validator(mode="after")
    def _check(self) -> SimulationSection:
        if self.settling_time >= self.duration:
            problem = f"found {self.steady_from} s, expected less than the duration"
            refuse("steady_from", f"{problem}, {self.duration} s; null is a quarter of it")
        return self


class World(Section):
    """A robot with its ground, its actuators and what drives them, and the engine that simulates
    them. A Scenario adds an experiment about it."""

    model_config = ConfigDict(defer_build=True)

    format: Literal[1] = 1
    """Version of the format of the file."""
    name: str
    """Label of the scenario; equal scenarios may have different names."""
    robot: RobotKind
    ground: GroundSection
    friction: Friction
    terrain: Terrain = Flat()
    strut_contact: StrutContactKind = NoStrutContact()
    actuation: Actuation = Force()
    cpg: Cpg
    policy: Policy | None = Field(default=None, exclude_if=lambda policy: policy is None)
    """A closed loop in place of the oscillator network; evolution searches its parameters. An empty
    key removes the base's."""
    sensing: Sensing | None = Field(default=None, exclude_if=lambda sensing: sensing is None)
    """Errors and delays with which policies and controllers see the robot. An empty key removes the
    base's."""
    simulation: SimulationSection
    engine: EngineKind = Drake()
    events: list[Event] = Field(default=[], exclude_if=operator.not_)
    """Changes of robot or ground during the simulation, such as a cable that breaks; pushes."""

    def values(self) -> dict[str, Any]:
        """Values by dotted keys, without the scenario's name. Scenarios with the same values are
        equal; the name is only a label."""
        return flattened(self.model_dump(exclude={"format", "name"}))

    @property
    def units(self) -> Units:
        """Units of this scenario in texts, pages and figures: the units that units.shown_in()
        sets, if it is in use; otherwise mm if the robot is given in mm; otherwise the units that
        need the fewest digits for the long lengths of the robot."""
        robot = self.robot
        return current(SYSTEMS[robot.unit] if robot.unit else fitting(robot.lengths))

    @property
    def oscillators(self) -> int:
        """Number of oscillators."""
        return len(self.robot.blueprint().oscillators)

    @property
    def engine_name(self) -> str:
        """Name of the engine: its kind in lower case."""
        return type(self.engine).__name__.lower()

    def settings_of(self, engine: type[EngineT]) -> EngineT:
        """The settings of the scenario's engine. Raises TypeError if it is of another kind."""
        if not isinstance(self.engine, engine):
            raise TypeError(f"the engine is !{type(self.engine).__name__}")
        return self.engine

    @property
    def lacking(self) -> tuple[str, ...]:
        """Properties that some metrics need and this scenario's robot or actuators do not have,
        such as "row of tetrahedra". Such metrics are NaN."""
        return *self.robot.lacking, *self.actuation.lacking

    @property
    def whole_cables(self) -> list[str]:
        """Names of the cables that no event cuts."""
        names = self.robot.blueprint().cable_names
        numbers = cable_numbers(names)
        cut = {numbers[name] for event in self.events for name in event.cut}
        return [name for number, name in enumerate(names) if number not in cut]

    def blueprint(self) -> Blueprint:
        """The blueprint of the robot, without contact nodes if there is no ground."""
        blueprint = self.robot.blueprint()
        if self.terrain.is_ground:
            return blueprint
        return dataclasses.replace(blueprint, contacts=blueprint.contacts[:0])

    def with_changes(self, changes: Mapping[str, Any]) -> Self:
        """A checked copy with other values: {"robot.tetrahedra": 7, "friction": "!Coulomb"}.

        The rules are the same as for a file with this scenario as its base: quantities have units,
        mappings change the keys that they name, and the spacing is adapted. A kind may be a text as
        in a file ("friction": "!Coulomb {static: 0.3}"), or a section with SI numbers
        ({"friction": Coulomb()}); both replace the old one. Raises InputError, naming the key.
        """
        from tetra_drake.scenario.changes import tree_of_changes

        source = f"scenario {self.name}"
        return self.with_file(tree_of_changes(changes, source), source)

    def with_file(self, changes: Tree, source: object) -> Self:
        """A checked copy with the settings of a scenario file whose `base` is this scenario.

        `changes` is the parsed content of the file, without `base`: nested mappings with the keys
        that differ, quantities with units. See changes.merged() for the rules. Raises InputError
        that names `source`, such as the file, and key.
        """
        from tetra_drake.scenario.changes import merged
        from tetra_drake.scenario.structure_files import with_structure

        changes = with_structure(changes, source)
        tree = merged(self.model_dump(), changes, section=self)
        changed = self.from_tree(tree, source)
        robot = changes.get("robot")
        implied = isinstance(robot, dict) and changed.robot.implied_changes(self.robot, robot)
        return self.from_tree(merged(tree, {"robot": implied}), source) if implied else changed

    def after(self, events: Sequence[Event]) -> Self:
        """Checked copy with the numbers that `events` change, and without events. Raises InputError
        for a number that its key does not allow."""
        alone = self.undisturbed()
        changes = {key: number for event in events for key, number in event.change.items()}
        return alone.with_changes(changes) if changes else alone

    def undisturbed(self) -> Self:
        """A copy without events."""
        return self.with_sections(events=[])

    def on_engine(self, name: str | None) -> Self:
        """This scenario with the engine called `name`, such as "compiled", in its default settings.
        If the scenario has this engine already, or `name` is None, nothing changes."""
        if name in (None, self.engine_name):
            return self
        return self.with_changes({"engine": {TAG: str(name).capitalize()}})

    def with_sections(self, **sections: Any) -> Self:
        """A copy with other sections, such as terrain=Flat(). They are not checked."""
        return self.model_copy(update=sections)

    def with_numbers(self, numbers: Mapping[str, float]) -> Self:
        """A copy with other numbers in SI units by dotted keys, such as {"ground.stiffness": 5e3}.
        They are not checked."""
        changed = self
        for key, number in numbers.items():
            changed = _with_number(changed, parts_of(key), number)
        return changed

    def numbers(self) -> dict[str, float]:
        """SI numbers of the scenario by dotted keys, without `disturbances`, `objective` and
        `require`."""
        tree = self.model_dump(exclude={"disturbances", "objective", "require"})
        return {key: value for key, value in flattened(tree).items() if isinstance(value, float)}

    @model_validator(mode="after")
    def _check_world(self) -> Self:
        """Raises InputError, naming a key, for settings of different sections that do not go
        together, such as a sample period too short for the memory."""
        simulation, step = self.simulation, self.cpg.listing_step
        if step > simulation.duration:
            expected = f"expected at most the duration, {simulation.duration} s"
            refuse("cpg.listing_step", f"found {step} s, {expected}")
        if "load" in self.cpg.feedback and self.robot.gravity == 0.0:
            refuse("robot.gravity", "found 0 m/s^2, expected a weight, for feedback of the load")
        if self.policy and self.cpg.feedback:
            found = f"found {self.cpg.feedback}, expected none"
            refuse("cpg.feedback", f"{found}: a policy excludes it")
        periods = simulation.control_period / step
        if self.policy and (periods < 0.5 or abs(periods - round(periods)) > 1e-6):
            expected = f"expected a multiple of cpg.listing_step, {step} s, for a policy"
            refuse("simulation.control_period", f"found {simulation.control_period} s, {expected}")

        blueprint = self.robot.blueprint()
        least_step = simulation.duration * blueprint.signals / self.engine.most_signals
        least_sample = simulation.duration * len(blueprint.bodies) / MOST_SAMPLES
        for key, period, least in (
            ("cpg.listing_step", step, least_step),
            ("simulation.sample_period", simulation.sample_period, least_sample),
            ("engine.step", getattr(self.engine, "step", math.inf), least_step),
        ):
            if period < least:
                problem = f"found {period} s, expected at least {least:.3g} s, to fit in memory"
                refuse(key, f"{problem}, for this duration and robot")
        return self

    @model_validator(mode="after")
    def _check_events(self) -> Self:
        """Refuses events after the end, unknown or repeated names, and changes that are no numbers
        of ground or friction."""
        if not self.events:
            return self
        check_taken(self.events, self.robot.blueprint())
        changeable = [key for key in self.numbers() if key.startswith(CHANGEABLE)]
        for events in up_to_each(self.events):
            event = events[-1]
            place = f"events[{self.events.index(event)}]"
            self._check_time(f"{place}.at", event.at)
            if not (event.cut or event.lose or event.change or event.push):
                refuse(place, "changes nothing, expected cut, lose, change or push")
            for key in event.change:
                if key not in changeable:
                    found = f"'{key}' is no number of ground or friction"
                    refuse(f"{place}.change", f"{found}; {hint(key, changeable)}")
            try:
                self.after(events)
            except InputError as error:
                more = "" if error.key in event.change else "; change it as well"
                refuse(f"{place}.change.{error.key}", error.problem + more)
        return self

    def _check_time(self, key: str, time: float) -> None:
        end = self.simulation.duration
        if time >= end:
            refuse(key, f"found {time:g} s, expected less than the duration, {end:g} s")


def _with_number(value: Any, names: Sequence[Any], number: float) -> Any:
    """A copy of a section, mapping or list with another number at the path `names`: the parts of a
    dotted key, such as ["ground", "stiffness"]."""
    if not names:
        return number
    name, *rest = names
    if isinstance(value, Section):
        return value.model_copy(update={name: _with_number(getattr(value, name), rest, number)})
    if isinstance(value, list):
        return [*value[:name], _with_number(value[name], rest, number), *value[name + 1 :]]
    return {**value, name: _with_number(value[name], rest, number)}
