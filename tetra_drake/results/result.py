"""Result of a simulation, which every engine returns: metrics, path and trajectory."""

from __future__ import annotations

import functools
import html
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from tetra_drake import __version__
from tetra_drake.errors import InputError
from tetra_drake.formatting import Say, fixed, heading_html, silent, uncertain
from tetra_drake.laws.tally import Tally
from tetra_drake.on_demand import loaded
from tetra_drake.results.trajectory import Motion, make_dataset, sample_times
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.measures import PERIOD, CentrePath, follow
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.signals import DrivenRobot
from tetra_drake.robot.structure import Structure, followed_nodes, node_positions
from tetra_drake.scenario.load import dump_scenario
from tetra_drake.scenario.metrics import (
    MOVED,
    UNITS,
    MetricRanges,
    Metrics,
    Poses,
    Walk,
    compute_fitness,
    has_rolled,
    headline_metric,
)
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.scenario.world import SimulationSection
from tetra_drake.settings.section import Section

if TYPE_CHECKING:
    import xarray

    from tetra_drake.visualization.replay import Replay


class IntegratorWork(Section):
    """Computing work of an integrator in one simulation: its scheme and accuracy, and numbers of
    steps and evaluations."""

    scheme: str
    accuracy: float
    """Drake's target accuracy, the compiled engine's tolerance (m/s), or MuJoCo's step (s)."""
    steps: int
    derivative_evaluations: int
    jacobian_evaluations: int = 0
    """Number of the derivative evaluations that were made for Jacobians."""


@dataclass(frozen=True)
class SimulationResult:
    """Result of one simulation: metrics, fitness, path of the centre of mass, and the trajectory
    if it was recorded."""

    scenario: Scenario = field(repr=False, compare=False)
    robot: Robot = field(repr=False, compare=False)
    """The simulated robot; without a network if it followed a command."""
    name: str
    """Name of the gait or command."""
    gait: Gait | None = field(repr=False, compare=False)
    """The gait; None for a command or a controller."""
    metrics: Metrics
    fitness: float
    duration: float
    """Simulated time in s."""
    wall_time: float
    """Wall time of the integration in s, without preparations."""
    integrator: IntegratorWork
    engine: str
    """Name of the scenario's engine."""
    path: CentrePath = field(repr=False, compare=False)
    """Path of the robot's centre from start to end, in steps of robot.measures.PERIOD."""
    recorded: xarray.Dataset | None = field(default=None, repr=False)
    """Data of the trajectory (see results.trajectory.make_dataset); None if it was not recorded."""
    spread: MetricRanges = field(default_factory=dict, repr=False, compare=False)
    """Ranges of the metrics for moved starts, as spread() gives them; empty if not simulated."""
    tally: Tally | None = field(default=None, repr=False, compare=False)
    """Sums and extremes over all steps; None for a result from a file."""

    def __str__(self) -> str:
        kept = "not recorded" if self.recorded is None else "recorded"
        about = f"scenario {self.scenario.name}, engine {self.engine}, trajectory {kept}"
        return f"{self.title}\n{about}, fitness {self.fitness:.4g}\n{self.metrics}"

    def __repr__(self) -> str:
        return f"<SimulationResult {self.title}>"

    def _repr_html_(self) -> str:
        about = f"scenario {self.scenario.name}, engine {self.engine}, fitness {self.fitness:.4g}"
        return heading_html(f"{self.title}\n{about}") + self.metrics._repr_html_()

    @functools.cached_property
    def trajectory(self) -> xarray.Dataset:
        """The trajectory. Its attributes say where it comes from: title, source, scenario (YAML)
        and, unless a command was played, gait (JSON). Raises InputError if it was not recorded."""
        if self.recorded is None:
            problem = "was not recorded; simulate with record=True"
            raise InputError(f"result of {self.name}", "trajectory", problem)
        if self.recorded.attrs:  # of a file
            return self.recorded
        gait = {"gait": json.dumps(self.gait.to_json(self.scenario))} if self.gait else {}
        return self.recorded.assign_attrs(
            Conventions="CF-1.11",
            title=self.title,
            source=f"tetra_drake {__version__}, engine {self.engine}",
            scenario=dump_scenario(self.scenario),
            **gait,
        )

    @property
    def title(self) -> str:
        """Name of the gait or command, and its result in words, such as "gait: walks 14.3 inches in
        15 s"."""
        return f"{self.name}: {headline(self.scenario, vars(self.metrics), self.spread)}"

    def show(self, *, height: int = 480) -> ReplayFrame:
        """Page that plays the motion, for a notebook, which shows it in a frame `height` pixels
        high. Raises InputError if no trajectory was recorded."""
        return ReplayFrame(self.replay_page(), height)

    def replay_page(self) -> str:
        """The HTML page that save_replay() writes."""
        return self._replay.page()[0]

    def save_replay(self, path: str | Path, *, viewer: str | Path | None = None) -> None:
        """Writes an HTML page that plays the motion to the file `path`. For `viewer`, see
        visualization.replay.Replay.save(). Raises InputError if no trajectory was recorded."""
        self._replay.save(path, viewer=viewer)

    @property
    def _replay(self) -> Replay:
        from tetra_drake.visualization.replay import Replay

        return Replay(self.robot, self.trajectory, self.title)

    def save_video(
        self,
        path: str | Path,
        *,
        size: tuple[int, int] = (1920, 1080),
        fps: float = 30.0,
        view: str = "free",
        speed: float = 1.0,
        say: Say = silent,
    ) -> None:
        """Writes a video of the motion to the file `path`, an MP4 or a GIF. For the arguments and
        errors, see lab.films.video.make_video()."""
        make_video = loaded("tetra_drake.lab.films.video:make_video")
        page = self.replay_page()
        make_video(page, Path(path), size=size, fps=fps, view=view, speed=speed, say=say)


@dataclass(frozen=True)
class ReplayFrame:
    """Replay page (HTML text) in a notebook, shown by IPython's rich display in a frame of a height
    in pixels."""

    page: str = field(repr=False)
    height: int

    def _repr_html_(self) -> str:
        style = f"width: 100%; height: {self.height}px; border: 0"
        return f'<iframe srcdoc="{html.escape(self.page)}" style="{style}"></iframe>'


def motion_times(simulation: SimulationSection, *, record: bool) -> np.ndarray:
    """Times (s), ascending, for which an engine must give the motion to make_result(): the start,
    `simulation.steady_from` and the end, the points of the path, and, with `record`, the samples of
    the trajectory."""
    times = [np.array([0.0, simulation.settling_time, simulation.duration])]
    times.append(sample_times(simulation.duration, PERIOD))
    if record:
        times.append(sample_times(simulation.duration, simulation.sample_period))
    return np.unique(np.concatenate(times))


def make_result(
    driven: DrivenRobot,
    motion: Motion,
    *,
    totals: Tally,
    work: IntegratorWork,
    wall_time: float,
    record: bool,
) -> SimulationResult:
    """Result of a simulation, from its motion and tally.

    Args:
        driven: the robot with its gait or command.
        motion: its motion at the times of motion_times().
        totals: the tally, sums and extremes over all steps; see laws.tally.
        work: counts of the integrator's steps and evaluations.
        wall_time: wall time of the integration in s.
        record: whether the result has a trajectory.
    """
    robot, scenario = driven.robot, driven.robot.scenario
    simulation, structure = robot.scenario.simulation, robot.structure
    instants = sample_times(simulation.duration, PERIOD)
    way = motion.at(instants)
    ends = motion.at(np.array([0.0, simulation.settling_time, simulation.duration]))
    samples = sample_times(simulation.duration, simulation.sample_period)
    poses = way.first_states(robot)[:, : 7 * len(structure.bodies)].reshape(len(instants), -1, 7)
    path = follow(instants, poses, structure)
    metrics = compute_metrics(
        robot,
        nodes=np.array([node_positions(structure, state) for state in ends.first_states(robot)]),
        path=path,
        totals=totals,
        signals=way.signals[instants >= simulation.settling_time],
    )
    return SimulationResult(
        scenario=scenario,
        robot=robot,
        name=driven.name,
        gait=driven.gait,
        metrics=metrics,
        fitness=compute_fitness(metrics, scenario.objective),
        duration=simulation.duration,
        wall_time=wall_time,
        integrator=work,
        engine=scenario.engine_name,
        path=path,
        recorded=make_dataset(robot, motion.at(samples)) if record else None,
        tally=totals,
    )


def compute_metrics(
    robot: Robot, *, nodes: np.ndarray, path: CentrePath, totals: Tally, signals: np.ndarray
) -> Metrics:
    """The metrics of a simulation.

    Args:
        robot: the simulated robot, with its scenario.
        nodes: positions p_WN (times, nodes, 3) in m at three times: 0, `simulation.steady_from`,
            and the end.
        path: path of the centre of mass, from start to end.
        totals: sums and extremes over all steps (see laws.tally), of this robot alone.
        signals: signals (k, m) in N at evenly spaced times from `simulation.steady_from` on.
    """
    structure, scenario = robot.structure, robot.scenario
    steady_from = scenario.simulation.settling_time
    walk = Walk(
        **vars(poses_of(structure, nodes, float(path.times[-1] - steady_from))),
        path=path.centre[np.searchsorted(path.times, steady_from) :, :2],
        heading=path.heading,
        signals=signals,
        scale=structure.scale,
        weight=robot.weight,
        actuators=robot.driven.size,
        tally=totals,
    )
    return Metrics.of(walk, lacking=scenario.lacking, units=scenario.units)


def poses_of(structure: Structure, nodes: np.ndarray, since_steady_from: float) -> Poses:
    """Positions of a structure's markers, tip (its foremost node) and centre of mass, for metrics.

    They are computed from the positions p_WN of all nodes (3, nodes, 3) in m at three times: start,
    `simulation.steady_from`, and end. The last two are `since_steady_from` (s) apart.
    """
    return Poses(
        markers=followed_nodes(nodes, structure),
        tip=nodes[:, structure.p_WN[:, 0].argmax()],
        centre=np.einsum("n,tna->ta", structure.node_shares, nodes),
        since_steady_from=since_steady_from,
        length=structure.length,
    )


def headline(
    scenario: Scenario, metrics: Mapping[str, float], spread: MetricRanges = MappingProxyType({})
) -> str:
    """Result of a gait in a few words, such as "walks 14.3 inches in 15 s". It tells the metric
    that the scenario's objective is about and, unless this is turning, the distance. A robot that
    rolled by half a turn or more "rolls". `metrics` has metrics by name, in SI units. Numbers have
    as many digits as their `spread` allows; large ones also have their range."""
    units, seconds = scenario.units, f"in {scenario.simulation.duration:g} s"

    def size(name: str, unit: float, decimals: int, word: str) -> str:
        value = metrics[name] / unit
        sign = math.copysign(1.0, value)
        low, high = sorted(sign * x / unit for x in spread.get(name, (math.nan, math.nan)))
        number, *both = uncertain(fixed(abs(value), decimals), abs(value), low, high).split(" ", 1)
        return " ".join([number, word, *both])

    name, rolls = headline_metric(scenario.objective, metrics), has_rolled(metrics)
    way = [size("distance", units.length, units.decimals, units.length_word)]
    way += ["backward" if metrics["distance"] < 0.0 else "", scenario.terrain.where, seconds]
    walk = " ".join(filter(None, way))
    moves = f"{'rolls' if rolls else 'walks'} {walk}"
    if name == "rolled":
        backward = " backward" if metrics[name] < 0.0 else ""
        turns = f"rolls {size(name, math.tau, 1, 'turns')}{backward}"
        text = f"{turns}, {walk if rolls else moves}"
    elif name == "heading_change":
        text = f"turns {size(name, math.radians(1.0), 0, 'degrees')} {seconds}"
    elif name == "distance":
        text = moves
    else:
        text = f"{name.replace('_', ' ')} {units.shown(metrics[name], UNITS[name])}, {moves}"
    return text.replace(")", f" {MOVED})", 1)  # the first range tells what it is
