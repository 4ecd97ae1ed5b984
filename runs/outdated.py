"""Tells which experiments must be recorded again, and why.

    python runs/outdated.py [NAME ...]

A recorded run is outdated if its experiment in record.py has another scenario, or if trial 0 does
not begin as recorded. Its first 600 evaluations are repeated, on the Drake diagram 20. Last digits
do not count, as processors and versions round differently: parameters may differ by 1e-9 of their
values, and distances by what a displacement by 1 nm changes (see analyse.ROUNDINGS).
"""

from __future__ import annotations

import math
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas
from analyse import ROUNDINGS, sensitivity
from record import EXPERIMENTS, HERE, Experiment, chosen

from tetra_drake.errors import InputError
from tetra_drake.evolution.manifest import MANIFEST
from tetra_drake.evolution.run import Run, load_run
from tetra_drake.experiment import evolve
from tetra_drake.formatting import fixed, listed
from tetra_drake.machine import available_cores
from tetra_drake.optimizers import optimizer_of
from tetra_drake.optimizers.base import Optimizer
from tetra_drake.robot.gait import ParameterSpace
from tetra_drake.scenario.common_sections import EvolutionSection

EVALUATIONS, ON_DIAGRAM = 600, 20
"""Numbers of evaluations that are repeated, on the fast engines and on the Drake diagram."""

PARAMETERS = 1e-9
"""Largest relative difference of parameters that does not count."""

FITNESS, DISTANCE = 1e-5, 5e-3
"""Relative errors of the numbers that a thinned run keeps of a gait without genome."""


def why_outdated(name: str, experiment: Experiment, directory: Path) -> str:
    """Reason to record an experiment again; empty if the run in the directory is up to date."""
    if not (directory / MANIFEST).exists():
        return "not recorded"
    run = load_run(directory)
    if differences := experiment.scenario(name).differences(run.scenario):
        return f"scenario differs in {listed([key for key, _ in differences])}"
    with tempfile.TemporaryDirectory() as scratch:
        return first_difference(run, begun_again(run, Path(scratch)))


def begun_again(run: Run, out: Path) -> Run:
    """The beginning of trial 0 of a run, evolved again in the folder `out`."""
    scenario = run.scenario
    most = ON_DIAGRAM if scenario.engine_name == "drake" else EVALUATIONS
    count = min(most, scenario.evolution.evaluations)

    def make_optimizer(
        space: ParameterSpace, _: EvolutionSection, generator: np.random.Generator
    ) -> Optimizer:
        # An optimiser may plan for the evaluations of the whole trial.
        return optimizer_of(scenario.optimizer)(space, scenario.evolution, generator)

    return evolve(
        scenario.with_changes({"evolution.trials": 1, "evolution.evaluations": count}),
        out,
        seed=run.manifest.seed,
        optimizer=make_optimizer,
        reevaluate=False,
        report=False,
    )


def first_difference(run: Run, again: Run) -> str:
    """First difference between trial 0 of a run and the same trial, evolved again; empty if only
    last digits differ. Where last digits lead to another search, the rest is not compared."""
    trial = run.evaluations[run.evaluations["trial"] == 0]
    trial = trial.head(again.scenario.evolution.evaluations)
    kept = {*run.with_parameters.index}
    last_digits = False
    for (row, then), (_, now) in zip(trial.iterrows(), again.evaluations.iterrows(), strict=False):
        index = int(now["index"])
        if row in kept:
            genomes = run.vector(0, index), again.vector(0, index)
            if not np.allclose(*genomes, rtol=PARAMETERS, atol=0.0):
                return "" if last_digits else f"search differs from evaluation {index} on"
        if _equal(then["fitness"], now["fitness"]):
            continue
        (change,) = sensitivity(again.scenario, [again.gait(0, index)], available_cores())
        tolerance = ROUNDINGS * change
        tolerance += 0.0 if row in kept else DISTANCE * abs(now["distance_in"])
        if not abs(now["distance_in"] - then["distance_in"]) <= tolerance:
            return _other_walk(then, now)
        last_digits = True
    if len(trial) != len(again.evaluations) and not last_digits:
        return f"trial 0 ends after {len(again.evaluations)} evaluations, not {len(trial)}"
    return ""


def _equal(then: float, now: float) -> bool:
    """True if two fitnesses are the same in all recorded digits, or both are missing."""
    return math.isclose(then, now, rel_tol=FITNESS) or (math.isnan(then) and math.isnan(now))


def _other_walk(then: pandas.Series, now: pandas.Series) -> str:
    """What has become of an evaluation."""
    before, after = (fixed(gait["distance_in"], 3) for gait in (then, now))
    return f"evaluation {now['index']} goes {after} in on {now['engine']}, not {before} in"


def main(names: Sequence[str]) -> None:
    """Prints what is outdated of the experiments of the given names, or of all. Raises
    InputError."""
    outdated = []
    for name in chosen(names):
        reason = why_outdated(name, EXPERIMENTS[name], HERE / name)
        print(f"{name}: {reason or 'up to date'}", flush=True)
        outdated += [name] if reason else []
    if outdated:
        print(f"record again: python runs/record.py {' '.join(outdated)}")


if __name__ == "__main__":
    try:
        main(sys.argv[1:])
    except InputError as error:
        sys.exit(f"outdated.py: {error}")
