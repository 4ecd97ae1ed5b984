"""Files of a study: tables and numbers, and a page for browsers and in Markdown."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas
from matplotlib.figure import Figure

from tetra_drake.figures.style import FILE_KINDS, save_figure
from tetra_drake.files import write_whole
from tetra_drake.formatting import render
from tetra_drake.scenario.load import SCENARIO

README = "README.md"


def save_findings(
    figure: Figure,
    folder: Path,
    name: str,
    *,
    tables: Mapping[str, pandas.DataFrame],
    summary: Mapping[str, Any],
    kinds: Sequence[str] = FILE_KINDS,
) -> list[str]:
    """Writes the results of an analysis to a folder: tables as CSV, summary.json, and the figure.

    The keys of `tables` are names of files without .csv; `name` is the name of the figure's files.
    `kinds` are the figure's file types.

    Returns the names of the files. Raises InputError if a file cannot be written.
    """
    for table, rows in tables.items():
        write_whole(folder / f"{table}.csv", rows.to_csv(index=False))
    text = json.dumps(summary, indent=1, allow_nan=False, ensure_ascii=False)
    write_whole(folder / "summary.json", text + "\n")
    save_figure(figure, folder, name, kinds=kinds)
    csv_files = [f"{table}.csv" for table in tables]
    return [*csv_files, "summary.json", *(f"{name}.{kind}" for kind in kinds)]


def write_page(folder: Path, name: str, **shown: object) -> None:
    """Writes the page of a study, as HTML to the file `name` and in Markdown to README.md.

    Args:
        folder: the folder, which also has the scenario and the figure.
        name: name of the HTML file.
        shown: what the templates show: `title`; `about`, how the study was made; `table`, a
            TextTable of the main results; `notes`, warnings, each one a paragraph; `unknown`, what
            an unknown interval means, or ""; `figure`, name of the figure's file without .svg;
            `caption`, what the figure shows, for readers who do not see it; `second`, a further
            table, below the figure; `content`, what the scenario's file has.

    Raises:
        InputError: if a file cannot be written.
    """
    for file, template in ((name, "page.html"), (README, "page.md")):
        write_whole(folder / file, render(f"lab/{template}.jinja", **shown, scenario=SCENARIO))
