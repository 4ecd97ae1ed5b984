"""Events during a simulation: cables that break, masses that fall off, pushes, other ground."""

from __future__ import annotations

import dataclasses
import operator
from collections.abc import Sequence
from typing import TypeVar

from pydantic import Field

from tetra_drake.errors import InputError
from tetra_drake.scenario.blueprint import Blueprint, cable_numbers
from tetra_drake.scenario.start import Push
from tetra_drake.settings.quantities import Keyed, Time
from tetra_drake.settings.refusals import check_known, hint, refuse
from tetra_drake.settings.section import Section

BlueprintT = TypeVar("BlueprintT", bound=Blueprint)


class Event(Section):
    """Change of robot or ground during the simulation. The time step ends there."""

    at: Time = Field(ge=0)
    """Time of the event."""
    cut: list[str] = Field(default=[])
    """Cables that break, such as T1-T2 outer top or side n1 n2. Their actuators turn freely."""
    lose: list[str] = Field(default=[])
    """Point masses that fall off: nodes in `masses` of a structure, or bodies with a `payload` of a
    row. The rest keeps its velocity."""
    change: Keyed[str, float | str] = Field(default={})
    """New numbers of the ground and its friction, by scenario key."""
    push: Push | None = Field(default=None, exclude_if=operator.not_)
    """Impulse that acts at once."""


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
            laws[cable] = laws[cable].cut()
        for name in event.lose:
            of_nodes = name in blueprint.node_names
            masses = node_mass if of_nodes else payload
            masses[(blueprint.node_names if of_nodes else blueprint.bodies).index(name)] = 0.0
    return dataclasses.replace(
        blueprint, cable_laws=tuple(laws), node_mass=node_mass, payload=payload
    )


def check_taken(events: Sequence[Event], blueprint: Blueprint) -> None:
    """Refuses names of cables and point masses that the robot does not have or that two events take
    away, the loss of all of a body's mass, and pushes on nothing or on what is held. Keys begin
    with "events"."""
    cables = cable_numbers(blueprint.cable_names)
    masses = {name: number for number, name in enumerate(_point_masses(blueprint))}
    taken: dict[object, str] = {}
    for i, event in enumerate(events):
        place = f"events[{i}]"
        named = [(f"{place}.cut[{k}]", name, cables) for k, name in enumerate(event.cut)]
        named += [(f"{place}.lose[{k}]", name, masses) for k, name in enumerate(event.lose)]
        for key, name, known in named:
            if name not in known:
                what = "cable" if known is cables else "point mass"
                none = "the robot has none; give it robot.masses or robot.payload"
                advice = hint(name, known) if known else none
                refuse(key, f"found unknown {what} '{name}'; {advice}")
            earlier = taken.setdefault((known is cables, known[name]), key)
            if earlier != key:
                refuse(key, f"found '{name}', which {earlier} takes away; expected it once")
        if event.push:
            _check_push(f"{place}.push", event.push, blueprint)
        try:
            blueprint_after(blueprint, events[: i + 1]).check_masses()
        except InputError as error:
            refuse(f"{place}.lose", f"{error.key} {error.problem}")


def _check_push(key: str, push: Push, blueprint: Blueprint) -> None:
    nodes, bodies = blueprint.node_names, blueprint.bodies
    check_known(f"{key}.on", "node or body", push.on, [*bodies, *nodes])
    held = blueprint.held[nodes.index(push.on)] if push.on in nodes else (False,) * 3
    for axis, is_held, impulse in zip("xyz", held, push.impulse, strict=True):
        if is_held and impulse:
            found = f"found {impulse:g} N*s along {axis}, along which {push.on} is held"
            refuse(f"{key}.impulse", f"{found}; expected 0")


def _point_masses(blueprint: Blueprint) -> list[str]:
    """Names of the nodes and bodies with a point mass. A body whose mass is given in place of its
    parts has none that could be lost."""
    of_nodes = zip(blueprint.node_names, blueprint.node_mass, blueprint.carriers, strict=True)
    of_bodies = zip(blueprint.bodies, blueprint.payload, strict=True)
    given = blueprint.given_inertia
    names = [name for name, mass, body in of_nodes if mass > 0.0 and body not in given]
    return names + [name for name, mass in of_bodies if mass > 0.0]
