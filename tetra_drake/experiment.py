"""Complete experiments, from the search to the report."""

from __future__ import annotations

import contextlib
import shlex
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import NoneType

from tetra_drake.engines.simulate import check_scenario
from tetra_drake.errors import InputError, SimulationFailure, check_type, check_whole
from tetra_drake.evolution import reevaluation
from tetra_drake.evolution.evaluation import GaitEvaluation, Objective
from tetra_drake.evolution.evaluators import (
    GivenExecutor,
    MakeExecutor,
    check_guard,
    evaluator_of,
    maker_of,
)
from tetra_drake.evolution.manifest import Method, RunRecord, read_manifest
from tetra_drake.evolution.progress import Progress
from tetra_drake.evolution.run import Run, load_run, tell_code
from tetra_drake.evolution.trials import check_fitness, open_trials, run_trials
from tetra_drake.files import given_path
from tetra_drake.machine import available_cores
from tetra_drake.on_demand import loaded
from tetra_drake.optimizers.base import MakeOptimizer
from tetra_drake.robot.remarks import gain_remark, sinking_remark, start_up_remark
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.load import given_scenario
from tetra_drake.scenario.optimizer_kinds import SteadyState
from tetra_drake.scenario.scenario import Scenario


def evolve(
    scenario: Scenario | str | Path | None,
    out: str | Path,
    *,
    seed: int | None = None,
    workers: int | None = None,
    resume: bool = False,
    overwrite: bool = False,
    optimizer: MakeOptimizer | None = None,
    objective: Objective | None = None,
    executor: GivenExecutor | None = None,
    progress: Progress | bool | None = None,
    reevaluate: bool | None = None,
    report: bool = True,
) -> Run:
    """Evolves gaits on a scenario and records the run in the new directory `out`.

        >>> scenario = td.load_scenario("quick")
        >>> run = td.evolve(scenario, "runs/mine", seed=1, overwrite=True)
        >>> result = td.simulate(scenario, run.best_gait())

    Args:
        scenario: A scenario, its name or its file. May be None with `resume`.
        out: The new directory.
        seed: Random seed; 0 by default. The record depends only on scenario, method and seed.
        workers: Number of worker processes; one per core by default. A Dask cluster uses all of its
            workers.
        resume: Continues the run in `out`. Scenario, seed, optimiser and objective must be the same
            as before: a recorded gait is evaluated again and must get the recorded fitness.
        overwrite: Replaces the run in `out` and all other files in that directory.
        optimizer: optimizer(space, scenario.evolution, generator) makes the optimiser of a trial
            (see optimizers.base). By default the scenario gives the optimiser.
        objective: objective(result) -> float is maximised; by default the scenario's fitness. An
            objective that reads result.trajectory has the attribute `needs_trajectory = True`.
        executor: A concurrent.futures.Executor or a Dask client, which stay open; or a function
            that makes an Executor for a number of workers, such as mpi4py's MPIPoolExecutor; see
            also lab.cluster.dask_cluster(). By default the compiled engine simulates the
            candidates of all trials together, like simulate_many(). The other engines simulate in
            worker processes. If worker processes cannot import the objective, for example in a
            notebook, gaits are simulated one by one.
        progress: True shows bars on a terminal, and lines in notebooks and files. A Progress (see
            evolution.progress) is a display of your own.
        reevaluate: After the evolution, evaluates the best gaits on the Drake diagram if the engine
            is another, simulates the gaits of a quality-diversity map on disturbed robots, and the
            best gait from moved starts (see td.spread). By default a new run does so, and a resumed
            run does what it was begun with.
        report: After the evolution, writes report.html, replay.html, figures/ and, for a
            quality-diversity map, elites/.

    Raises:
        InputError: An argument cannot be used. Also if a worker process dies, for example because
            memory is short: the run can then be resumed.
    """
    check_guard()
    for name, value, least in (("seed", seed, 0), ("workers", workers, 1)):
        if value is not None:
            check_whole("evolve", name, value, least=least)
    for name, function in (("optimizer", optimizer), ("objective", objective)):
        check_type("evolve", name, function, Callable, NoneType)
    flags = {"resume": resume, "overwrite": overwrite, "reevaluate": reevaluate, "report": report}
    for name, flag in flags.items():
        check_type("evolve", name, flag, bool, NoneType)
    check_type("evolve", "progress", progress, bool, Progress, NoneType)
    make_executor = maker_of(executor)
    if progress is True:
        progress = Progress(sys.stdout)
    if resume and overwrite:
        raise InputError("evolve", "overwrite", "excludes resume")
    out, progress = given_path(out, "evolve", "out"), progress or Progress()

    scenario = given = None if scenario is None else given_scenario(scenario)
    if resume:
        tell_code(scenario := read_manifest(out).scenario, out)
    if scenario is None:
        raise InputError("scenario", "", "is needed to begin a run")
    check_scenario(scenario)
    kind, evaluations = scenario.optimizer, scenario.evolution.evaluations
    if optimizer is None and isinstance(kind, SteadyState) and evaluations < kind.population:
        expected = f"expected at least the population, {kind.population}"
        raise InputError(scenario.name, "evolution.evaluations", f"found {evaluations}, {expected}")

    method = Method.of(scenario, objective=objective, optimizer=optimizer)
    if resume:
        record = RunRecord.resume(out, scenario=given, seed=seed, method=method)
    else:
        record = RunRecord.create(
            out,
            scenario=scenario,
            seed=int(seed or 0),
            method=method,
            overwrite=overwrite,
            reevaluate=reevaluate is not False,
        )
    with record, progress, record.manifest.in_its_units():
        count = getattr(make_executor, "workers", workers or available_cores())
        drawing = f"tetra-drake figures {shlex.quote(str(out))}"
        _introduce(progress, record, count, drawing=drawing if report else "", is_new=not resume)
        trials = open_trials(record, optimizer=optimizer)
        progress.show([trial.status for trial in trials])
        if any(trial.unevaluated for trial in trials) or (resume and objective is not None):
            evaluate = GaitEvaluation(scenario, objective)
            with evaluator_of(
                evaluate, workers=workers, executor=make_executor, warn=progress.warn
            ) as submit:
                if resume:
                    check_fitness(trials, out, submit)
                run_trials(trials, submit, show=progress.show)
        if record.manifest.reevaluate if reevaluate is None else reevaluate:
            _simulate_again(record, objective, workers, make_executor, progress)
        if report:
            failing = f"the report was not written; try again with: {drawing}"
            with _completing(progress, failing):
                from tetra_drake.report.run_page import write_report

                progress.say("drawing figures and the report")
                write_report(out)
    return load_run(out)


def _simulate_again(
    record: RunRecord,
    objective: Objective | None,
    workers: int | None,
    executor: MakeExecutor | None,
    progress: Progress,
) -> None:
    """Evaluates the best gaits of a run on the Drake diagram, unless it was the run's engine.
    Simulates the gaits of a quality-diversity map, if any, on disturbed robots, and the best gait
    from moved starts. Records all in the run's folder; an error becomes a warning."""
    directory = record.directory
    if record.manifest.scenario.engine_name != "drake":
        with _completing(progress, "the best gaits were not evaluated on the Drake diagram"):
            reevaluation.reevaluate(
                directory, objective, workers=workers, executor=executor, progress=progress
            )
    threads = None if executor else workers
    if module := record.manifest.scenario.optimizer.map:
        with _completing(progress, "gaits of the map were not simulated on disturbed robots"):
            loaded(f"{module}:judge_elites")(directory, workers=threads)
    with _completing(progress, "the spread of the best gait was not simulated"):
        loaded("tetra_drake.lab.spread:record_spread")(directory, workers=threads)


@contextlib.contextmanager
def _completing(progress: Progress, failing: str) -> Iterator[None]:
    """Context manager for optional work at the end of a run: an error becomes a warning. `failing`
    is the beginning of the warning."""
    try:
        yield
    except Exception as error:
        cause = str(error) if isinstance(error, (InputError, SimulationFailure)) else repr(error)
        progress.warn(f"{failing}: {cause}")


def _introduce(
    progress: Progress, record: RunRecord, workers: object, *, drawing: str, is_new: bool
) -> None:
    """Shows a run's method, scenario and number of workers at its start, and the files to come;
    `drawing` is the shell command that draws them, empty for none. Warns if versions differ, and of
    settings with which the robot hardly works."""
    directory, manifest = record.directory, record.manifest
    text = f"{directory}: {manifest.method}, seed {manifest.seed}, {workers} workers\n"
    text += str(manifest.scenario)
    if drawing:
        text += (
            f"\nat the end: {directory / 'replay.html'}, the best gait moving, and "
            f"{directory / 'report.html'}; at any time before: {drawing}"
        )
    progress.say(text)

    if others := manifest.other_versions:
        progress.warn(
            f"the run was begun with {', '.join(others)}; with other versions its record may "
            "differ from the record of an uninterrupted run"
        )
    if is_new:
        robot = Robot.of(manifest.scenario)
        for remark in (start_up_remark(robot), gain_remark(robot), sinking_remark(robot)):
            if remark:
                progress.warn(remark)
