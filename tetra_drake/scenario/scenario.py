"""Scenario: all settings of an experiment, and the rules between its sections."""

from __future__ import annotations

import dataclasses
import functools
import itertools
import json
import math
import operator
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self, TypeVar

from pydantic import ConfigDict, Field, model_validator

from tetra_drake.errors import InputError
from tetra_drake.files import read_text
from tetra_drake.formatting import TextTable, heading_html, listed
from tetra_drake.laws.actuator import Actuation, Force
from tetra_drake.laws.capsules import NoStrutContact, StrutContactKind
from tetra_drake.laws.contact import GroundSection
from tetra_drake.laws.friction import Friction
from tetra_drake.laws.oscillator import CpgSection, GaitBounds, GaitParameter
from tetra_drake.laws.terrain import Flat, Terrain
from tetra_drake.scenario.blueprint import Blueprint
from tetra_drake.scenario.changes import merged, tree_of_changes
from tetra_drake.scenario.common_sections import (
    BODY_SECTIONS,
    BodyBounds,
    Disturbances,
    EvolutionSection,
    SimulationSection,
    different_keys,
    separate,
)
from tetra_drake.scenario.engine_kinds import Compiled, Drake, EngineKind, Mujoco
from tetra_drake.scenario.events import Event, check_taken, up_to_each
from tetra_drake.scenario.metrics import METRICS, UNITS, inverse
from tetra_drake.scenario.optimizer_kinds import OptimizerKind, SteadyState
from tetra_drake.scenario.policies import Policy
from tetra_drake.scenario.robot_structure import RobotKind, cable_numbers
from tetra_drake.scenario.structure_files import with_structure
from tetra_drake.scenario.tolerances import (
    Tolerance,
    Tolerances,
    check_tolerances,
    split_tolerances,
)
from tetra_drake.scenario.yaml_text import dump_yaml, parse_yaml
from tetra_drake.settings.quantities import by_name
from tetra_drake.settings.refusals import TAG, described, hint, refuse
from tetra_drake.settings.section import Section, Tree, flattened, value_at, written
from tetra_drake.settings.units import (
    SYSTEMS,
    Units,
    current,
    fitting,
    plainest,
    shortest,
)

EngineT = TypeVar("EngineT", Drake, Compiled, Mujoco)

MOST_SIGNALS_OF_DRAKE, MOST_SIGNALS = 20_000_000, 100_000_000
"""Largest number of values of all signals in one simulation, on Drake and on other engines. They
need about 3 GB."""

_WIDTH, _ROWS = 100, 20
"""Largest number of characters in a line of a printed scenario, and of rows in a notebook."""

_OF_WEIGHTS = {name: inverse(unit) for name, unit in UNITS.items()}
"""Units of the weights in an objective, by metric."""

CHANGEABLE = "friction.", "ground."
"""First parts of the keys whose numbers an event may change."""

MOST_SAMPLES = 2_000_000
"""Largest number of recorded poses of all bodies in one simulation. They need about 2 GB."""


class Scenario(Section):
    """Scenario: all settings of an experiment except the gait."""

    model_config = ConfigDict(defer_build=True)

    keys_of_files: ClassVar = {"base": "Name or file of a scenario that has the other values."}

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
    cpg: CpgSection
    policy: Policy | None = Field(default=None, exclude_if=lambda policy: policy is None)
    """A closed loop in place of the oscillator network; evolution searches its parameters. An empty
    key removes the base's."""
    gait_bounds: GaitBounds
    evolve: Annotated[BodyBounds, Field(exclude_if=operator.not_)] = Field(default={})
    """Bounds of the numbers of the robot that evolve together with the gait, by scenario key, such
    as `robot.cables.side.stiffness: [50 N/m, 400 N/m]` or `robot.nodes.n3[2]` for a coordinate z.
    Keys that are joined by commas get the same value. Each candidate is a robot of its own, at its
    own equilibrium. Equal bounds fix a number. A file replaces all bounds of its base."""
    simulation: SimulationSection
    engine: EngineKind = Drake()
    objective: Annotated[dict[str, float], *by_name(_OF_WEIGHTS), Field(min_length=1)]
    """Weights of metrics whose weighted sum evolution maximises, such as `speed: 2 s/in`.
    Lengths count in inches. A file replaces its base's objective as a whole."""
    require: Annotated[dict[str, float], *by_name(UNITS)] = Field(default={})
    """Limits of metrics: a gait that does not meet one counts as failed. A file replaces all limits
    of its base."""
    events: list[Event] = Field(default=[], exclude_if=operator.not_)
    """Changes of robot or ground during the simulation, such as a cable that breaks."""
    tolerances: Tolerances = Field(default={}, exclude_if=operator.not_)
    """Tolerances of numbers by scenario key, such as `ground.stiffness: 20 % uniform`, besides the
    robot's; or in the text of a number, such as `20 kN/m ± 20 %`. They do not change a simulation;
    td.predict and td.fit use them."""
    disturbances: Disturbances | None = None
    evolution: EvolutionSection
    optimizer: OptimizerKind = SteadyState()

    def __str__(self) -> str:
        """Summary in a few lines, with the settings that differ from the scenario `thesis`."""
        lines = [
            f"scenario {self.name}: {self.robot.body_count} bodies, {self.oscillators} oscillators,"
            f" {self.simulation.duration:g} s, engine {self.engine_name}; evolution"
            f" {self.evolution.trials} x {self.evolution.evaluations} gaits"
        ]
        sections: dict[str, list[str]] = {}
        for key, text in self.differences(_thesis()):
            section, _, name = key.partition(".")
            sections.setdefault(section, []).append(f"{name} {text}".strip())
        for section, texts in sections.items():
            line = f"  {section:<13} {', '.join(texts)}"
            if len(line) > _WIDTH:
                line = f"{line[: _WIDTH - 5].rpartition(', ')[0]}, ..."
            lines.append(line)
        return "\n".join(lines)

    def __repr__(self) -> str:
        return f"<Scenario {self.name}>"

    def _repr_html_(self) -> str:
        heading = heading_html(str(self).partition("\n")[0])
        rows = [[key, text] for key, text in self.differences(_thesis()) if len(text) <= _WIDTH]
        return heading + TextTable(["differs from thesis", "value"], rows[:_ROWS], (0, 1)).html()

    def to_yaml(self) -> str:
        """All settings as a scenario file, in units with few digits."""
        tree = written(self.model_dump(), shortest)
        tree["terrain"] |= self.terrain.paths
        return dump_yaml(tree)

    def differences(self, base: Scenario) -> list[tuple[str, str]]:
        """Keys and values that differ from `base`, in the unit that needs the fewest digits.

        The values are this scenario's, as text. A value that only `base` has is "none"; it is left
        out if its section is of another kind in `base`, such as another law of friction. The list
        is empty exactly if the scenarios are equal, apart from their names.
        """
        ours, theirs = self.values(), base.values()
        kinds = [key for key in ours if key.endswith(f".{TAG}") and ours[key] != theirs.get(key)]
        other_kinds = tuple(key.removesuffix(TAG) for key in kinds)
        found = []
        for key in dict.fromkeys([*ours, *theirs]):
            is_of_other_kind = key not in ours and key.startswith(other_kinds)
            if ours.get(key) == theirs.get(key) or is_of_other_kind:
                continue
            text = _text(ours.get(key))
            if text == _text(theirs.get(key)):  # only the last digits differ
                text = _text(ours.get(key), exact=True)
            found.append((key.removesuffix(f".{TAG}"), text))
        # Names in another order; they number the bodies and oscillators of a structure.
        in_common = [key for key in ours if key in theirs], [key for key in theirs if key in ours]
        for key, other in zip(*in_common, strict=True):
            if key != other:
                pairs = zip(key.split("."), other.split("."), strict=False)
                shared = itertools.takewhile(lambda pair: pair[0] == pair[1], pairs)
                found.append((".".join(part for part, _ in shared), "another order of names"))
                break
        return found

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
    def all_tolerances(self) -> Mapping[str, Tolerance]:
        """Tolerances of the robot and of the scenario, by scenario key. Raises InputError if a
        number has two."""
        of_robot = {
            ", ".join(f"robot.{one}" for one in separate(key)): tolerance
            for key, tolerance in self.robot.tolerances.items()
        }
        return different_keys(of_robot | self.tolerances, source=f"scenario {self.name}")

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

    @property
    def draw_count(self) -> int:
        """Number of simulations per gait in evolution: one, or one per draw of disturbances."""
        return self.disturbances.draws if self.disturbances else 1

    @functools.cached_property
    def parameters(self) -> Mapping[str, GaitParameter]:
        """Parameters of a gait by name: of the policy if there is one, otherwise of the
        oscillators."""
        blueprint = self.blueprint()
        if self.policy is None:
            return self.cpg.parameters(blueprint, self.gait_bounds)
        bounds = self.policy.parameters(blueprint)
        return {name: GaitParameter(*pair) for name, pair in bounds.items()}

    def blueprint(self) -> Blueprint:
        """The blueprint of the robot, without contact nodes if there is no ground."""
        blueprint = self.robot.blueprint()
        if self.terrain.is_ground:
            return blueprint
        return dataclasses.replace(blueprint, contacts=blueprint.contacts[:0])

    @classmethod
    def from_tree(cls, tree: Tree, source: object, *, key: str = "") -> Self:
        """Makes a scenario from the content of a file that has all settings. Raises InputError that
        names `source` and key."""
        return super().from_tree(with_structure(tree, source), source, key=key)

    def with_changes(self, changes: Mapping[str, Any]) -> Self:
        """A checked copy with other values: {"robot.tetrahedra": 7, "friction": "!Coulomb"}.

        The rules are the same as for a file with this scenario as its base: quantities have units,
        mappings change the keys that they name, and the spacing is adapted. A kind may be a text as
        in a file ("friction": "!Coulomb {static: 0.3}"), or a section with SI numbers
        ({"friction": Coulomb()}); both replace the old one. Raises InputError, naming the key.
        """
        source = f"scenario {self.name}"
        return self.with_file(tree_of_changes(changes, source), source)

    def with_file(self, changes: Tree, source: object) -> Self:
        """A checked copy with the settings of a scenario file whose `base` is this scenario.

        `changes` is the parsed content of the file, without `base`: nested mappings with the keys
        that differ, quantities with units. See changes.merged() for the rules. Raises InputError
        that names `source`, such as the file, and key.
        """
        changes = with_structure(changes, source)
        tree = merged(self.model_dump(), changes, section=self)
        changed = self.from_tree(tree, source)
        robot = changes.get("robot")
        implied = isinstance(robot, dict) and changed.robot.implied_changes(self.robot, robot)
        return self.from_tree(merged(tree, {"robot": implied}), source) if implied else changed

    def after(self, events: Sequence[Event]) -> Self:
        """Checked copy with the numbers that `events` change, and without events. Raises InputError
        for a number that its key does not allow."""
        alone = self.with_sections(events=[], disturbances=None)
        changes = {key: number for event in events for key, number in event.change.items()}
        return alone.with_changes(changes) if changes else alone

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
            changed = _with_number(changed, key.split("."), number)
        return changed

    def numbers(self) -> dict[str, float]:
        """SI numbers of the scenario by dotted keys, without `disturbances`, `objective` and
        `require`."""
        tree = self.model_dump(exclude={"disturbances", "objective", "require"})
        return {key: value for key, value in flattened(tree).items() if isinstance(value, float)}

    _split = model_validator(mode="before")(split_tolerances)
    _check_known = model_validator(mode="after")(check_tolerances)

    @model_validator(mode="after")
    def _check_combinations(self) -> Self:
        """Raises InputError, naming a key, for settings of different sections that do not go
        together, such as a sample period too short for the memory."""
        simulation, step = self.simulation, self.cpg.listing_step
        if step > simulation.duration:
            expected = f"expected at most the duration, {simulation.duration} s"
            refuse("cpg.listing_step", f"found {step} s, {expected}")
        if "load" in self.cpg.feedback and self.robot.gravity == 0.0:
            refuse("robot.gravity", "found 0 m/s^2, expected a weight, for feedback of the load")

        measures = getattr(self.optimizer, "measures", {})
        named = {"objective": self.objective, "require": self.require}
        for key, metrics in {**named, "optimizer.measures": measures}.items():
            for name, section in itertools.product(metrics, (self.robot, self.actuation)):
                if METRICS[name].needs in section.lacking:
                    problem = f"does not have this metric; give `{key}` without it"
                    refuse(f"{key}.{name}", f"!{section.tag} {problem}")

        blueprint, bounds = self.robot.blueprint(), self.gait_bounds
        periods = simulation.control_period / step
        if self.policy and (periods < 0.5 or abs(periods - round(periods)) > 1e-6):
            expected = f"expected a multiple of cpg.listing_step, {step} s, for a policy"
            refuse("simulation.control_period", f"found {simulation.control_period} s, {expected}")
        excluded = {"cpg.feedback": self.cpg.feedback, "gait_bounds.turn": bounds.turn}
        for key, value in excluded.items():
            if self.policy and value:
                refuse(key, f"found {value}, expected none: a policy excludes it")
        is_drake = isinstance(self.engine, Drake)
        most_signals = MOST_SIGNALS_OF_DRAKE if is_drake else MOST_SIGNALS
        least_step = simulation.duration * blueprint.signals / most_signals
        least_sample = simulation.duration * len(blueprint.bodies) / MOST_SAMPLES
        for key, period, least in (
            ("cpg.listing_step", step, least_step),
            ("simulation.sample_period", simulation.sample_period, least_sample),
            ("engine.step", getattr(self.engine, "step", math.inf), least_step),
        ):
            if period < least:
                problem = f"found {period} s, expected at least {least:.3g} s, to fit in memory"
                refuse(key, f"{problem}, for this duration and robot")

        if bounds.turn != 0.0 and not blueprint.sides.any():
            expected = "expected 0, as no group is on one side"
            refuse("gait_bounds.turn", f"found {bounds.turn}, {expected}")
        if bounds.mirrored and None in blueprint.images:
            oscillator = blueprint.oscillators[blueprint.images.index(None)]
            expected = f"expected false, as '{oscillator}' has no mirror image"
            refuse("gait_bounds.mirrored", f"found true, {expected}")
        return self

    @model_validator(mode="after")
    def _check_events(self) -> Self:
        """Refuses events after the end, unknown or repeated names, and changes that are no numbers
        of ground or friction."""
        if not self.events:
            return self
        check_taken(self.events, self.robot.blueprint())
        changeable = [key for key in self.numbers() if key.startswith(CHANGEABLE)]
        order = sorted(range(len(self.events)), key=lambda i: self.events[i].at)
        for i, events in zip(order, up_to_each(self.events), strict=True):
            place, event = f"events[{i}]", self.events[i]
            self._check_time(f"{place}.at", event.at)
            if not (event.cut or event.lose or event.change):
                refuse(place, "changes nothing, expected cut, lose or change")
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

    @model_validator(mode="after")
    def _check_evolve(self) -> Self:
        """Raises InputError if `evolve` names no number of the robot, or has bounds that the number
        cannot have. Converts the bounds to SI numbers with units."""
        fixed = self.with_sections(evolve={})
        for joined, bounds in self.evolve.items():
            place, keys, tree = f"evolve.{joined}", separate(joined), fixed.model_dump()
            for key in keys:
                self._check_body_key(key, value_at(tree, key), place)
            for index, bound in enumerate(bounds):
                try:
                    changed = fixed.with_changes(dict.fromkeys(keys, bound))
                except InputError as error:
                    leads = "" if error.key in keys else f"{_text(bound)}: {error.key}: "
                    refuse(place, f"{leads}{error.problem}")
                bounds[index] = value_at(changed.model_dump(), keys[0])
            low, high = bounds
            if not low <= high:
                refuse(place, f"found {low} to {high}, expected the least value first")
        return self

    def _check_body_key(self, key: str, value: Any, place: str) -> None:
        """Raises InputError, naming `place`, unless `key` is a key of a number of the robot.
        `value` is its value in the scenario; None if there is none."""
        if key.partition(".")[0] not in BODY_SECTIONS:
            expected = f"expected a key of {listed(BODY_SECTIONS)}"
            refuse(place, f"'{key}' is no key of the robot, {expected}")
        if value is None:
            own = [name for name in self.values() if name.startswith(BODY_SECTIONS)]
            refuse(place, f"'{key}' is no number of the scenario; {hint(key, own)}")
        if isinstance(value, int) and not isinstance(value, bool):
            refuse(
                place, f"'{key}' is a count, expected a number that leaves the structure as it is"
            )
        if not isinstance(value, float):
            example = f", such as {key}[0]" if isinstance(value, list) else ""
            refuse(place, f"found {described(value)}, expected the key of a number{example}")

    @model_validator(mode="after")
    def _check_disturbances(self) -> Self:
        """Raises InputError if `disturbances` name no number of the scenario, or if their largest
        changes would make a number invalid."""
        if self.disturbances is None:
            return self
        if cuts := self.disturbances.cuts:
            self._check_time("disturbances.cuts.at", cuts.at)
            whole = len(self.whole_cables)
            if cuts.count > whole:
                refuse("disturbances.cuts.count", f"found {cuts.count}, expected at most {whole}")
        undisturbed, numbers = self.with_sections(disturbances=None, evolve={}), self.numbers()
        for joined, spread in self.disturbances.spreads.items():
            place, keys = f"disturbances.spreads.{joined}", separate(joined)
            for key in keys:
                if key not in numbers:
                    refuse(place, f"'{key}' is no number of the scenario; {hint(key, numbers)}")
            for factor in (1.0 - spread, 1.0 + spread):
                changed = undisturbed.with_numbers({key: factor * numbers[key] for key in keys})
                try:
                    self.from_tree(changed.model_dump(), place)
                except InputError as error:
                    problem = f"{spread:g} leads to a wrong {error.key}: {error.problem}"
                    refuse(place, problem)
        return self


@functools.cache
def _thesis() -> Scenario:
    """The scenario `thesis`, which printed scenarios are compared with."""
    file = Path(__file__).parent / "thesis.yaml"
    return Scenario.from_tree(parse_yaml(read_text(file, "scenario file"), file), file)


def _text(value: Any, *, exact: bool = False) -> str:
    """Value of a setting as text. Numbers have six digits unless `exact`."""
    if value is None:
        return "none"
    text = json.dumps(written(value) if exact else written(value, plainest)).replace('"', "")
    if exact:
        return text
    return re.sub(r"\d+\.\d{6,}(e[+-]?\d+)?", lambda number: f"{float(number[0]):.6g}", text)


def _with_number(value: Any, names: Sequence[str], number: float) -> Any:
    """A copy of a section or mapping with another number at the path `names`: the parts of a dotted
    key, such as ["ground", "stiffness"]."""
    if not names:
        return number
    name, *rest = names
    if isinstance(value, Section):
        return value.model_copy(update={name: _with_number(getattr(value, name), rest, number)})
    return {**value, name: _with_number(value[name], rest, number)}
