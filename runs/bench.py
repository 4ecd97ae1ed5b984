"""TensegrityBench: tasks for tensegrity robots, and methods that solve them at equal budgets.

    python runs/bench.py [ENTRY.py ...]

Runs entries, by default those in bench/entries/. An entry is a file with a function
`solve(problem, seed)`, see Problem. Each entry solves each task with each seed. records.jsonl in
the folder bench/ gets a line for each solution; solutions that have one are skipped, so an
interrupted script continues. Then the script writes the page README.md from the records.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import hashlib
import math
import runpy
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
import pandas
from matplotlib.figure import Figure
from page import rendered
from records import append, read
from script import draw_dots, read_settings, script

from tetra_drake.engines.queue import SimulationQueue
from tetra_drake.engines.simulate import simulate
from tetra_drake.errors import InputError, SimulationFailure, check_type
from tetra_drake.evolution.evaluation import GaitEvaluation
from tetra_drake.figures.style import save_figure
from tetra_drake.files import write_whole
from tetra_drake.lab.planner import Planner
from tetra_drake.lab.study.statistics import (
    interquartile_mean,
    interval,
    interval_of_resamples,
    resampled,
)
from tetra_drake.machine import available_cores
from tetra_drake.optimizers import optimizer_of
from tetra_drake.optimizers.base import Evaluation
from tetra_drake.optimizers.base import Task as Candidate
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.parameter_space import ParameterSpace, Vector
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.optimizer_kinds import OptimizerKind
from tetra_drake.scenario.scenario import Scenario

HERE = Path(__file__).parent / "bench"
ENTRIES, FILE = HERE / "entries", HERE / "tasks.yaml"
RECORDS, INTERVALS, PAGE_NAME, FIGURE = "records.jsonl", "scores.csv", "README.md", "scores"
SEEDS, EPISODES = 10, 250
"""Number of solutions of each entry to each task, and the budget of one in episodes."""
DECIMALS = 6
"""Decimals of the parameters of solutions, and of scores, in the records."""
LEAST_SPEED = 0.02
"""Speed (body lengths/s) below which a gait does not count as efficient."""

Solution: TypeAlias = Vector | Planner | Callable[..., npt.ArrayLike]
"""Parameters of a gait or policy, or a controller as simulate(controller=...) takes it."""
Record: TypeAlias = dict[str, Any]
"""Record of a solution: task, entry, seed, score, seconds, and parameters if any. The best one of a
task and entry also has the score on the second engine."""


def efficiency(result: SimulationResult) -> float:
    """Inverse of the cost of transport; 0 for robots slower than LEAST_SPEED."""
    metrics = result.metrics
    return 1.0 / metrics.cost_of_transport if metrics.relative_speed >= LEAST_SPEED else 0.0


SCORES: Mapping[str, Callable[[SimulationResult], float]] = {
    "speed": lambda result: result.metrics.relative_speed,
    "turning rate": lambda result: (
        math.degrees(result.metrics.heading_change) / result.scenario.simulation.duration
    ),
    "efficiency": efficiency,
}
"""Scores of motions: speed of the centre along x in body lengths/s; mean rate of the heading in
degrees/s, left positive; inverse of the cost of transport."""
MUJOCO = {"engine": "!Mujoco", "friction.stiffness": "0 N/m"}
"""Changes for the second engine, where a task names none: MuJoCo, which has no bristles."""


@dataclass(frozen=True)
class Task:
    """A task: a scenario, and the score of a motion on it."""

    name: str
    about: str
    base: str
    """Name of a shipped scenario."""
    changes: Mapping[str, Any] = field(default_factory=dict)
    score: str = "speed"
    """Name of its score, see SCORES."""
    unit: str = "body lengths/s"
    second: Mapping[str, Any] = field(default_factory=lambda: MUJOCO)
    """Changes of the scenario for the second engine."""

    @functools.cached_property
    def scenario(self) -> Scenario:
        """Scenario of the task, on the compiled engine."""
        common = {"simulation.control_period": "100 ms", "name": self.name}
        return load_scenario(self.base).with_changes({**common, **self.changes})

    def scored(self, solution: Solution, *, changes: Mapping[str, Any] | None = None) -> float:
        """Score of a solution on the task's scenario, with `changes`; 0 if the simulation fails."""
        scenario, score = self.scenario.with_changes(changes or {}), SCORES[self.score]
        try:
            if callable(solution):
                return score(simulate(scenario, controller=solution))
            gait = ParameterSpace.of(scenario).gait(np.asarray(solution), name=self.name)
            return score(simulate(scenario, gait))
        except SimulationFailure:
            return 0.0


TASKS = [Task(name, **task) for name, task in read_settings(FILE).items()]


class Problem:
    """A task with a budget, as an entry gets it.

    The budget counts simulated seconds: EPISODES times the duration of the task's scenario.
    `solve(problem, seed)` returns a parameter vector of `space`, or a controller, which the bench
    simulates once more on two engines.

    Attributes:
        task: the task; its name, scenario and score.
        scenario: the task's scenario.
        space: the parameters of its gaits, or of its policy.
        left: budget that is left, in simulated seconds; spent: what is used.
    """

    def __init__(self, task: Task, queue: SimulationQueue, *, episodes: int = EPISODES) -> None:
        self.task, self.scenario, self._queue = task, task.scenario, queue
        self.space = ParameterSpace.of(self.scenario)
        self._duration = self.scenario.simulation.duration
        self.left, self.spent = episodes * self._duration, 0.0
        self._evaluation = GaitEvaluation(self.scenario, SCORES[task.score])

    def evaluate(self, vectors: Sequence[Vector]) -> list[Evaluation]:
        """Evaluations of parameter vectors, one episode each. `fitness` is the score; -inf for a
        simulation that failed. Raises InputError if the budget is too small."""
        self.spend(len(vectors) * self._duration)
        candidates = [Candidate(np.asarray(vector, dtype=float)) for vector in vectors]
        futures = [self._evaluation.on_queue(each, self._queue) for each in candidates]
        return [future.result() for future in futures]

    def spend(self, seconds: float) -> None:
        """Takes simulated seconds from the budget, for simulations that evaluate() does not make.
        Raises InputError if it is too small."""
        if not 0.0 <= seconds <= self.left + 1e-6:
            problem = f"found {seconds:g} simulated seconds, expected at most {self.left:g}"
            raise InputError("bench", self.task.name, problem)
        self.left -= seconds
        self.spent += seconds

    def search(self, kind: OptimizerKind, seed: int) -> Vector:
        """The best vector that an optimiser of the package finds with the whole budget. A search
        that ends early is followed by another."""
        generator, episodes = np.random.default_rng(seed), round(self.left / self._duration)
        evolution = self.scenario.evolution.model_copy(update={"evaluations": episodes})
        make, best = optimizer_of(kind), (-math.inf, self.space.low)
        optimizer = make(self.space, evolution, generator)
        while (count := round(self.left / self._duration)) > 0:
            vectors = optimizer.ask()[:count]
            evaluations = self.evaluate(vectors)
            for vector, evaluation in zip(vectors, evaluations, strict=True):
                best = max(best, (evaluation.fitness, vector), key=lambda one: one[0])
            if count > len(vectors) and optimizer.tell(evaluations).stop:
                optimizer = make(self.space, evolution, generator)
        return best[1]


@dataclass(frozen=True)
class Entry:
    """A method that solves tasks, from a file."""

    name: str
    about: str
    solve: Callable[[Problem, int], Solution]
    tasks: Sequence[str]
    """Names of the tasks that it can solve."""
    changes: Mapping[str, Any] = field(default_factory=dict)
    """Changes of the tasks' scenarios, such as another kind of oscillators."""
    digest: str = ""
    """Digest of the file, in the records of an entry that is not shipped."""

    @classmethod
    def of(cls, file: Path) -> Entry:
        """The entry in a Python file: its function `solve`, its docstring, a list TASKS if it
        solves some tasks only, and CHANGES of their scenarios if it needs any. Raises InputError if
        it cannot be imported or has no `solve`."""
        try:
            content = runpy.run_path(str(file))
        except (Exception, SystemExit) as error:
            problem = f"cannot be run: {type(error).__name__}: {error}"
            raise InputError(file, "", problem) from error
        if not callable(solve := content.get("solve")):
            problem = f"found {solve!r:.60}, expected a function solve(problem, seed)"
            raise InputError(file, "solve", problem)
        names = [task.name for task in TASKS]
        tasks, changes = content.get("TASKS", names), content.get("CHANGES", {})
        check_type(file, "TASKS", tasks, list, tuple)
        check_type(file, "CHANGES", changes, Mapping)
        if not {*map(str, tasks)} <= {*names}:
            problem = f"found {tasks!r:.60}, expected some of {', '.join(names)}"
            raise InputError(file, "TASKS", problem)
        about = (content["__doc__"] or file.stem).strip().split("\n")[0].rstrip(".")
        digest = hashlib.sha256(file.read_bytes()).hexdigest()[:12]
        is_shipped = file.resolve().parent == ENTRIES.resolve()
        if not is_shipped and (ENTRIES / file.name).exists():
            raise InputError(file, "", "has the name of a shipped entry, expected another")
        return cls(file.stem, about, solve, tasks, changes, "" if is_shipped else digest)


def solved(
    entry: Entry, task: Task, seeds: Sequence[int], *, episodes: int = EPISODES
) -> list[Record]:
    """Records of an entry's solutions to a task, one for each seed. The seeds are solved side by
    side. Raises InputError if the entry raises an error or returns something else."""
    started = time.perf_counter()
    task = dataclasses.replace(task, changes={**task.changes, **entry.changes})
    with ThreadPoolExecutor(len(seeds)) as threads, SimulationQueue(available_cores()) as queue:
        problems = [Problem(task, queue, episodes=episodes) for _ in seeds]
        try:
            found = list(threads.map(entry.solve, problems, seeds))
        except InputError:
            raise
        except (Exception, SystemExit) as error:
            problem = f"raised {type(error).__name__}: {error}"
            raise InputError(entry.name, "solve", problem) from error
    solutions = [_checked(one, problems[0], entry) for one in found]
    wall_time = (time.perf_counter() - started) / len(seeds)
    records: list[Record] = []
    digest = {"digest": entry.digest} if entry.digest else {}
    for seed, own, solution in zip(seeds, problems, solutions, strict=True):
        record = {"task": task.name, "entry": entry.name, "about": entry.about, "seed": seed}
        if not callable(solution):
            record["parameters"] = solution.tolist()
        record["score"] = round(task.scored(solution), DECIMALS)
        record["simulated_s"] = round(own.spent, 3)
        records.append(record | digest | {"wall_s": round(wall_time, 2)})
    best = max(range(len(records)), key=lambda place: records[place]["score"])
    second = task.scored(solutions[best], changes=task.second)
    records[best]["second"] = round(second, DECIMALS)
    return records


def _checked(solution: Any, problem: Problem, entry: Entry) -> Solution:
    """A controller, or the rounded parameters of a solution. Raises InputError if they do not fit
    the space."""
    if callable(solution):
        return solution
    with contextlib.suppress(TypeError, ValueError):
        vector = np.asarray(solution, dtype=float)
        if vector.shape == problem.space.low.shape and np.isfinite(vector).all():
            return vector.round(DECIMALS)
    expected = f"{len(problem.space.names)} numbers or a controller"
    raise InputError(entry.name, "solve", f"returned {solution!r:.60}, expected {expected}")


# The page


def scores(records: Sequence[Record]) -> pandas.DataFrame:
    """The records in the order of the seeds, with scores as a `share` of the task's best
    interquartile mean."""
    table = pandas.DataFrame(records).sort_values("seed", kind="stable")
    means = table.groupby(["task", "entry"])["score"].transform(interquartile_mean)
    return table.assign(share=table["score"] / means.groupby(table["task"]).transform("max"))


def shares(records: Sequence[Record]) -> dict[str, dict[str, np.ndarray]]:
    """Scores by entry and task, as shares of the task's best interquartile mean."""
    found: dict[str, dict[str, np.ndarray]] = {}
    for (task, entry), own in scores(records).groupby(["task", "entry"], sort=False):
        found.setdefault(entry, {})[task] = own["share"].to_numpy()
    return found


def overall(of_tasks: Mapping[str, np.ndarray]) -> tuple[float, float, float]:
    """Interquartile mean of an entry's shares over all tasks and seeds, and its 95 % interval by a
    bootstrap within each task."""
    generator, tasks = np.random.default_rng(0), [*of_tasks.values()]
    resamples = np.concatenate([resampled(values, generator) for values in tasks], axis=1)
    low, high = interval_of_resamples(interquartile_mean(resamples, axis=1))
    return float(interquartile_mean(np.concatenate(tasks))), low, high


def entry_names(records: Sequence[Record]) -> list[str]:
    """Names of the entries in the records, the best first."""
    found = shares(records)
    return sorted(found, key=lambda name: (-len(found[name]), -overall(found[name])[0]))


def scores_figure(records: Sequence[Record]) -> Figure:
    """Scores of all seeds by task and entry, as shares of the best interquartile mean."""
    names, of_entries = entry_names(records), shares(records)
    figure = Figure(figsize=(8.0, 4.0), layout="constrained")
    axes = figure.subplots(2, math.ceil(len(TASKS) / 2), sharex=True, sharey=True)
    for axis, task in zip(axes.flat, TASKS, strict=False):
        of_task = {name: of_entries[name].get(task.name, np.zeros(0)) for name in names}
        draw_dots(axis, of_task, best=1.0)
        axis.set_title(task.name)
    figure.supxlabel("score as a share of the best interquartile mean")
    return figure


def means(records: Sequence[Record]) -> pandas.DataFrame:
    """Interquartile means by task and entry, with their 95 % intervals."""
    groups = scores(records).groupby(["task", "entry"], sort=False)["score"]
    rows = [[*of, interquartile_mean(x), *interval(x, interquartile_mean)] for of, x in groups]
    table = pandas.DataFrame(rows, columns=["task", "entry", "mean", "low", "high"])
    return pandas.concat([of_task for _, of_task in table.groupby("task", sort=False)])


def intervals(records: Sequence[Record]) -> str:
    """Table of the means as CSV."""
    return str(means(records).to_csv(index=False, float_format="%.6g"))


def page(records: Sequence[Record]) -> str:
    """Text of the page, from the records."""
    settings = {"tasks": TASKS, "episodes": EPISODES, "seeds": SEEDS}
    tables: dict[str, Any] = {"table": pandas.DataFrame(records), "means": means(records)}
    tables |= {"names": entry_names(records), "shares": shares(records), "overall": overall}
    return rendered("bench.md", **settings, **tables)


@script
def main(files: Sequence[str]) -> None:
    """Runs the entries, and writes the page."""
    entries = [Entry.of(Path(file)) for file in files or sorted(ENTRIES.glob("*.py"))]
    known = read(HERE / RECORDS)
    done = {(one["task"], one["entry"], one["seed"]) for one in known}
    for entry in entries:
        if {one.get("digest", "") for one in known if one["entry"] == entry.name} - {entry.digest}:
            problem = f"{RECORDS} has records of another entry of this name; rename it"
            raise InputError(entry.name, "", problem)
    for task in TASKS:
        for entry in entries:
            seeds = [seed for seed in range(SEEDS) if (task.name, entry.name, seed) not in done]
            if not seeds or task.name not in entry.tasks:
                continue
            records = solved(entry, task, seeds)
            append(HERE / RECORDS, records)
            mean = float(interquartile_mean([one["score"] for one in records]))
            print(f"{task.name}, {entry.name}: {mean:.3g} {task.unit}", flush=True)
    records = read(HERE / RECORDS)
    save_figure(scores_figure(records), HERE, FIGURE, kinds=["svg"])
    write_whole(HERE / INTERVALS, intervals(records))
    write_whole(HERE / PAGE_NAME, page(records))
