"""The paper about the package: fills its numbers in from the records.

    python runs/paper.py

Writes paper/paper.md from paper.md.jinja, in the form of the Journal of Open Source Software.
"""

from __future__ import annotations

import datetime
import sys
from pathlib import Path

import jinja2
import numpy as np
import pandas
import tables
from corpus import ENGINES
from corpus import MEASURED as CORPUS
from measured import Score, measured_rows

from tetra_drake.errors import InputError
from tetra_drake.files import read_json, read_text, write_whole
from tetra_drake.formatting import TextTable, fixed
from tetra_drake.laws.friction import Coulomb
from tetra_drake.scenario.yaml_text import parse_yaml
from tetra_drake.settings.units import INCH

HERE = Path(__file__).parent
CITATION = HERE.parent / "CITATION.cff"
PAGE, TEMPLATE = HERE / "paper/paper.md", HERE / "paper.md.jinja"
SIZES = (1, 4, 7, 13)
"""Least numbers of bodies of the rows of the table by size."""
MICRO = 1e6


def corpus_rows() -> pandas.DataFrame:
    """Numbers of the structures of the literature, one row each, with "error", the largest relative
    difference from a number of its source (absolute from a number that is 0)."""
    rows = pandas.DataFrame.from_dict(read_json(CORPUS, "corpus"), orient="index")
    rows["error"] = [
        max((abs(found - given) / (abs(given) or 1.0) for _, given, found, _ in known), default=0.0)
        for known in rows["known"]
    ]
    return rows


def size_table(rows: pandas.DataFrame) -> TextTable:
    """Structures by number of bodies: how well they rest, on each engine, and how fast they are."""
    lines = []
    for least, above in zip(SIZES, (*SIZES[1:], np.inf), strict=True):
        some = rows[(rows["bodies"] >= least) & (rows["bodies"] < above)]
        rest = [f"{MICRO * some[engine].max():.1g}" for engine in ENGINES]
        most = some["bodies"].max()
        speed, error = fixed(some["speed"].median(), 0), fixed(100.0 * some["error"].max(), 3)
        lines.append([f"{least} to {most}", str(len(some)), *rest, error, speed])
    head = ["bodies", "structures", *(f"rest, {engine} (µm)" for engine in ENGINES)]
    return TextTable([*head, "sources, largest difference (%)", "times real time"], lines)


def measured_totals() -> dict[str, Score]:
    """Scores of the predictions whose measured values were known, by kind of quantity and of all,
    and of the blind ones as they were committed."""
    rows = measured_rows()
    known = rows["known"]
    groups = [*known.groupby("kind", sort=False), ("all", known), ("blind", rows["blind"])]
    return {str(kind): Score.of(group) for kind, group in groups}


def agreement(runs: tables.Runs) -> dict[str, str | int]:
    """Differences (in) of best gaits on Drake and the compiled engine, under Coulomb friction."""
    chosen = {
        name: run
        for name, run in runs.items()
        if isinstance(tables.scenario_of(name).friction, Coulomb)
        and tables.scenario_of(name).policy is None
    }
    pairs = [
        tables.distances_of(run, trial)[:2] / INCH
        for run in chosen.values()
        for trial in run.best_gaits.index
    ]
    apart = np.abs(np.subtract(*np.array(pairs).T))
    return {
        "runs": len(chosen),
        "gaits": len(apart),
        "median": fixed(np.median(apart), 4),
        "largest": fixed(apart.max(), 2),
        "apart": fixed(tables.APART / INCH, 1),
        "far": int(np.sum(apart > tables.APART / INCH)),
    }


def released(citation: Path = CITATION) -> datetime.date:
    """Day of the release that CITATION.cff names. Raises InputError if it names none."""
    fields, key = parse_yaml(read_text(citation, "citation"), citation), "date-released"
    given = fields.get(key) if isinstance(fields, dict) else None
    try:
        return datetime.date.fromisoformat(str(given))
    except ValueError:
        raise InputError(citation, key, f"is {given!r}, expected a day as 2026-01-31") from None


def paper() -> str:
    """Text of the paper, whose date is the day of the last release."""
    rows, runs = corpus_rows(), tables.load_all()
    trials = runs["thesis"].best_gaits
    environment = jinja2.Environment(undefined=jinja2.StrictUndefined, keep_trailing_newline=True)
    template = environment.from_string(read_text(TEMPLATE, "template"))
    return template.render(
        date=f"{released():%-d %B %Y}",
        experiments=len(runs),
        evaluations=f"{trials['evaluations'].sum():,.0f}",
        corpus={
            "structures": len(rows),
            "smallest": rows["bodies"].min(),
            "largest": rows["bodies"].max(),
            "known": rows["known"].map(len).sum(),
            "worst_known": fixed(100.0 * rows["error"].max(), 2),
        },
        by_size=size_table(rows).markdown(),
        trust=agreement(runs),
        best={
            name: fixed(tables.best_gait(name, runs[name]).reached["compiled"] / INCH, 1)
            for name in ("thesis", "coulomb")
        },
        measured=measured_totals(),
    )


def main() -> None:
    """Writes the paper."""
    write_whole(PAGE, paper())
    print(PAGE)


if __name__ == "__main__":
    try:
        main()
    except InputError as error:
        sys.exit(f"paper.py: {error}")
