"""The paper about the package: fills its numbers in from the records.

    python runs/paper.py

Writes paper/paper.md in the form of the Journal of Open Source Software.
"""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from pathlib import Path

import pandas
import tables
from corpus import ENGINES
from corpus import MEASURED as CORPUS
from measured import Score, measured_rows, totals
from page import rendered
from script import read_settings, script

from tetra_drake.errors import InputError
from tetra_drake.files import read_json, write_whole
from tetra_drake.settings.units import INCH

HERE = Path(__file__).parent
CITATION = HERE.parent / "CITATION.cff"
PAGE = HERE / "paper/paper.md"


def corpus_rows() -> pandas.DataFrame:
    """Numbers of the structures of the literature, one row each, with "error", the largest relative
    difference from a number of its source (absolute from a number that is 0)."""
    rows = pandas.DataFrame.from_dict(read_json(CORPUS, "corpus"), orient="index")
    rows["error"] = [
        max((abs(found - given) / (abs(given) or 1.0) for _, given, found, _ in known), default=0.0)
        for known in rows["known"]
    ]
    return rows


def released(citation: Path = CITATION) -> datetime.date:
    """Day of the release that CITATION.cff names. Raises InputError if it names none."""
    fields, key = read_settings(citation), "date-released"
    given = fields.get(key) if isinstance(fields, dict) else None
    try:
        return datetime.date.fromisoformat(str(given))
    except ValueError:
        raise InputError(citation, key, f"is {given!r}, expected a day as 2026-01-31") from None


def paper() -> str:
    """Text of the paper, whose date is the day of the last release."""
    rows, runs, predictions = corpus_rows(), tables.load_all(), measured_rows()
    return rendered(
        "paper.md",
        date=f"{released():%-d %B %Y}",
        runs=runs,
        corpus=rows,
        engines=ENGINES,
        differences=tables.differences(runs),
        far=tables.APART / INCH,
        best=tables.best_of_all(runs),
        kinds=totals(predictions["known"], "kind"),
        blind=Score.of(predictions["blind"]),
    )


@script
def main(_: Sequence[str] = ()) -> None:
    """Writes the paper."""
    write_whole(PAGE, paper())
    print(PAGE)
