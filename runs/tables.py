"""The tables of the README beside this file and of those of the recorded runs.

    python runs/tables.py [FILE ...]

Each table stands in a Markdown file between two lines:

    <!-- table NAME: made by runs/tables.py -->
    <!-- end -->
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import pandas
from analyse import MUJOCO, SHOWN, TIGHT, Analysis, load_analysis
from record import EXPERIMENTS, PICTURE

from tetra_drake.errors import InputError
from tetra_drake.evolution.manifest import MANIFEST
from tetra_drake.files import read_text, write_whole
from tetra_drake.formatting import Table, fixed, listed, percents, signed
from tetra_drake.report.result_folder import REPLAY
from tetra_drake.scenario.metric_units import METRICS
from tetra_drake.scenario.units import INCH, customary

HERE = Path(__file__).parent
README = "README.md"

APART = 0.3
"""in; where the distances on two engines differ by more, a page says so."""

_BEGIN = re.compile(r"<!-- table (?P<name>\S+): made by runs/tables.py -->")
_END = "<!-- end -->"


Runs = Mapping[str, Analysis]
"""The analyses of recorded runs by name."""


def load_all(directory: Path = HERE) -> dict[str, Analysis]:
    """The recorded runs that are there, in the order of EXPERIMENTS."""
    there = (name for name in EXPERIMENTS if (directory / name / MANIFEST).exists())
    return {name: load_analysis(directory / name) for name in there}


def gallery_table(runs: Runs) -> str:
    """All runs with the distances of their best gaits."""
    headings = ["", "experiment", "distance, in", "on the Drake diagram, in", "keeps"]
    rows = [[*_introduced(name), *_best_distances(run)] for name, run in runs.items()]
    return Table(headings, rows, text_columns=(0, 1)).markdown()


def _introduced(name: str) -> list[str]:
    picture = f'<img src="{name}/{PICTURE}" width="240" alt="{name}">'
    title = f"[`{name}`]({name}/{README}): {EXPERIMENTS[name].title}"
    return [picture, f"{title}<br>[page]({name}/{REPLAY})"]


def _best_distances(run: Analysis) -> list[str]:
    best = run.best_trial
    kept = f"{100.0 * run.gaits.loc[best, 'kept']:.0f} %"
    return [fixed(run.undisturbed(best)), fixed(run.again(best, TIGHT)), kept]


def trials_table(run: Analysis) -> str:
    """The fittest gait of each trial on all engines and on disturbed robots; below, in which trials
    the engines differ."""
    units = {name: customary(METRICS[name]) for name in SHOWN}
    names = [name.replace("_", " ") + f", {unit}" * bool(unit) for name, (_, unit) in units.items()]
    rows, apart = [], []
    for trial, gait in run.best_gaits.iterrows():
        compiled, tight = run.undisturbed(trial), run.again(trial, TIGHT)
        if not abs(compiled - tight) <= APART:
            apart.append(trial)
        judged = run.gaits.loc[trial]
        distances = [compiled, tight, run.again(trial, MUJOCO), judged["mean"] / INCH]
        kept = percents(*judged[["kept", "kept_low", "kept_high"]])
        metrics = [gait[name] / size for name, (size, _) in units.items()]
        counts = [f"{trial}", f"{gait['evaluations']:.0f}", fixed(gait["fitness"])]
        rows.append([*counts, *map(fixed, distances), kept, *map(fixed, metrics)])
    headings = ["trial", "evaluations", "fitness", "compiled, in", "diagram, in", "MuJoCo, in"]
    table = Table([*headings, "disturbed, in", "keeps", *names], rows).markdown()
    where = f"in trial{'s' * (len(apart) > 1)} {listed(apart)}"
    return table + f"\n\nThe engines differ by more than {APART} in {where}." * bool(apart)


def changes_table(run: Analysis) -> str:
    """Effects of single changes on the best gaits."""
    rows = [[row["what"], *_change_cells(row)] for _, row in run.changes.iterrows()]
    headings = ["changed by 5 %", "alone: median change (worst), in"]
    return Table([*headings, "rank correlation: mean (median size)"], rows).markdown()


def _change_cells(row: pandas.Series) -> list[str]:
    failed = f", {row['failed']:.0f} failed" if row["failed"] else ""
    worst = f"({signed(row['worst'] / INCH)}{failed})"
    ranks = f"{signed(row['correlation'])} ({fixed(row['correlation_size'])})"
    scaled = math.isfinite(row["correlation"])
    return [f"{fixed(row['median'] / INCH)} {worst}", ranks if scaled else "-"]


RUN_TABLES: dict[str, Callable[[Analysis], str]] = {
    "trials": trials_table,
    "changes": changes_table,
}
"""Tables of the run in whose folder the page is; beside them, there is the gallery."""


def pages(runs: Runs) -> list[Path]:
    """All pages with tables."""
    return [HERE / README, *(HERE / name / README for name in runs)]


def made_again(page: Path, runs: Runs) -> str:
    """The text of a page with its tables made again. Raises InputError if it cannot be read."""

    def table(name: str) -> str:
        if name == "gallery":
            return gallery_table(runs)
        return RUN_TABLES[name](runs[page.parent.name])

    return filled(read_text(page, "page"), table)


def filled(text: str, make_table: Callable[[str], str]) -> str:
    """The text with every table between its marker lines made again.

    Raises KeyError for an unknown table, ValueError for one without an end.
    """
    lines: list[str] = []
    open_table = None
    for line in text.split("\n"):
        begin = _BEGIN.fullmatch(line.strip())
        if open_table is not None and begin:
            break
        if begin:
            open_table = begin["name"]
            lines += [line, "", make_table(open_table), ""]
        elif open_table is None or line.strip() == _END:
            lines.append(line)
            open_table = None
    if open_table is not None:
        raise ValueError(f"table {open_table} has no line {_END!r} after it")
    return "\n".join(lines)


def main(arguments: Sequence[str]) -> None:
    """Makes the tables of the given Markdown files, or of all pages, again."""
    runs = load_all()
    for page in [Path(name).resolve() for name in arguments] or pages(runs):
        write_whole(page, made_again(page, runs))


if __name__ == "__main__":
    try:
        main(sys.argv[1:])
    except InputError as error:
        sys.exit(f"tables.py: {error}")
