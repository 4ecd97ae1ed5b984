"""Tells which experiments must be recorded again, and why.

    python runs/outdated.py [NAME ...]

A recorded run is outdated if its experiment in experiments.yaml has another scenario, or if trial 0
does not begin as recorded. The search of its first 300 evaluations, on the Drake diagram 60, is
repeated with the recorded evaluations: it must ask for the recorded parameters. Each gait that is
kept with its parameters must go as far as recorded.

Last digits do not count, as processors and versions round differently: parameters may differ by a
millionth of their values, as rounding errors of CMA-ES grow from 1e-10 in 300 evaluations,
distances by three times what the ninth digit of gravity changes, see analyse.ROUNDINGS: in a motion
with impacts errors grow to centimetres. A thinned run keeps six digits of most fitnesses and three
of metrics, so a search parts from it later.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from analyse import ROUNDINGS, WAYS
from parting import asked, made
from record import EXPERIMENTS, HERE, Experiment
from script import chosen, script

from tetra_drake.engines.queue import SimulationQueue
from tetra_drake.evolution.evaluation import GaitEvaluation
from tetra_drake.evolution.evaluators import evaluate_all, evaluator_of
from tetra_drake.evolution.manifest import MANIFEST
from tetra_drake.evolution.run import Run, load_run
from tetra_drake.formatting import fixed, listed
from tetra_drake.machine import available_cores
from tetra_drake.optimizers.base import Task
from tetra_drake.settings.units import INCH

EVALUATIONS, ON_DIAGRAM = 300, 60
"""Numbers of evaluations that are repeated, on the fast engines and on the Drake diagram."""

PARAMETERS = 1e-6
"""Largest relative difference of parameters that does not count."""

ROUNDED = 1e-9
"""Relative change of gravity that does not count; WAYS multiples of it are tried."""

DISTANCE = 1e-3
"""Difference of distances (in) that does not count for any gait. It is less than the difference of
most gaits on two engines."""


def why_outdated(name: str, experiment: Experiment, directory: Path) -> str:
    """Reason to record an experiment again; empty if the run in the directory is up to date."""
    if not (directory / MANIFEST).exists():
        return "not recorded"
    run = load_run(directory)
    if differences := experiment.scenario(name).differences(run.scenario):
        return f"scenario differs in {listed([key for key, _ in differences])}"
    difference, others = first_difference(run), run.manifest.other_versions
    if difference and others:
        return f"{difference} (recorded with {listed(others)})"
    return difference


def first_difference(run: Run) -> str:
    """First difference between trial 0 of a run and the same trial today; empty if only last digits
    differ."""
    most = ON_DIAGRAM if run.scenario.engine_name == "drake" else EVALUATIONS
    trial, vectors = made(run, 0), asked(run, 0, most)
    kept = run.with_parameters.query("trial == 0 and index < @most")["index"].tolist()
    alike = [np.allclose(vectors[i], run.vector(0, i), rtol=PARAMETERS, atol=0.0) for i in kept]
    iterations = trial["iteration"].astype(int)
    evaluate = GaitEvaluation(run.scenario)
    with evaluator_of(evaluate, workers=available_cores(), warn=print) as evaluator:
        tasks = {
            i: run.manifest.task(run.vector(0, i), trial=0, index=i, iteration=iterations[i])
            for i in kept
        }
        again = evaluate_all(evaluator, [*tasks.values()])
        found = {task.index: evaluation for task, evaluation in again}
    for index in kept:
        before = trial.loc[index, "distance_in"]
        now = found[index].metrics.get("distance", math.nan) / INCH
        if goes_elsewhere(run, tasks[index], before, now):
            return f"evaluation {index} goes {fixed(now, 3)} in, not {fixed(before, 3)} in"
    if all(alike):
        return ""
    return f"search differs at evaluation {kept[alike.index(False)]} or earlier"


def goes_elsewhere(run: Run, task: Task, before: float, now: float) -> bool:
    """True if the distance (in) of an evaluation has changed by more than rounding errors
    explain."""
    apart = abs(now - before)
    if apart <= DISTANCE or (math.isnan(before) and math.isnan(now)):
        return False
    gravities = run.scenario.robot.gravity * (1.0 + ROUNDED * np.arange(1, WAYS + 1))
    rounded = [run.scenario.with_numbers({"robot.gravity": each}) for each in gravities.tolist()]
    with SimulationQueue(available_cores()) as queue:
        again = [GaitEvaluation(each).on_queue(task, queue) for each in rounded]
        metrics = [evaluation.result().metrics for evaluation in again]
    inches = np.array([each.get("distance", math.nan) for each in metrics]) / INCH
    return not apart <= ROUNDINGS * np.nanmax(np.abs(inches - now))


@script
def main(names: Sequence[str]) -> None:
    """Prints what is outdated of the experiments of the given names, or of all. Raises
    InputError."""
    outdated = []
    for name in chosen(names, EXPERIMENTS):
        reason = why_outdated(name, EXPERIMENTS[name], HERE / name)
        print(f"{name}: {reason or 'up to date'}", flush=True)
        outdated += [name] if reason else []
    if outdated:
        print(f"record again: python runs/record.py {' '.join(outdated)}")
