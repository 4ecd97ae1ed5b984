"""Where two runs part that search with the same seeds on two engines.

A search depends on its seed and on the evaluations that it is told. So the search of a trial is
repeated here with its record, without simulations, and asks for the gaits that it asked for then.
Two runs ask for the same gaits until a fitness differs by so much that another gait is chosen, or
replaced.
"""

from __future__ import annotations

import numpy as np
import pandas

from tetra_drake.evolution.run import Run
from tetra_drake.optimizers import optimizer_of
from tetra_drake.optimizers.base import Evaluation
from tetra_drake.robot.parameter_space import ParameterSpace, Vector


def made(run: Run, trial: int) -> pandas.DataFrame:
    """The evaluations of a trial. Index: index."""
    return run.evaluations[run.evaluations["trial"] == trial].set_index("index")


def asked(run: Run, trial: int, most: int | None = None) -> list[Vector]:
    """The parameter vectors for which the search of a trial asked, in the order of its evaluations;
    at most so many."""
    scenario = run.scenario
    seed = np.random.SeedSequence(run.manifest.seed).spawn(scenario.evolution.trials)[trial]
    make, space = optimizer_of(scenario.optimizer), ParameterSpace.of(scenario)
    optimizer = make(space, scenario.evolution, np.random.default_rng(seed))
    record = made(run, trial).head(most)
    measures = record[list(getattr(scenario.optimizer, "measures", []))].to_dict("records")
    fitnesses = record["fitness"].fillna(-np.inf)
    told = [Evaluation(*pair) for pair in zip(fitnesses, measures, strict=True)]
    vectors: list[Vector] = []
    while len(vectors) < len(told):
        first = len(vectors)
        vectors += optimizer.ask()
        if len(vectors) <= len(told):
            optimizer.tell(told[first : len(vectors)])
    return vectors[: len(told)]


def partings(first: Run, second: Run) -> pandas.DataFrame:
    """Where the trials of `first` part from the same trials of `second`. Index: trial.

    Columns: evaluations (of `first`), alike (of them, at the begin: the same gaits in both), apart
    (in, median difference of the distances of the initial gaits, which records keep with all
    digits), farthest (in, the largest difference of all that are alike), first_best and second_best
    (in, distance of the fittest gait among as many evaluations of each run as `first` has).
    """
    rows = {}
    for trial in range(first.scenario.evolution.trials):
        pairs = zip(asked(first, trial), asked(second, trial), strict=False)
        differs = [not np.array_equal(one, other) for one, other in pairs]
        alike = [*differs, True].index(True)
        ours, theirs = made(first, trial), made(second, trial)
        apart = (ours["distance_in"] - theirs["distance_in"]).abs().head(alike)
        initial = apart[ours["iteration"] == 0]
        best = [gaits.loc[gaits["fitness"].head(len(ours)).idxmax()] for gaits in (ours, theirs)]
        bests = (one["distance_in"] for one in best)
        rows[trial] = [len(ours), alike, initial.median(), apart.max(), *bests]
    columns = ["evaluations", "alike", "apart", "farthest", "first_best", "second_best"]
    table = pandas.DataFrame.from_dict(rows, orient="index", columns=columns)
    return table.rename_axis("trial")
