"""Tells which experiments must be recorded again, and why.

    python runs/outdated.py [NAME ...]

A recorded run is outdated if its experiment in record.py has another scenario, or if trial 0 does
not begin as recorded. Its first 600 evaluations are repeated, on the Drake diagram 60. The search
is told the recorded fitnesses: it must ask for the recorded parameters. Each gait that is kept with
its parameters must go as far as recorded.

Last digits do not count, as processors and versions round differently: parameters may differ by
1e-9 of their values, distances by what a displacement by 1 nm changes (see analyse.ROUNDINGS). A
thinned run keeps six digits of most fitnesses, so gaits that are equal in these may change places.
CMA-ES and maps may search elsewhere on another processor, as eigenvectors of equal eigenvalues are
arbitrary; the reason says with what the run was recorded, where that is not what is installed.
"""

from __future__ import annotations

import math
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
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
from tetra_drake.optimizers.base import Evaluation, Iteration, Optimizer
from tetra_drake.robot.parameter_space import ParameterSpace, Vector
from tetra_drake.scenario.experiment_sections import EvolutionSection

EVALUATIONS, ON_DIAGRAM = 600, 60
"""Numbers of evaluations that are repeated, on the fast engines and on the Drake diagram."""

PARAMETERS = 1e-9
"""Largest relative difference of parameters that does not count."""

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
    with tempfile.TemporaryDirectory() as scratch:
        difference = first_difference(run, begun_again(run, Path(scratch)))
    others = run.manifest.other_versions
    if difference and others:
        return f"{difference} (recorded with {listed(others)})"
    return difference


@dataclass
class Reminded:
    """Optimiser that gets the recorded fitnesses, not the simulated ones."""

    optimizer: Optimizer
    fitnesses: Sequence[float]
    """Recorded fitnesses by evaluation; NaN of a failure."""
    told: int = 0
    """Number of evaluations so far."""

    def ask(self) -> list[Vector]:
        """See Optimizer.ask()."""
        return self.optimizer.ask()

    def tell(self, evaluations: Sequence[Evaluation]) -> Iteration:
        """See Optimizer.tell()."""
        recorded = self.fitnesses[self.told : self.told + len(evaluations)]
        self.told += len(evaluations)
        reminded = [
            replace(evaluation, fitness=-math.inf if math.isnan(fitness) else fitness)
            for evaluation, fitness in zip(evaluations, recorded, strict=False)
        ]
        return self.optimizer.tell([*reminded, *evaluations[len(reminded) :]])


def begun_again(run: Run, out: Path) -> Run:
    """The beginning of trial 0 of a run, evolved again in the folder `out`."""
    scenario = run.scenario
    most = ON_DIAGRAM if scenario.engine_name == "drake" else EVALUATIONS
    count = min(most, scenario.evolution.evaluations)
    fitnesses = run.evaluations.loc[run.evaluations["trial"] == 0, "fitness"].tolist()

    def make_optimizer(
        space: ParameterSpace, _: EvolutionSection, generator: np.random.Generator
    ) -> Optimizer:
        # An optimiser may plan for the evaluations of the whole trial.
        make = optimizer_of(scenario.optimizer)
        return Reminded(make(space, scenario.evolution, generator), fitnesses)

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
    last digits differ."""
    trial = run.evaluations[run.evaluations["trial"] == 0]
    trial = trial.head(again.scenario.evolution.evaluations)
    if len(trial) != len(again.evaluations):
        return f"trial 0 ends after {len(again.evaluations)} evaluations, not {len(trial)}"
    kept = trial.index.intersection(run.with_parameters.index)
    for row, then in trial.loc[kept].iterrows():
        index, now = int(then["index"]), again.evaluations.loc[row]
        genomes = run.vector(0, index), again.vector(0, index)
        if not np.allclose(*genomes, rtol=PARAMETERS, atol=0.0):
            return f"search differs at evaluation {index} or earlier"
        if _goes_elsewhere(then, now, again):
            before, after = (fixed(gait["distance_in"], 3) for gait in (then, now))
            return f"evaluation {index} goes {after} in on {now['engine']}, not {before} in"
    return ""


def _goes_elsewhere(then: pandas.Series, now: pandas.Series, again: Run) -> bool:
    """True if the distance of a gait has changed by more than rounding errors explain."""
    apart = abs(now["distance_in"] - then["distance_in"])
    if apart <= DISTANCE or (math.isnan(then["distance_in"]) and math.isnan(now["distance_in"])):
        return False
    gait = again.gait(0, int(now["index"]))
    (change,) = sensitivity(again.scenario, [gait], available_cores())
    return not apart <= ROUNDINGS * change


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
