"""A rover that a planner steers: goals, courses, slopes, and what the plans cost.

    python runs/planning.py [GROUP ...]

Runs the episodes of planning/episodes.yaml, or of the given groups. records.jsonl in the folder
planning/ gets a line per episode; episodes that have one are skipped, so an interrupted script
continues. Then planning_page.py writes the page README.md and its pictures from the records.
"""

from __future__ import annotations

import contextlib
import functools
import itertools
import math
import os
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from planning_page import (
    FILM,
    GIVEN,
    GROUPS,
    HERE,
    RECORDS,
    Record,
    centre_of,
    film,
    load_records,
    write_page,
)
from records import append
from scipy.ndimage import generate_binary_structure, map_coordinates, minimum_filter
from script import chosen, evolved, script, with_defaults

from tetra_drake.engines.simulate import simulate
from tetra_drake.lab.planner import Planner
from tetra_drake.lab.prototype.export import COMMAND, export
from tetra_drake.lab.study.robustness import default_disturbances
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.command import Command
from tetra_drake.robot.command_file import load_command
from tetra_drake.robot.readings import Readings
from tetra_drake.scenario.disturbances import disturbed, fresh_draws
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.scenario import Scenario

GAIT = GIVEN["gait"]
"""What differs where the planner begins with a gait."""
GRID = np.linspace(-7.0, 7.0, 141)
"""Places (m) in both directions of the map of ways."""
SCRATCH = Path("out/planning")
"""Folder for the run of the gait that climbs."""


def clearance(p_WN: np.ndarray, pillars: Sequence[Sequence[float]]) -> np.ndarray:
    """Least distance (...) in m of the pillars from the circle around the centre that encloses all
    nodes (..., nodes, 3). It is negative if the circle reaches into a pillar."""
    centre = centre_of(p_WN)
    reach = np.linalg.norm(p_WN[..., :2] - centre[..., np.newaxis, :], axis=-1).max(axis=-1)
    away = np.linalg.norm(centre[..., np.newaxis, :] - np.asarray(pillars), axis=-1).min(axis=-1)
    return np.asarray(away - reach - GIVEN["pillar"])


def way_field(goal: Sequence[float], pillars: Sequence[Sequence[float]]) -> np.ndarray:
    """Ways (m) to a goal around pillars, on the GRID in both directions. A metre that is nearer to
    a pillar than `apart` counts as `slow` ones."""
    x, y = np.meshgrid(GRID, GRID, indexing="ij")
    away = np.min([np.hypot(x - px, y - py) for px, py in pillars], axis=0)
    pace = float(GRID[1] - GRID[0]) * np.where(away < GIVEN["apart"], GIVEN["slow"], 1.0)
    field = np.full(x.shape, math.inf)
    field[np.abs(GRID - goal[0]).argmin(), np.abs(GRID - goal[1]).argmin()] = 0.0
    before = np.zeros_like(field)
    nearest = partial(minimum_filter, mode="constant", cval=math.inf)
    while (field != before).any():
        before = field
        beside = nearest(field, footprint=generate_binary_structure(2, 1)) + pace
        across = nearest(field, size=3) + math.sqrt(2.0) * pace
        field = np.minimum(field, np.minimum(beside, across))
    return field


@dataclass
class Way:
    """Cost: way (m) of the centre to the next place after the horizon, around the pillars. Circles
    around the robot that come too near to pillars cost extra."""

    places: Sequence[Sequence[float]]
    pillars: Sequence[Sequence[float]] = ()
    passed: int = 0

    def __post_init__(self) -> None:
        self.fields = [way_field(place, self.pillars) for place in self.places if self.pillars]

    def __call__(self, readings: Readings) -> np.ndarray:
        ends = centre_of(readings.p_WN[-1])
        if not self.pillars:
            return np.asarray(np.linalg.norm(ends - np.asarray(self.places[self.passed]), axis=-1))
        at = (ends.T - GRID[0]) / (GRID[1] - GRID[0])
        cost = map_coordinates(self.fields[self.passed], at, order=1, mode="nearest")
        missing = np.maximum(0.0, GIVEN["margin"] - clearance(readings.p_WN, self.pillars))
        return np.asarray(cost + GIVEN["penalty"] * missing.max(axis=0))

    def found(self, p_WN: np.ndarray) -> Record:
        """What its record has, of nodes (times, nodes, 3): places, pillars and least clearance."""
        least = {"clearance": float(clearance(p_WN, self.pillars).min())} if self.pillars else {}
        return {"places": self.places, "pillars": self.pillars, **least}

    def is_done(self, readings: Readings) -> bool:
        """True if the robot is at the last place of its way."""
        away = centre_of(readings.p_WN) - np.asarray(self.places[self.passed])
        at_place = bool(np.linalg.norm(away) < GIVEN["near"])
        is_last = self.passed == len(self.places) - 1
        self.passed += at_place and not is_last
        return at_place and is_last


class Ahead:
    """Cost: minus the way (m) along x after the horizon."""

    def __call__(self, readings: Readings) -> np.ndarray:
        return np.asarray(-readings.p_WN[-1, ..., 0].mean(axis=-1))

    def found(self, p_WN: np.ndarray) -> Record:
        """Nothing else."""
        return {}

    def is_done(self, readings: Readings) -> bool:
        """False: it goes on until the time is over."""
        return False


@dataclass
class Turn:
    """Cost: angle (rad) between a row's heading and a wanted one, on average over the horizon."""

    heading: float
    """Angle from the x axis to the left, in rad."""

    def error(self, p_WN: np.ndarray) -> np.ndarray:
        """Angles (...) in rad from the wanted heading, from nodes (..., nodes, 3) of a row."""
        ahead = centre_of(p_WN[..., -4:, :]) - centre_of(p_WN[..., :4, :])
        angle = np.arctan2(ahead[..., 1], ahead[..., 0]) - self.heading
        return np.asarray(np.abs((angle + math.pi) % math.tau - math.pi))

    def __call__(self, readings: Readings) -> np.ndarray:
        return self.error(readings.p_WN)

    def found(self, p_WN: np.ndarray) -> Record:
        """The angle (rad) that is left."""
        return {"error": float(self.error(p_WN[-1]))}

    def is_done(self, readings: Readings) -> bool:
        """True within 5 degrees."""
        return bool(self.error(readings.p_WN) < math.radians(5.0))


Task = Way | Ahead | Turn


class Episode(SimpleNamespace):
    """An entry of `episodes` in the file, with what differs from the `defaults` there."""

    @property
    def settings(self) -> dict[str, Any]:
        """Arguments of the planner after the cost, without the command."""
        return GIVEN["planner"] | {"seed": self.seed} | (GAIT["planner"] if self.climbs else {})

    def task(self) -> Task:
        """What the robot has to do."""
        if self.turn is not None:
            return Turn(math.radians(self.turn))
        if self.goal is not None:
            angle = math.radians(self.goal)
            return Way([(GIVEN["far"] * math.cos(angle), GIVEN["far"] * math.sin(angle))])
        return Way(self.places, self.pillars) if self.places else Ahead()

    def scenarios(self) -> tuple[Scenario, Scenario]:
        """Scenarios of the robot and of the planner's model."""
        changes = {"simulation.steady_from": self.steady, "simulation.duration": f"{self.most} s"}
        changes |= GIVEN["grounds"][self.ground] | (GAIT["row"] if self.climbs else {})
        if self.friction is not None:
            changes |= uphill(self.degrees, self.friction)
        scenario = load_scenario(self.base).with_changes(changes)
        plant = scenario.with_changes(GIVEN["engines"][self.plant])
        if self.is_disturbed and self.goal is not None:
            draw = round(self.goal / 18.0)
            plant = plant.with_sections(disturbances=default_disturbances(plant))
            plant = disturbed(plant, fresh_draws(plant, 0, draw + 1)[draw])
        return plant, scenario.with_changes({"engine": GIVEN["model"]})


def all_episodes() -> list[Episode]:
    """All episodes, in the order of the file: one for each combination of the values in `each`."""
    episodes = []
    for row in GIVEN["episodes"]:
        common = with_defaults(row, GIVEN["defaults"], HERE / "episodes.yaml")
        each = common["each"]
        for values in itertools.product(*each.values()):
            given = common | dict(zip(each, values, strict=True))
            episodes.append(Episode(**given | {"name": row["name"].format(**given)}))
    return episodes


def uphill(degrees: float, friction: float) -> dict[str, Any]:
    """Changes of a scenario to an incline with a coefficient of friction, at rest and in motion."""
    terrain = f"!Incline {{slope: {degrees} deg}}"
    return {"terrain": terrain, "friction.static": friction, "friction.kinetic": friction}


@functools.cache
def climbing_command() -> Command:
    """Commands of a gait of the row that climbs 20 degrees, one per control period. Evolves the
    gait if that is not done."""
    changes = {**uphill(20, 0.8), **GAIT["row"], **GAIT["evolution"]}
    run = evolved(load_scenario("motors").with_changes(changes), SCRATCH)
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "uphill"
        export(run, run, out, rate=1.0 / GAIT["planner"]["control_period"])
        return load_command(out / COMMAND, run)


class Over(Exception):
    """The end of an episode, from within its controller."""


def run_episode(episode: Episode) -> tuple[Record, SimulationResult]:
    """Runs an episode. Returns its record, and the result of the same actions up to its end."""
    scenario, model = episode.scenarios()
    task, settings = episode.task(), episode.settings
    command = climbing_command() if episode.climbs else None
    planner, period = Planner(model, task, **settings, command=command), settings["control_period"]
    actions: list[np.ndarray] = []
    cpu, is_done, load = [], False, os.getloadavg()[0]

    def act(now: float, readings: Readings) -> np.ndarray:
        nonlocal is_done
        is_done = len(actions) > 0 and task.is_done(readings)
        if is_done or now > episode.most - 0.5 * period:
            raise Over
        begun, decided = time.process_time(), planner.decisions
        actions.append(planner(now, readings))
        if planner.decisions > decided:
            cpu.append(time.process_time() - begun)
        return actions[-1]

    # One period more, at whose beginning it is over.
    longer = scenario.with_numbers({"simulation.duration": episode.most + period})
    with contextlib.suppress(Over):
        simulate(longer, controller=act, control_period=period)
    short = scenario.with_changes({"simulation.duration": f"{period * len(actions):.6g} s"})
    again = partial(simulate, short, control_period=period, record=True)
    result = again(controller=lambda now, _: actions[round(now / period)])
    record = recorded(episode, result) | task.found(result.trajectory.p_WN.values)
    record |= {"is_done": is_done, "cpu": cpu, "wall": planner.wall_times, "load": load}
    record |= {key: np.round(record[key], 3).tolist() for key in ("cpu", "wall", "load")}
    if command is not None:
        alone = simulate(scenario, command=command)
        record["command_speed"] = alone.metrics.relative_speed
    return record, result


def recorded(episode: Episode, result: SimulationResult) -> Record:
    """Record of the motion of an episode, in SI units."""
    trajectory, metrics, centre = result.trajectory, result.metrics, result.path.centre
    every = round(episode.settings["control_period"] / float(np.diff(trajectory.time[:2])[0]))
    steps = centre_of(trajectory.p_WN.values)[::every]
    away = float(np.linalg.norm((centre[-1] - centre[0])[:2]))
    return {
        "group": episode.group,
        "name": episode.name,
        "time": result.duration,
        "way": float(np.linalg.norm(np.diff(steps, axis=0), axis=1).sum()),
        "cost_of_transport": metrics.cost_of_transport,
        "work": metrics.cost_of_transport * result.robot.weight * away,
        "relative_speed": metrics.relative_speed,
        "path": steps.round(3).tolist(),
    }


def run_all(episodes: Sequence[Episode], folder: Path) -> None:
    """Runs the episodes that have no record in a folder, and writes their records."""
    known = load_records(folder)
    for episode in episodes:
        if (episode.group, episode.name) in known:
            continue
        record, _ = run_episode(episode)
        append(folder / RECORDS, [record])
        cost = float(np.mean(record["cpu"]))
        done = "done" if record["is_done"] else "not done"
        print(f"{episode.group}, {episode.name}: {done}, {record['time']:.1f} s, {cost:.2f} s CPU")


@script
def main(groups: Sequence[str], folder: Path = HERE) -> None:
    """Runs the episodes of groups, or all, films the slalom, and writes the page. Raises
    InputError."""
    groups, episodes = chosen(groups, GROUPS, "GROUP"), all_episodes()
    run_all([each for each in episodes if each.group in groups], folder)
    if not (folder / FILM).exists():
        (slalom,) = (each for each in episodes if each.name == "slalom")
        record, result = run_episode(slalom)
        film(result, record, folder / FILM)
    write_page(folder, episodes)
