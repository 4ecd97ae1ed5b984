"""The map of a run: the fittest gait in each cell of a grid of two metrics, made from its record.

elites.jsonl    those gaits of a run's map that were simulated on disturbed robots, line by line
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from tetra_drake.analysis.robustness import by_gait, judge
from tetra_drake.evolution.entries import ELITES, RecordFile
from tetra_drake.evolution.manifest import read_manifest
from tetra_drake.evolution.run import Run, load_run
from tetra_drake.files import json_number
from tetra_drake.optimizers.quality_diversity import FLOOR
from tetra_drake.scenario.optimizer_kinds import QualityDiversity

if TYPE_CHECKING:
    import pandas

LUCKY = 0.5
"""A gait of the map that keeps a smaller share of the draws of disturbances is there by luck."""

CELLS = ["cell_1", "cell_2"]
_KEY = ["trial", "index"]
_JUDGED = ["kept", "mean_distance"]
_EPSILON = 1e-6  # which pyribs adds against rounding


def elites(run: Run) -> pandas.DataFrame:
    """The fittest gait of each cell, of all trials, the fittest first: rows of the evaluations, and
    cell_1 and cell_2, the numbers of the cell, from 0; kept and mean_distance, the share of the
    draws kept and the mean distance (m) on disturbed robots, NaN where not simulated. Empty if the
    run's scenario asks for no map.
    """
    import pandas

    table, kind = run.whole, run.scenario.optimizer
    judged = pandas.DataFrame(run.file(ELITES).read(), columns=[*_KEY, *_JUDGED])
    if isinstance(kind, QualityDiversity) and not table.empty:
        table = table[table["fitness"] > FLOOR].dropna(subset=list(kind.measures))
        table[CELLS] = _cells(table, kind)
        table = table.sort_values(["fitness", *_KEY], ascending=[False, True, True])
        table = table.drop_duplicates(CELLS)
    else:
        table = table.iloc[:0].assign(**dict.fromkeys(CELLS, 0))
    return table.merge(judged.astype(dict.fromkeys(_JUDGED, float)), on=_KEY, how="left")


def _cells(gaits: pandas.DataFrame, kind: QualityDiversity) -> npt.NDArray[np.int64]:
    """Cell numbers (gaits, 2) of gaits along each of the two measures, as pyribs has them."""
    low, high = np.array(list(kind.measures.values())).T
    count = np.array(kind.cells)
    places = (count * (gaits[list(kind.measures)].to_numpy() - low) + _EPSILON) / (high - low)
    return places.clip(0, count - 1).astype(np.int64)


def judge_elites(
    directory: Path, *, workers: int | None = None, say: Callable[[str], None] = lambda text: None
) -> None:
    """Simulates the elites of a run on robots disturbed as judge() does, as often as the scenario
    says, and adds to the record how far they walk. Those that have been are skipped."""
    manifest = read_manifest(directory)
    kind, file = manifest.scenario.optimizer, RecordFile.of(directory, manifest.run, ELITES)
    if not isinstance(kind, QualityDiversity) or not kind.draws:
        return
    file.repair()
    run = load_run(directory)
    scenario, gaits_of_map = run.scenario, elites(run)
    missing = gaits_of_map[gaits_of_map["kept"].isna()]
    if missing.empty:
        return
    say(f"simulating {len(missing)} gaits of the map in {kind.draws} draws of disturbances")
    keys = missing[_KEY].to_numpy().tolist()
    gaits = {i: run.gait(trial, index) for i, (trial, index) in enumerate(keys)}
    seed = run.manifest.seed
    judgement = judge(scenario, gaits, draws=kind.draws, seed=seed, alone=False, workers=workers)
    table = by_gait(judgement)
    lines = [
        {"trial": trial, "index": index, "kept": kept, "mean_distance": json_number(mean)}
        for (trial, index), kept, mean in zip(keys, table["kept"], table["mean"], strict=True)
    ]
    file.append(lines)


def robust(gaits: pandas.DataFrame) -> pandas.DataFrame:
    """Elites without the lucky ones, the fittest first."""
    return gaits[~(gaits["kept"] < LUCKY)]


def chosen(run: Run) -> dict[str, pandas.Series]:
    """Fittest of the robust elites and those nearest to the corners of the map, by name."""
    gaits, kind = robust(elites(run)), run.scenario.optimizer
    if not isinstance(kind, QualityDiversity) or gaits.empty:
        return {}
    return {"fittest of the map": gaits.iloc[0]} | _corners(gaits, kind)


def _corners(gaits: pandas.DataFrame, kind: QualityDiversity) -> dict[str, pandas.Series]:
    """Gaits whose cells are nearest to the corners, by the corners' names."""
    named = {}
    count = np.array(kind.cells)
    first, second = (name.replace("_", " ") for name in kind.measures)
    for (i, one), (j, other) in itertools.product(enumerate(("low", "high")), repeat=2):
        corner = np.array([i, j]) * (count - 1)
        away = (((gaits[CELLS] - corner) / count) ** 2).sum(axis=1)
        named[f"{one} {first}, {other} {second}"] = gaits.loc[away.idxmin()]
    return named


def distinct_gaits(named: Mapping[str, pandas.Series]) -> list[tuple[list[str], pandas.Series]]:
    """The different ones among named gaits, each with all of its names."""
    names: dict[Any, list[str]] = {}
    for name, gait in named.items():
        names.setdefault((gait["trial"], gait["index"]), []).append(name)
    return [(alike, named[alike[0]]) for alike in names.values()]
