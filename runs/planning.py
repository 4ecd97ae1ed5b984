"""A rover that a planner steers: goals, courses, slopes, and what the plans cost.

    python runs/planning.py [GROUP ...]

Runs the episodes of the groups, by default of all. records.jsonl in the folder planning/ gets a
line per episode; episodes that have one are skipped, so an interrupted script continues. Then the
script writes the page README.md and its pictures from the records.
"""

from __future__ import annotations

import argparse
import contextlib
import functools
import math
import os
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from PIL import Image
from record import load_times
from records import append, read
from scipy.ndimage import map_coordinates

from tetra_drake.engines.planner import Planner
from tetra_drake.engines.simulate import simulate
from tetra_drake.evolution.manifest import MANIFEST
from tetra_drake.experiment import evolve
from tetra_drake.figures.style import save_figure
from tetra_drake.files import write_whole
from tetra_drake.formatting import TextTable, fixed, listed
from tetra_drake.prototype.command_file import load_command
from tetra_drake.prototype.export import COMMAND, export
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.command import Command
from tetra_drake.robot.readings import Readings
from tetra_drake.scenario.disturbances import disturbed, fresh_draws
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.study.robustness import default_disturbances

HERE = Path(__file__).parent / "planning"
RECORDS, PAGE_NAME, FILM = "records.jsonl", "README.md", "slalom.gif"

MODEL = "!Compiled {tolerance: 10 mm/s, max_step: 10 ms}"
"""Engine of the planner's model. Its tolerance is a hundred times coarser than the robot's."""
PLANNING: Mapping[str, Any] = {
    "samples": 200,
    "horizon": 2.0,
    "knots": 6,
    "temperature": 0.1,
    "noise": 1.0,
    "control_period": 0.1,
    "decision_period": 0.5,
    "delayed": True,
}
"""Arguments of the planner. A plan acts one decision period after its readings."""
CORES = 2
"""Number of cores that a decision may use for its whole period."""

NEAR, FAR = 0.3, 3.0
"""Distance (m) of the centre from a goal that is reached, and of the goals from the start."""
PILLAR, MARGIN = 0.1, 0.15
"""Radius of pillars, and distance from them that costs nothing, in m."""
PENALTY = 10.0
"""Cost per metre of reaching into a pillar or its margin, at the worst time of the horizon."""
APART, SLOW = 0.65, 4.0
"""Distance (m) of the centre from pillars where it is in their way, and factor of ways there."""
GRID = np.linspace(-7.0, 7.0, 141)
"""Places (m) in both directions of the map of ways."""
SLALOM = [(1.2, 0.0), (3.0, 0.0), (4.8, 0.0)]
"""Pillars of the slalom."""
SLALOM_WAY = [(1.2, 0.8), (3.0, -0.8), (4.8, 0.8), (6.0, 0.0)]
"""Points that the rover has to pass, the last one the goal."""
SLOPES = ((10, 0.5), (15, 0.5), (20, 0.5), (24, 0.5), (20, 0.8), (28, 0.8), (32, 0.8))
"""Slopes in degrees, and the coefficients of friction there. The scenario has 0.5."""
GAIN = {"cpg.gain": "4 lbf"}
"""Change of the row for climbs from a gait."""
CLIMBING: Mapping[str, Any] = {
    **GAIN,
    "require": {},
    "simulation.duration": "10 s",
    "optimizer": "!CmaEs {starts: 2}",
    "evolution.trials": 1,
    "evolution.evaluations": 600,
    "name": "uphill",
}
"""Changes of the row uphill for the evolution of a gait."""
SCRATCH = Path("out/planning")
"""Folder for the run of this gait."""
FROM_GAIT: Mapping[str, Any] = {
    "samples": 100,
    "horizon": 1.0,
    "temperature": 0.3,
    "noise": 0.1,
    "control_period": 0.05,
    "decision_period": 0.1,
    "delayed": False,
}
"""Arguments of a planner that changes the commands of a gait."""
CLIMBS: Mapping[float, Sequence[str]] = {
    0.8: ("compiled", "MuJoCo", "diagram"),
    0.5: ("compiled",),
}
"""Coefficients of friction uphill with this planner, and the robot's engines."""
FRAME, COLOURS = 0.2, 12
"""Time between the film's pictures in s, and number of their colours."""
VIEW, TALL = math.radians(40.0), 0.6
"""Angle (rad) from the horizontal at which the film looks down, and height (m) of its pillars."""
LONG = 40.0
"""Time (s) of episodes on level ground."""
GROUNDS: Mapping[str, tuple[Mapping[str, Any], int]] = {
    "level": ({}, 6),
    "level, model and robot without bristles": ({"friction.stiffness": "0 N/m"}, 4),
}
"""Level grounds: changes of the scenario of model and robot, and number of seeds of the planner's
noise."""
GROUPS = (
    "goals, compiled",
    "courses",
    "goals, MuJoCo",
    "goals, disturbed",
    "speeds",
    "others",
    "real time",
)
"""Groups of episodes, in the order of the runs."""


def centre_of(p_WN: np.ndarray) -> np.ndarray:
    """Horizontal centre (..., 2) of nodes (..., nodes, 3)."""
    return np.asarray(p_WN[..., :2].mean(axis=-2))


def clearance(p_WN: np.ndarray, pillars: Sequence[Sequence[float]]) -> np.ndarray:
    """Least distance (...) in m of the pillars from the circle around the centre that encloses all
    nodes (..., nodes, 3). It is negative if the circle reaches into a pillar."""
    centre = centre_of(p_WN)
    reach = np.linalg.norm(p_WN[..., :2] - centre[..., np.newaxis, :], axis=-1).max(axis=-1)
    away = np.linalg.norm(centre[..., np.newaxis, :] - np.asarray(pillars), axis=-1).min(axis=-1)
    return np.asarray(away - reach - PILLAR)


def way_field(goal: Sequence[float], pillars: Sequence[Sequence[float]]) -> np.ndarray:
    """Ways (m) to a goal around pillars, on the GRID in both directions. A metre that is nearer to
    a pillar than APART counts as SLOW ones."""
    x, y = np.meshgrid(GRID, GRID, indexing="ij")
    away = np.min([np.hypot(x - px, y - py) for px, py in pillars], axis=0)
    pace = float(GRID[1] - GRID[0]) * np.where(away < APART, SLOW, 1.0)
    field = np.full(x.shape, math.inf)
    field[np.abs(GRID - goal[0]).argmin(), np.abs(GRID - goal[1]).argmin()] = 0.0
    sides = [(i, j) for i in (0, 1, 2) for j in (0, 1, 2)]
    before = np.zeros_like(field)
    while (field != before).any():
        before, around = field, np.pad(field, 1, constant_values=math.inf)
        for i, j in sides:
            there = around[i : i + len(GRID), j : j + len(GRID)]
            field = np.minimum(field, there + math.hypot(i - 1, j - 1) * pace)
    return field


@dataclass
class Way:
    """Cost: way (m) of the centre to the next place after the horizon, around the pillars. Circles
    around the robot that come too near to pillars cost PENALTY."""

    places: Sequence[Sequence[float]]
    pillars: Sequence[Sequence[float]] = ()
    passed: int = 0

    def __post_init__(self) -> None:
        places = self.places if self.pillars else []
        self.fields = [way_field(place, self.pillars) for place in places]

    def __call__(self, readings: Readings) -> np.ndarray:
        ends = centre_of(readings.p_WN[-1])
        if not self.pillars:
            return np.asarray(np.linalg.norm(ends - np.asarray(self.places[self.passed]), axis=-1))
        at = (ends.T - GRID[0]) / (GRID[1] - GRID[0])
        cost = map_coordinates(self.fields[self.passed], at, order=1, mode="nearest")
        missing = np.maximum(0.0, MARGIN - clearance(readings.p_WN, self.pillars))
        return np.asarray(cost + PENALTY * missing.max(axis=0))

    def is_done(self, readings: Readings) -> bool:
        """True if the robot is at the last place of its way."""
        away = centre_of(readings.p_WN) - np.asarray(self.places[self.passed])
        at_place = bool(np.linalg.norm(away) < NEAR)
        is_last = self.passed == len(self.places) - 1
        self.passed += at_place and not is_last
        return at_place and is_last


class Ahead:
    """Cost: minus the way (m) along x after the horizon."""

    def __call__(self, readings: Readings) -> np.ndarray:
        return np.asarray(-readings.p_WN[-1, ..., 0].mean(axis=-1))

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

    def is_done(self, readings: Readings) -> bool:
        """True within 5 degrees."""
        return bool(self.error(readings.p_WN) < math.radians(5.0))


Task = Way | Ahead | Turn
Record = dict[str, Any]
"""Record of an episode; see recorded()."""
PLANTS: Mapping[str, Mapping[str, Any]] = {
    "compiled": {"engine": "!Compiled"},
    "MuJoCo": {"engine": "!Mujoco", "friction.stiffness": "0 N/m"},  # it has no bristles
    "diagram": {"engine": "!Drake"},
}
"""Changes of the scenario by the robot's engine."""


@dataclass(frozen=True)
class Episode:
    """A robot, and what it has to do."""

    group: str
    name: str
    make_task: Callable[[], Task]
    base: str = "rover"
    """Name of a shipped scenario."""
    changes: Mapping[str, Any] = field(default_factory=dict)
    """Changes of the scenario of robot and model."""
    plant: str = "compiled"
    """Engine of the robot, see PLANTS."""
    draw: int | None = None
    """Number of the draw of disturbances; None without them."""
    most: float = 60.0
    """Time (s) after which the episode ends."""
    planning: Mapping[str, Any] = field(default_factory=dict)
    """Arguments of the planner that differ from PLANNING."""
    make_command: Callable[[], Command] | None = None
    """Makes the command that the plans change; None without one."""

    @property
    def settings(self) -> dict[str, Any]:
        """Arguments of the planner after the cost, without the command."""
        return {**PLANNING, **self.planning}

    def scenarios(self) -> tuple[Scenario, Scenario]:
        """Scenarios of the robot and of the planner's model."""
        changes = {"simulation.steady_from": "0 s", "simulation.duration": f"{self.most} s"}
        changes |= self.changes
        scenario = load_scenario(self.base).with_changes(changes)
        plant = scenario.with_changes(PLANTS[self.plant])
        if self.draw is not None:
            plant = plant.with_sections(disturbances=default_disturbances(plant))
            plant = disturbed(plant, fresh_draws(plant, 0, self.draw + 1)[self.draw])
        return plant, scenario.with_changes({"engine": MODEL})


def around(group: str, plant: str, is_disturbed: bool = False) -> list[Episode]:
    """Episodes with goals in 20 directions."""
    episodes = []
    for number in range(20):
        angle = math.radians(18.0 * number)
        goal = FAR * math.cos(angle), FAR * math.sin(angle)
        name, draw = f"{18 * number} degrees", number if is_disturbed else None
        make_task = lambda goal=goal: Way([goal])  # noqa: E731
        episodes.append(Episode(group, name, make_task, plant=plant, draw=draw))
    return episodes


def course(number: int) -> tuple[tuple[float, float], list[tuple[float, float]]]:
    """Goal and three pillars of a course: one in the way, the others in reach beside it."""
    random = np.random.default_rng(number)
    angle = random.uniform(-math.pi, math.pi)
    ahead = np.array([math.cos(angle), math.sin(angle)])
    left = np.array([-ahead[1], ahead[0]])
    sides = random.uniform([-0.2, 0.5, -1.2], [0.2, 1.2, -0.5])
    ways = random.uniform([1.2, 0.6, 1.2], [1.8, 1.6, 2.2])
    pillars = ways[:, np.newaxis] * ahead + sides[:, np.newaxis] * left
    x, y = (FAR * ahead).tolist()
    return (x, y), [(x, y) for x, y in pillars.round(3).tolist()]


def courses() -> list[Episode]:
    """Nine courses with three pillars each, and the slalom."""
    episodes = []
    for number in range(9):
        goal, pillars = course(number)
        make_task = lambda goal=goal, pillars=pillars: Way([goal], pillars)  # noqa: E731
        episodes.append(Episode("courses", f"course {number + 1}", make_task))
    slalom = Episode("courses", "slalom", lambda: Way(SLALOM_WAY, SLALOM))
    return [slalom, *episodes]


def speeds() -> list[Episode]:
    """The rover as fast as it can, on level ground and up inclines, on three engines."""
    episodes = []
    for ground, (changes, seeds) in GROUNDS.items():
        for plant in PLANTS:
            for seed in range(seeds):
                own = {"simulation.steady_from": "2 s", **changes}
                episode = Episode(
                    group="speeds",
                    name=f"{ground}, {plant}, seed {seed}",
                    make_task=Ahead,
                    changes=own,
                    plant=plant,
                    most=LONG,
                    planning={"seed": seed},
                )
                episodes.append(episode)
    for degrees, friction in SLOPES:
        steep = {"simulation.steady_from": "2 s", **uphill(degrees, friction)}
        for plant in PLANTS:
            name = f"{degrees} degrees, friction {friction:g}, {plant}"
            episodes.append(Episode("speeds", name, Ahead, changes=steep, plant=plant, most=10.0))
    return episodes


def uphill(degrees: float, friction: float) -> dict[str, Any]:
    """Changes of a scenario to an incline with a coefficient of friction, at rest and in motion."""
    terrain = f"!Incline {{slope: {degrees} deg}}"
    return {"terrain": terrain, "friction.static": friction, "friction.kinetic": friction}


@functools.cache
def climbing_command() -> Command:
    """Commands of a gait of the row that climbs 20 degrees, one per control period. Evolves the
    gait if that is not done."""
    scenario = load_scenario("motors").with_changes({**uphill(20, 0.8), **CLIMBING})
    is_there = (SCRATCH / MANIFEST).exists()
    run = evolve(scenario, SCRATCH, resume=is_there, reevaluate=False, report=False)
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "uphill"
        export(run, run, out, rate=1.0 / FROM_GAIT["control_period"])
        return load_command(out / COMMAND, run)


def climb_name(friction: float, plant: str) -> str:
    """Name of the episode with a coefficient of friction and an engine."""
    return f"row, up 20 degrees, friction {friction:g}, from a gait, {plant}"


def climbs() -> list[Episode]:
    """The thesis's row with motors up an incline, by changes of a gait's commands."""
    episodes = []
    for friction, plants in CLIMBS.items():
        for plant in plants:
            climb = Episode(
                group="others",
                name=climb_name(friction, plant),
                make_task=Ahead,
                base="motors",
                changes={**uphill(20, friction), **GAIN},
                plant=plant,
                most=10.0,
                planning=FROM_GAIT,
                make_command=climbing_command,
            )
            episodes.append(climb)
    return episodes


def others() -> list[Episode]:
    """The thesis's row with motors and the six-bar: turns, and up an incline."""
    episodes, steep = [], uphill(20, 0.5)
    for degrees in (45, 90, -90, 180):
        make_task = lambda degrees=degrees: Turn(math.radians(degrees))  # noqa: E731
        episodes.append(Episode("others", f"row, turns by {degrees} degrees", make_task, "motors"))
    return [
        *episodes,
        Episode("others", "row, up 20 degrees", Ahead, "motors", steep, most=5.0),
        *climbs(),
        Episode("others", "six-bar, ahead", Ahead, "six_bar", most=10.0),
        Episode("others", "six-bar, up 20 degrees", Ahead, "six_bar", steep, most=10.0),
    ]


def all_episodes() -> list[Episode]:
    """All episodes, in the order of their importance."""
    goals, more = around("goals, compiled", "compiled"), around("goals, MuJoCo", "MuJoCo")
    disturbed_ones = around("goals, disturbed", "compiled", is_disturbed=True)
    real_time = around("real time", "compiled")[::4]
    return [*goals, *courses(), *more, *disturbed_ones, *speeds(), *others(), *real_time]


class Over(Exception):
    """The end of an episode, from within its controller."""


def run_episode(episode: Episode) -> tuple[Record, SimulationResult]:
    """Runs an episode. Returns its record, and the result of the same actions up to its end."""
    scenario, model = episode.scenarios()
    task, settings = episode.make_task(), episode.settings
    command = episode.make_command() if episode.make_command else None
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
    result = play(scenario, actions, period=period)
    record = recorded(episode, task, result, cpu, is_done=is_done)
    wall = [round(each, 3) for each in planner.wall_times]
    record |= {"wall": wall, "load": round(load, 1)}
    if command is not None:
        alone = simulate(scenario, command=command)
        record["command_speed"] = alone.metrics.relative_speed
    return record, result


def play(scenario: Scenario, actions: Sequence[np.ndarray], *, period: float) -> SimulationResult:
    """Result of a robot after actions, each for a period (s)."""
    short = scenario.with_changes({"simulation.duration": f"{period * len(actions):.6g} s"})
    again = lambda now, _: actions[round(now / period)]  # noqa: E731
    return simulate(short, controller=again, control_period=period, record=True)


def recorded(
    episode: Episode, task: Task, result: SimulationResult, cpu: list[float], *, is_done: bool
) -> Record:
    """Record of an episode, in SI units."""
    nodes, metrics = result.trajectory.p_WN.values, result.metrics
    times = result.trajectory.time.values
    period = episode.settings["control_period"]
    steps = centre_of(nodes)[:: round(period / float(times[1] - times[0]))]
    centre = result.path.centre
    away = float(np.linalg.norm((centre[-1] - centre[0])[:2]))
    record = {
        "group": episode.group,
        "name": episode.name,
        "is_done": is_done,
        "time": result.duration,
        "way": float(np.linalg.norm(np.diff(steps, axis=0), axis=1).sum()),
        "cost_of_transport": metrics.cost_of_transport,
        "work": metrics.cost_of_transport * result.robot.weight * away,
        "relative_speed": metrics.relative_speed,
        "speed": metrics.speed,
        "cpu": [round(each, 3) for each in cpu],
        "path": steps.round(3).tolist(),
    }
    if isinstance(task, Way):
        record |= {"places": task.places, "pillars": task.pillars}
        if task.pillars:
            record["clearance"] = float(clearance(nodes, task.pillars).min())
    if isinstance(task, Turn):
        record["error"] = float(task.error(nodes[-1]))
    return record


def load_records(folder: Path) -> dict[tuple[str, str], Record]:
    """Records in a folder by group and name of the episode. A line that an interruption has cut
    off does not count."""
    return {(record["group"], record["name"]): record for record in read(folder / RECORDS)}


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


# The film


def film(result: SimulationResult, pillars: Sequence[Sequence[float]], file: Path) -> None:
    """Writes a GIF of a robot among pillars, seen obliquely, at twice its speed."""
    structure, trajectory = result.robot.structure, result.trajectory
    times, nodes = trajectory.time.values, trajectory.p_WN.values
    path = _seen(np.pad(centre_of(nodes), ((0, 0), (0, 1))))
    figure = Figure(figsize=(5.6, 2.1))
    canvas, pictures = FigureCanvasAgg(figure), []
    ends = structure.segments.ends
    for sample in np.searchsorted(times, np.arange(0.0, result.duration, FRAME)):
        figure.clear()
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.plot(*path[: sample + 1].T, color="C0", linewidth=0.8)
        seen = _seen(nodes[sample])
        behind = centre_of(nodes[sample])[1]
        for x, y in pillars:
            draw_pillar(axes, x, y, zorder=1 if y > behind else 4)
        axes.plot(*seen[ends].transpose(2, 1, 0), color="0.6", linewidth=0.6, zorder=2)
        axes.plot(
            *seen[structure.struts].transpose(2, 1, 0), color="black", linewidth=1.8, zorder=3
        )
        axes.set(xlim=(-0.5, 6.5), ylim=(-1.2, 1.42), aspect="equal")
        axes.set_axis_off()
        canvas.draw()
        picture = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
        pictures.append(picture.quantize(COLOURS))
    pace = round(500.0 * FRAME)
    pictures[0].save(file, save_all=True, append_images=pictures[1:], duration=pace, loop=0)


def _seen(points: np.ndarray) -> np.ndarray:
    """Places (..., 2) in a picture of points (..., 3) seen obliquely from above."""
    across = math.sin(VIEW) * points[..., 1] + math.cos(VIEW) * points[..., 2]
    return np.stack([points[..., 0], across], axis=-1)


def draw_pillar(axes: Axes, x: float, y: float, *, zorder: float) -> None:
    """Draws a pillar at a place, seen obliquely."""
    around = np.linspace(0.0, math.tau, 40)
    ring = np.stack([x + PILLAR * np.cos(around), y + PILLAR * np.sin(around)], axis=-1)
    low, high = (_seen(np.pad(ring, ((0, 0), (0, 1)), constant_values=z)) for z in (0.0, TALL))
    outline = np.vstack([low[20:], high[:21]])
    axes.fill(*outline.T, color="C1", zorder=zorder)
    axes.fill(*high.T, color="C1", edgecolor="white", zorder=zorder + 0.1)


# The page


def goals_figure(groups: Mapping[str, Sequence[Record]]) -> Figure:
    """Paths to the goals, a panel for each group."""
    figure = Figure(figsize=(8.0, 3.0), layout="constrained")
    panels = figure.subplots(1, len(groups))
    for axes, (name, records) in zip(panels, groups.items(), strict=True):
        for record in records:
            (goal,) = record["places"]
            axes.plot(*np.transpose(record["path"]), linewidth=0.8)
            axes.add_patch(Circle(goal, NEAR, color="0.8", zorder=0))
        axes.set(title=name, aspect="equal", xlim=(-3.6, 3.6), ylim=(-3.6, 3.6), xlabel="x (m)")
    panels[0].set(ylabel="y (m)")
    return figure


def courses_figure(records: Sequence[Record]) -> Figure:
    """Paths among pillars, with the circles around the places to pass."""
    figure = Figure(figsize=(8.0, 6.6), layout="constrained")
    names = [record["name"] for record in records]
    cells = [*(names[:1] or ["."]) * (12 - len(names[1:])), *names[1:]]  # the slalom is wider
    panels = figure.subplot_mosaic(np.reshape(cells, (3, 4)).tolist())
    for record in records:
        axes = panels[record["name"]]
        axes.plot(*np.transpose(record["path"]), linewidth=0.8)
        for place in record["places"]:
            axes.add_patch(Circle(place, NEAR, color="0.8", zorder=0))
        for place in record["pillars"]:
            axes.add_patch(Circle(place, PILLAR, color="C1"))
        axes.set_title(record["name"], fontsize="medium")
        axes.set_aspect("equal", adjustable="datalim")
        axes.autoscale_view()
        axes.tick_params(labelsize=7)
    figure.supxlabel("x (m)", fontsize="medium")
    figure.supylabel("y (m)", fontsize="medium")
    return figure


def goals_table(groups: Mapping[str, Sequence[Record]]) -> TextTable:
    """Success on the goals, and medians over the reached ones."""
    rows = []
    for name, records in groups.items():
        reached = [record for record in records if record["is_done"]]
        times = [record["time"] for record in reached]
        row = [name, f"{len(reached)} of {len(records)}", fixed(median(reached, "time"), 1)]
        row.append(f"{min(times):.1f} to {max(times):.1f}" if times else "-")
        columns = (("way", 1), ("work", 0), ("cost_of_transport", 1))
        rows.append([*row, *(fixed(median(reached, key), digits) for key, digits in columns)])
    headings = ["robot", "reached", "time, s", "range, s", "path, m", "work, J"]
    return TextTable([*headings, "cost of transport"], rows)


def courses_table(records: Sequence[Record]) -> TextTable:
    """What came of each course."""
    rows = []
    for record in records:
        texts = [record["name"], f"{len(record['pillars'])}", "yes" if record["is_done"] else "no"]
        keys = (("time", 1), ("way", 1), ("clearance", 2))
        rows.append([*texts, *(fixed(record[key], digits) for key, digits in keys)])
    headings = ["course", "pillars", "reached", "time, s", "path, m", "least clearance, m"]
    return TextTable(headings, rows)


def level_speeds(records: Sequence[Record], ground: str) -> dict[str, np.ndarray]:
    """Body lengths per second on a level ground by engine: least, median and greatest."""
    speeds = {}
    for plant in PLANTS:
        own = [each for each in records if each["name"].startswith(f"{ground}, {plant}")]
        numbers = [each["relative_speed"] for each in own] or [math.nan]
        speeds[plant] = np.percentile(numbers, [0, 50, 100])
    return speeds


def level_table(records: Sequence[Record]) -> TextTable:
    """Body lengths per second on level grounds by engine: medians, and ranges over the seeds."""
    rows = []
    for ground in GROUNDS:
        rows.append([ground])
        for least, middle, most in level_speeds(records, ground).values():
            rows[-1].append(f"{fixed(middle)} ({fixed(least)} to {fixed(most)})")
    return TextTable(["ground", *PLANTS], rows)


def slopes_table(records: Sequence[Record]) -> TextTable:
    """Body lengths per second by slope and engine."""
    rows = []
    for degrees, friction in SLOPES:
        slope = f"{degrees} degrees, friction {friction:g}"
        rows.append([slope])
        for plant in PLANTS:
            own = [each for each in records if each["name"] == f"{slope}, {plant}"]
            rows[-1].append(fixed(median(own, "relative_speed")))
    return TextTable(["slope", *PLANTS], rows)


def others_table(records: Sequence[Record]) -> TextTable:
    """What the other robots do from rest."""
    rows = []
    for record in records:
        if "command_speed" in record:  # climbs_table() has it
            continue
        angle = math.degrees(record["error"]) if "error" in record else math.nan
        speed = math.nan if "error" in record else record["relative_speed"]
        cpu = float(np.mean(record["cpu"]))
        cells = [fixed(record["time"], 1), fixed(speed, 3), fixed(angle, 0), fixed(cpu)]
        rows.append([record["name"], *cells])
    headings = ["robot and task", "time, s", "body lengths/s", "angle left, degrees"]
    return TextTable([*headings, "CPU per decision, s"], rows)


def climbs_table(records: Sequence[Record]) -> TextTable:
    """Body lengths per second uphill, by changes of a gait's commands and by the commands alone."""
    rows, known = [], {record["name"]: record for record in records}
    for friction, plants in CLIMBS.items():
        for plant in plants:
            if climb := known.get(climb_name(friction, plant)):
                speeds = [fixed(climb[key], 3) for key in ("relative_speed", "command_speed")]
                rows.append([f"{friction:g}", plant, *speeds])
    return TextTable(["friction", "robot on", "planned", "commands alone"], rows)


def costs_table(groups: Mapping[str, Sequence[Record]]) -> TextTable:
    """CPU of the decisions, and the share that two cores make in time."""
    rows, limit = [], CORES * PLANNING["decision_period"]
    for name, records in groups.items():
        if records:
            rows.append([name, *costs_row([record["cpu"] for record in records], limit)])
    headings = ["episodes", "decisions", "CPU, median, s", "95 % below, s", "most, s"]
    return TextTable([*headings, "deadlines kept"], rows)


def costs_row(times: Sequence[Sequence[float]], limit: float) -> list[str]:
    """Number of decisions; median, 95th percentile and maximum of their times (s); share of them
    within a limit (s). `times` has a list for each episode."""
    all_times = np.concatenate(times)
    numbers = [*np.percentile(all_times, [50, 95]), all_times.max()]
    kept = f"{100.0 * np.mean(all_times <= limit):.1f} %"
    return [f"{all_times.size}", *(fixed(float(number)) for number in numbers), kept]


def walls_table(records: Sequence[Record]) -> TextTable:
    """Wall times of the decisions."""
    rows, limit = [], PLANNING["decision_period"]
    if records:
        rows.append(costs_row([record["wall"] for record in records], limit))
    headings = ["decisions", "wall time, median, s", "95 % below, s", "most, s", "deadlines kept"]
    return TextTable(headings, rows)


def median(records: Sequence[Record], key: str) -> float:
    """Median of a number over records; NaN without records."""
    return float(np.median([record[key] for record in records] or [math.nan]))


PAGE = """\
# A rover that a planner steers

![slalom]({film})

The rover goes around three pillars; the film runs at twice its speed.

Scenario [`rover`](../../tetra_drake/scenario/rover.yaml), winches with its published speed on all
24 cables. Nothing is evolved or learned. Twice per second `td.Planner` simulates {samples}
motions of 2 s from what it reads, and takes the mean of the best ones (MPPI). The cost is the
distance of the centre from the goal after these 2 s. A plan acts half a second after its
readings, so there is time to compute it. `python runs/planning.py` makes this page; an
interrupted script continues.

Episodes that were run: {run}.

## Goals

Twenty goals in all directions, 3 m away. One is reached when the centre is within 0.3 m of it, in
at most 60 s. *Compiled*: the robot is on the engine of the planner's model, which takes larger
steps. *MuJoCo*: the robot is on MuJoCo. *Disturbed*: each uncertain number of the robot and
the ground differs from the model's by up to 5 %, and the rods start displaced (the draws of
`tetra-drake robustness`). Numbers are medians over the goals that were reached. The path is the way
of the centre. The work is what the winches give; they recover none.

{goals}

![paths to the goals](goals.svg)

## Courses

Pillars are a part of the cost, not of the simulation: the cost is the way to the goal around
them, by a map, and the circle around the rover should stay 0.15 m away. With the straight
distance in place of the way, the rover stays behind a pillar in two of two courses. In the
slalom the goal is the next of four places. *Least clearance*: least distance of the circle from a
pillar; a negative one means that the circle reached into it.

{courses}

![paths of the courses](courses.svg)

## Real time

CPU of the decisions. A decision period of half a second has 1 s of CPU on two cores; *deadlines
kept* counts the decisions below it. It takes for granted that both cores are free and share the
work evenly.

{costs}

Wall times were measured for {walled} of the goals, on two cores of an AMD EPYC without other work:
the load average was {load}, the planner's own threads included. *Deadlines kept* counts the
decisions within half a second of wall time.

{walls}

## Beside an evolved policy

[`rolling`](../rolling/README.md) evolved a policy for the same rover in {evolved:.0f} s of CPU,
which then costs next to nothing. It rolls 3.0 m in 10 s, in one direction. A planned rover costs
{second:.2f} s of CPU per second of motion, so the evolution costs as much as {break_even:.0f} s
of planning. In return the planner goes where it is told, and a new goal or robot costs nothing in
advance.

## Speed and slopes

The cost is the way along x. Body lengths per second of the centre along x, from 2 s on. Published
for rovers of six struts: 0.71 with curved struts; 0.30, and 28 degrees, with straight ones.

On level ground: medians of 40 s, and ranges over six seeds of the planner's noise, or four.

{level}

On MuJoCo the rover is slower by {slower:.0f} % of the compiled engine's speed. MuJoCo has no
bristles, and the planner's model has them. With the same law of friction everywhere, without
bristles, the medians of the three engines agree to {alike:.0f} %. So the difference is in the law
of friction.

Uphill, in single episodes of 10 s. With the scenario's coefficient of friction, 0.5, a body slips
at 26.6 degrees; with 0.8 at 38.7.

{slopes}

The rover climbs 15 degrees, and 20 degrees with the higher friction, on all three engines. On
steeper slopes it slides or rolls back, so it does not reach the published 28 degrees. Friction does
not set this limit, the shape does: with the cables at their lengths at rest, the rover stands on 15
degrees and rolls down on 18, with either friction. On steeper slopes it has to hold itself all the
time by other lengths. Winches of twice the speed do not help: on the compiled engine it then has
0.06 in place of 0.13 on 20 degrees, and -0.23 on 28, with the higher friction. Whether another
planner would find a way was not tried.

## Other robots

The thesis's row [with motors](../motors/README.md), and the [six-bar](../six-bar/README.md), with
the same settings. A turn ends within 5 degrees of the heading, moving or not. Uphill the row has
5 s, the six-bar 10 s.

{others}

The row is not planned in real time: a decision takes 2.7 s of CPU and more, three times the limit.

From rest the planner takes neither robot up 20 degrees. The row stays where it is: every motion of
the samples slides down, so the best plan is to stand still. The six-bar slides down; with friction
0.8 it stands (not recorded). On level ground the planned six-bar is much faster than its evolved
gait, which goes 0.027 body lengths per second.

## Uphill from a gait

A planner can begin with the commands of a gait, and change them: the argument `command`. Here
CMA-ES evolves a gait of the row in 600 evaluations, on 20 degrees, with friction 0.8 and a gain of
4 lbf. `td.export` writes its commands, 20 per second. The planner decides ten times per second, and
each plan acts at once. Body lengths per second in 10 s from rest:

{climbs}

With friction 0.8 the row climbs 20 degrees on all three engines, 40 to 50 % faster than by the
commands alone. With the scenario's friction, 0.5, the commands slide down; the planner holds the
row, but hardly climbs. There CMA-ES found no gait that climbs, either (3,000 evaluations, not
recorded).
"""


def write_page(folder: Path) -> None:
    """Writes the page of the records in a folder, and its pictures."""
    groups: dict[str, list[Record]] = {group: [] for group in GROUPS}
    for (group, _), record in load_records(folder).items():
        groups[group].append(record)
    goals = {name: records for name, records in groups.items() if name.startswith("goals")}
    save_figure(goals_figure(goals), folder, "goals", kinds=["svg"])
    save_figure(courses_figure(groups["courses"]), folder, "courses", kinds=["svg"])
    counts = {group: len(each) for group, each in groups.items()}
    planned = Counter(episode.group for episode in all_episodes())
    evolved = load_times(HERE.parent)["rolling"]["evolution"]["cores_s"]
    cpu = [each for records in goals.values() for record in records for each in record["cpu"]]
    second = float(np.mean(cpu)) / PLANNING["decision_period"]
    usual, alike = (
        {plant: middle for plant, (_, middle, _) in level_speeds(groups["speeds"], ground).items()}
        for ground in GROUNDS
    )
    page = PAGE.format(
        run=listed([f"{counts[group]} of {planned[group]} ({group})" for group in GROUPS]),
        goals=goals_table(goals).markdown(),
        courses=courses_table(groups["courses"]).markdown(),
        costs=costs_table(groups).markdown(),
        walls=walls_table(groups["real time"]).markdown(),
        walled=len(groups["real time"]),
        load=fixed(median(groups["real time"], "load"), 0),
        level=level_table(groups["speeds"]).markdown(),
        slower=100.0 * (1.0 - usual["MuJoCo"] / usual["compiled"]),
        alike=100.0 * (max(alike.values()) / min(alike.values()) - 1.0),
        slopes=slopes_table(groups["speeds"]).markdown(),
        others=others_table(groups["others"]).markdown(),
        climbs=climbs_table(groups["others"]).markdown(),
        samples=PLANNING["samples"],
        film=FILM,
        evolved=evolved,
        second=second,
        break_even=evolved / second,
    )
    write_whole(folder / PAGE_NAME, page)


def main(groups: Sequence[str], folder: Path = HERE) -> None:
    """Runs the episodes of groups, or all, films the slalom, and writes the page."""
    run_all([each for each in all_episodes() if not groups or each.group in groups], folder)
    if not (folder / FILM).exists():
        slalom = next(each for each in courses() if each.name == "slalom")
        film(run_episode(slalom)[1], SLALOM, folder / FILM)
    write_page(folder)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("group", nargs="*", choices=[[], *GROUPS])
    main(parser.parse_args().group)
