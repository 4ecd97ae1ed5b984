"""Map of a run: the fittest gait in each cell of a grid of two metrics (an elite).

The map is computed from the record of the run.

elites.jsonl    results of elites on disturbed robots, one line per gait
"""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from typing import Any, cast

import numpy as np
import pandas

from tetra_drake.evolution.entries import ELITES, EliteLine, RecordFile
from tetra_drake.evolution.manifest import read_manifest
from tetra_drake.evolution.run import Run, distinct_gaits, gait_label, load_run
from tetra_drake.figures.style import Drawn, figure_function, name_panel, page_of, titled
from tetra_drake.files import json_number
from tetra_drake.formatting import listed
from tetra_drake.lab.elites.quality_diversity import FLOOR
from tetra_drake.lab.study.robustness import by_gait, robustness
from tetra_drake.scenario.metrics import METRICS, UNITS
from tetra_drake.scenario.optimizer_kinds import QualityDiversity

LUCKY = 0.5
"""Least share `kept` of draws for a robust elite; see robustness.LOSS. An elite with less is left
out, because its fitness is probably luck."""

CELLS = ["cell_1", "cell_2"]
_KEY = ["trial", "index"]
_JUDGED = ["kept", "mean_distance"]
_EPSILON = 1e-6  # pyribs adds this number against rounding

_LUCKY: Any = {"color": "0.55", "marker": "x", "linestyle": "", "markersize": 3.0, "zorder": 3}
_NUMBER: Any = {"ha": "center", "va": "center", "size": "small", "weight": "bold", "zorder": 4}
_DISC: Any = {"boxstyle": "circle,pad=0.15", "facecolor": "white", "edgecolor": "black"}


def elites(run: Run) -> pandas.DataFrame:
    """Elites of a run, the fittest gait of each cell of its map, over all trials. The fittest is
    first; the table is empty if the optimiser makes no map.

    A row is a row of Run.evaluations with more columns: cell_1 and cell_2 (index of the cell along
    each of the two metrics, from 0), kept (share of disturbance draws where the gait loses at most
    10 % of its distance and meets the requirements), mean_distance (m, on disturbed robots). The
    last two are NaN if the gait was not simulated on disturbed robots.
    """
    table, kind = run.with_parameters, run.scenario.optimizer
    lines = [line.content() for line in run.file(ELITES).read()]
    judged = pandas.DataFrame(lines, columns=[*_KEY, *_JUDGED])
    if isinstance(kind, QualityDiversity) and not table.empty:
        table = table[table["fitness"] > FLOOR].dropna(subset=list(kind.measures))
        low, high = np.array(list(kind.measures.values())).T
        count, shown = np.array(kind.cells), table[list(kind.measures)].to_numpy()
        cells = (count * (shown - low) + _EPSILON) / (high - low)  # as pyribs computes them
        table[CELLS] = cells.clip(0, count - 1).astype(np.int64)
        table = table.sort_values(["fitness", *_KEY], ascending=[False, True, True])
        table = table.drop_duplicates(CELLS)
    else:
        table = table.iloc[:0].assign(**dict.fromkeys(CELLS, 0))
    return table.merge(judged.astype(dict.fromkeys(_JUDGED, float)), on=_KEY, how="left")


def judge_elites(directory: Path, *, workers: int | None = None) -> None:
    """Simulates the elites of a run on disturbed robots and records the results in the run's
    folder; see robustness().

    An elite is the fittest gait of a cell of the map. The optimiser's settings in the scenario set
    the number of draws of disturbances; without draws or a map, nothing is done. Elites with a
    recorded result are skipped. `workers` is the number of threads.
    """
    manifest = read_manifest(directory)
    kind, file = manifest.scenario.optimizer, RecordFile.of(directory, manifest.run, ELITES)
    if not isinstance(kind, QualityDiversity) or not kind.draws:
        return
    file.repair()
    run = load_run(directory)
    of_map = elites(run)
    missing = of_map[of_map["kept"].isna()]
    if missing.empty:
        return
    keys = missing[_KEY].to_numpy().tolist()
    gaits = {i: run.gait(trial, index) for i, (trial, index) in enumerate(keys)}
    judgement = robustness(
        run.scenario, gaits, draws=kind.draws, seed=manifest.seed, alone=False, workers=workers
    )
    table = by_gait(judgement)
    lines = [
        EliteLine(trial=trial, index=index, kept=kept, mean_distance=json_number(mean))
        for (trial, index), kept, mean in zip(keys, table["kept"], table["mean"], strict=True)
    ]
    file.append(lines)


def kept_gaits(gaits: pandas.DataFrame) -> pandas.DataFrame:
    """Rows of `gaits`, a table from elites(), without the elites whose column `kept` (share of the
    disturbance draws where they are robust) is below one half. Elites not simulated on disturbed
    robots stay."""
    return gaits[~(gaits["kept"] < LUCKY)]


def notable_gaits(run: Run) -> dict[str, pandas.Series]:
    """Notable gaits of a run's quality-diversity map, by name: the fittest elite of kept_gaits(),
    and those nearest to the four corners of the map. A value is a row of elites()."""
    gaits, kind = kept_gaits(elites(run)), run.scenario.optimizer
    if not isinstance(kind, QualityDiversity) or gaits.empty:
        return {}
    named, count = {"fittest of the map": gaits.iloc[0]}, np.array(kind.cells)
    first, second = (name.replace("_", " ") for name in kind.measures)
    for (i, one), (j, other) in itertools.product(enumerate(("low", "high")), repeat=2):
        corner = np.array([i, j]) * (count - 1)
        away = (((gaits[CELLS] - corner) / count) ** 2).sum(axis=1)
        named[f"{one} {first}, {other} {second}"] = gaits.loc[away.idxmin()]
    return named


@figure_function
def map_of_gaits(run: Run) -> Drawn:
    """Map of gaits over two measures: the fitness of the fittest gait in each cell. White cells
    have no gait. Numbers mark the fittest gait and the gaits nearest to the corners.

    If gaits were simulated on disturbed robots, the second panel shows the share of these draws
    where a gait is robust: it loses at most 10 % of its undisturbed distance and meets the
    requirements. The first panel leaves out gaits for which this share is below one half; crosses
    are in their cells."""
    kind, units = cast(QualityDiversity, run.scenario.optimizer), run.scenario.units
    edges, labels = [], []
    for (measure, (low, high)), cells in zip(kind.measures.items(), kind.cells, strict=True):
        size, unit = units.of(UNITS[measure])
        edges.append(np.linspace(low, high, cells + 1) / size)
        labels.append(measure.replace("_", " ") + (f" ({unit})" if unit else ""))
    middles = [(edge[:-1] + edge[1:]) / 2.0 for edge in edges]

    gaits = elites(run)
    kept, named = kept_gaits(gaits), distinct_gaits(notable_gaits(run))
    title = f"fitness ({len(kept)} of {math.prod(kind.cells)} cells)"
    contents: dict[str, Any] = {title: (kept.set_index(CELLS)["fitness"], {"cmap": "viridis"})}
    if gaits["kept"].notna().any():
        shares = 100.0 * gaits.set_index(CELLS)["kept"]
        contents["robust draws (%)"] = shares, {"cmap": "cividis", "vmin": 0.0, "vmax": 100.0}

    page = page_of(height_in=4.4 + 0.17 * len(named))
    row = page.subplots(1, len(contents), squeeze=False, sharey=True)[0]
    for panel, (title, (values, look)) in zip(row, contents.items(), strict=True):
        across, up = map(range, kind.cells)
        grid = values.unstack().reindex(index=across, columns=up).to_numpy()
        page.colorbar(panel.pcolormesh(*edges, grid.T, rasterized=True, **look), ax=panel)
        panel.grid(visible=False)
        panel.set_xlabel(labels[0])
        name_panel(panel, title)
        for number, (_, gait) in enumerate(named, start=1):
            at = [middle[gait[cell]] for middle, cell in zip(middles, CELLS, strict=True)]
            panel.text(*at, str(number), bbox=_DISC, **_NUMBER)
    row[0].set_ylabel(labels[1])
    if len(row) > 1:
        lucky = gaits[gaits["kept"] < LUCKY]
        crosses = [middle[lucky[cell]] for middle, cell in zip(middles, CELLS, strict=True)]
        row[0].plot(*crosses, **_LUCKY)

    notes = [f"{listed(names)}: {gait_label(gait)}" for names, gait in named]
    notes = [f"{number}  {note}" for number, note in enumerate(notes, start=1)]
    if len(row) > 1 and len(lucky):
        notes.append("×  left out: 90 % of the distance is kept in less than half of the draws")
    notes += [f"{name.replace('_', ' ')}: {METRICS[name].note}" for name in kind.measures]
    page.supxlabel("\n".join(notes), x=0.01, ha="left", fontsize="small", wrap=True)
    return titled(page, "Map of gaits")
