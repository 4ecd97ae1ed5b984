"""Events during a simulation: cables that break, masses that fall off, a ground that changes."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING, TypeVar

from pydantic import Field

from tetra_drake.errors import InputError
from tetra_drake.laws.cable import CableLaw
from tetra_drake.scenario.blueprint import Blueprint
from tetra_drake.scenario.robot_structure import cable_numbers
from tetra_drake.settings.quantities import Keyed, Time
from tetra_drake.settings.refusals import hint, refuse
from tetra_drake.settings.section import Section

if TYPE_CHECKING:
    from tetra_drake.scenario.scenario import Scenario

BlueprintT = TypeVar("BlueprintT", bound=Blueprint)

CHANGED = "friction.", "ground."
"""First parts of the keys whose numbers an event may change."""


class Event(Section):
    """Change of robot or ground during the simulation. The time step ends there."""

    at: Time = Field(ge=0)
    """Time of the event."""
    cut: list[str] = Field(default=[])
    """Names of cables that break, such as T1-T2 outer top or side n1 n2. A cut cable has no
    tension, and its actuator turns freely."""
    lose: list[str] = Field(default=[])
    """Point masses that fall off: nodes in `masses` of a structure, or bodies with a `payload` of a
    row. The rest of the body keeps its velocity."""
    change: Keyed[str, float | str] = Field(default={})
    """New numbers by scenario key, such as friction.static, of the ground and its friction."""


def up_to_each(events: Sequence[Event]) -> list[list[Event]]:
    """For each event, in the order of time, all events up to it."""
    ordered = sorted(events, key=lambda event: event.at)
    return [ordered[: k + 1] for k in range(len(ordered))]


def blueprint_after(blueprint: BlueprintT, events: Sequence[Event]) -> BlueprintT:
    """Copy of a blueprint without the cables and point masses that `events` take away. The cables
    stay in its lists."""
    numbers, laws = cable_numbers(blueprint.cable_names), [*blueprint.cable_laws]
    node_mass, payload = blueprint.node_mass.copy(), blueprint.payload.copy()
    for event in events:
        for cable in (numbers[name] for name in event.cut):
            laws[cable] = CableLaw(**laws[cable]).cut()._asdict()
        for name in event.lose:
            of_nodes = name in blueprint.node_names
            masses = node_mass if of_nodes else payload
            masses[(blueprint.node_names if of_nodes else blueprint.bodies).index(name)] = 0.0
    return dataclasses.replace(
        blueprint, cable_laws=tuple(laws), node_mass=node_mass, payload=payload
    )


def changed_laws(scenario: Scenario, events: Sequence[Event]) -> Scenario:
    """Checked copy of a scenario with the numbers that `events` change, and without events. Raises
    InputError for a number that its key does not allow."""
    alone = scenario.with_sections(events=[], disturbances=None)
    changes: dict[str, float | str] = {}
    for event in events:
        changes |= event.change
    return alone.with_changes(changes) if changes else alone


def check_events(scenario: Scenario) -> None:
    """Refuses events after the end, unknown or repeated names, and changes that are no numbers of
    ground or friction, or that leave a body without mass."""
    blueprint = scenario.robot.blueprint()
    cables = cable_numbers(blueprint.cable_names)
    masses = {name: number for number, name in enumerate(_point_masses(blueprint))}
    changeable = [key for key in scenario.numbers() if key.startswith(CHANGED)]
    taken: dict[object, str] = {}
    order = sorted(range(len(scenario.events)), key=lambda i: scenario.events[i].at)
    for i, events in zip(order, up_to_each(scenario.events), strict=True):
        place, event = f"events[{i}]", events[-1]
        check_before_end(f"{place}.at", event.at, scenario)
        if not (event.cut or event.lose or event.change):
            refuse(place, "changes nothing, expected cut, lose or change")
        named = [(f"{place}.cut[{k}]", name, cables) for k, name in enumerate(event.cut)]
        named += [(f"{place}.lose[{k}]", name, masses) for k, name in enumerate(event.lose)]
        for key, name, known in named:
            if name not in known:
                what = "cable" if known is cables else "point mass"
                refuse(key, f"found unknown {what} '{name}'; {hint(name, known)}")
            earlier = taken.setdefault((known is cables, known[name]), key)
            if earlier != key:
                refuse(key, f"found '{name}', which {earlier} takes away; expected it once")
        for key in event.change:
            if key not in changeable:
                found = f"'{key}' is no number of ground or friction; {hint(key, changeable)}"
                refuse(f"{place}.change", found)
        try:
            changed_laws(scenario, events)
        except InputError as error:
            refuse(f"{place}.change.{error.key}", error.problem)
        try:
            blueprint_after(blueprint, events).check_masses()
        except InputError as error:
            refuse(f"{place}.lose", f"{error.key} {error.problem}")


def check_before_end(key: str, time: float, scenario: Scenario) -> None:
    """Refuses a time (s), at `key`, that is not before the end of the scenario's simulation."""
    end = scenario.simulation.duration
    if time >= end:
        refuse(key, f"found {time:g} s, expected less than the duration, {end:g} s")


def _point_masses(blueprint: Blueprint) -> list[str]:
    """Names of the nodes and bodies with a point mass. A body whose mass is given in place of its
    parts has none that could be lost."""
    of_nodes = zip(blueprint.node_names, blueprint.node_mass, blueprint.carriers, strict=True)
    given, of_bodies = (
        blueprint.given_inertia,
        zip(blueprint.bodies, blueprint.payload, strict=True),
    )
    names = [name for name, mass, body in of_nodes if mass > 0.0 and body not in given]
    return names + [name for name, mass in of_bodies if mass > 0.0]
