"""Scenario: a world, and an experiment about it."""

from __future__ import annotations

import functools
import itertools
import json
import operator
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Self

from pydantic import ConfigDict, Field, model_validator

from tetra_drake.errors import InputError
from tetra_drake.files import read_text
from tetra_drake.formatting import TextTable, heading_html, listed
from tetra_drake.laws.oscillator import GaitBounds, GaitParameter
from tetra_drake.scenario.experiment_sections import (
    BODY_SECTIONS,
    BodyBounds,
    Disturbances,
    EvolutionSection,
)
from tetra_drake.scenario.metrics import METRICS, UNITS, inverse
from tetra_drake.scenario.optimizer_kinds import OptimizerKind, SteadyState
from tetra_drake.scenario.tolerances import (
    Tolerance,
    Tolerances,
    check_tolerances,
    split_tolerances,
)
from tetra_drake.scenario.world import World
from tetra_drake.scenario.yaml_text import dump_yaml, parse_yaml
from tetra_drake.settings.quantities import by_name, different_keys, separate
from tetra_drake.settings.refusals import TAG, described, hint, refuse
from tetra_drake.settings.section import value_at, written
from tetra_drake.settings.units import plainest, shortest

_WIDTH, _ROWS = 100, 20
"""Largest number of characters in a line of a printed scenario, and of rows in a notebook."""

_OF_WEIGHTS = {name: inverse(unit) for name, unit in UNITS.items()}
"""Units of the weights in an objective, by metric."""


class Scenario(World):
    """Scenario: a world, and an experiment about it: all settings except the gait."""

    model_config = ConfigDict(defer_build=True)

    keys_of_files: ClassVar = {"base": "Name or file of a scenario that has the other values."}

    gait_bounds: GaitBounds
    evolve: Annotated[BodyBounds, Field(exclude_if=operator.not_)] = Field(default={})
    """Bounds of numbers of the robot that evolve with the gait, by scenario key:
    `robot.cables.side.stiffness: [50 N/m, 400 N/m]`, `robot.nodes.n3[2]` for a coordinate z. Keys
    joined by commas get one value; equal bounds fix it. A file replaces all bounds of its base."""
    objective: Annotated[dict[str, float], *by_name(_OF_WEIGHTS), Field(min_length=1)]
    """Weights of metrics, such as `speed: 2 s/in`; evolution maximises the weighted sum. Lengths
    count in inches. A file replaces its base's objective."""
    require: Annotated[dict[str, float], *by_name(UNITS)] = Field(default={})
    """Limits of metrics; a gait beyond one counts as failed. A file replaces all limits of its
    base."""
    tolerances: Tolerances = Field(default={}, exclude_if=operator.not_)
    """Tolerances of numbers besides the robot's, by scenario key: `ground.stiffness: 20 %
    uniform`."""
    disturbances: Disturbances | None = None
    evolution: EvolutionSection
    optimizer: OptimizerKind = SteadyState()

    def undisturbed(self) -> Self:
        """A copy without events and disturbances."""
        return self.with_sections(events=[], disturbances=None)

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
        tags = [key for key in {**ours, **theirs} if key.endswith(f".{TAG}")]
        kinds = [key for key in tags if ours.get(key) != theirs.get(key)]
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
    def draw_count(self) -> int:
        """Number of simulations per gait in evolution: one, or one per draw of disturbances."""
        return self.disturbances.draws if self.disturbances else 1

    @functools.cached_property
    def parameters(self) -> Mapping[str, GaitParameter]:
        """Parameters of a gait by name: of the policy if there is one, otherwise of the
        oscillators."""
        if self.policy is not None:
            return self.policy.gait_parameters(self.blueprint())
        return self.cpg.parameters(self.blueprint(), self.gait_bounds)

    _split = model_validator(mode="before")(split_tolerances)
    _check_known = model_validator(mode="after")(check_tolerances)

    @model_validator(mode="after")
    def _check_experiment(self) -> Self:
        """Raises InputError, naming a key, for metrics that the world does not have, and for bounds
        of gaits that do not go with its robot or policy."""
        measures = getattr(self.optimizer, "measures", {})
        named = {"objective": self.objective, "require": self.require}
        for key, metrics in {**named, "optimizer.measures": measures}.items():
            for name, section in itertools.product(metrics, (self.robot, self.actuation)):
                if METRICS[name].needs in section.lacking:
                    problem = f"does not have this metric; give `{key}` without it"
                    refuse(f"{key}.{name}", f"!{section.tag} {problem}")

        blueprint, bounds = self.robot.blueprint(), self.gait_bounds
        if self.policy and bounds.turn:
            found = f"found {bounds.turn}, expected none"
            refuse("gait_bounds.turn", f"{found}: a policy excludes it")
        if bounds.turn != 0.0 and not blueprint.sides.any():
            expected = "expected 0, as no group is on one side"
            refuse("gait_bounds.turn", f"found {bounds.turn}, {expected}")
        if bounds.mirrored and not self.cpg.mirrors:
            refuse("gait_bounds.mirrored", f"found true, expected false for !{self.cpg.tag}")
        if bounds.mirrored and None in blueprint.images:
            oscillator = blueprint.oscillators[blueprint.images.index(None)]
            expected = f"expected false, as '{oscillator}' has no mirror image"
            refuse("gait_bounds.mirrored", f"found true, {expected}")
        return self

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
            refuse(place, f"'{key}' is a count, expected a number that keeps the structure")
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
        undisturbed = self.with_sections(disturbances=None, evolve={})
        tree = self.model_dump(exclude={"disturbances", "objective", "require"})
        for joined, spread in self.disturbances.spreads.items():
            place, keys = f"disturbances.spreads.{joined}", separate(joined)
            numbers = {key: value_at(tree, key) for key in keys}
            for key, number in numbers.items():
                if not isinstance(number, float):
                    advice = hint(key, self.numbers())
                    refuse(place, f"'{key}' is no number of the scenario; {advice}")
            for factor in (1.0 - spread, 1.0 + spread):
                changed = undisturbed.with_numbers({key: factor * x for key, x in numbers.items()})
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
