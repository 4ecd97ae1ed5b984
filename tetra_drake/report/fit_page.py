"""Folder of a fit: the page README.md, tables, figure, and the scenario with the fitted values."""

from __future__ import annotations

from pathlib import Path

from tetra_drake.analysis.fit import Fit
from tetra_drake.figures.residuals import residuals
from tetra_drake.figures.style import save_findings
from tetra_drake.files import write_whole
from tetra_drake.formatting import TextTable, fixed
from tetra_drake.scenario.load import SCENARIO, save_scenario

PAGE = "README.md"


def save_fit(fit: Fit, folder: Path) -> list[str]:
    """Writes the scenario with the fitted values, tables, the figure of the residuals and a page to
    a folder. Returns the names of the files. Raises InputError if one cannot be written."""
    save_scenario(folder, fit.scenario)
    tables = {
        "parameters": fit.parameters.reset_index(),
        "correlations": fit.correlations.reset_index(names="key"),
        "residuals": fit.residuals,
    }
    summary = {
        "misfit": fit.misfit,
        "start_misfit": fit.start_misfit,
        "clock_offsets_s": fit.clock_offsets,
        "warnings": fit.warnings,
        "evaluations": fit.evaluations,
        "wall_time_s": fit.wall_time,
    }
    figure = residuals(fit)
    written = save_findings(figure, folder, "residuals.figure", tables=tables, summary=summary)
    write_whole(folder / PAGE, _page(fit))
    return [PAGE, SCENARIO, *written]


UNKNOWN = """`± ?` is an unknown interval: the data do not determine the value, or predictions are
not smooth. Then their derivatives by steps of 0.1 % and 1 % of the start differ by more than 20 %.
One contact that comes or goes, in any part of a log, is enough: without this part, or with other
noise, there may be an interval."""


def _page(fit: Fit) -> str:
    notes = "\n".join(f"- {note}" for note in fit.notes)
    rows = [[str(key), *map(fixed, row)] for key, *row in fit.correlations.itertuples()]
    correlations = TextTable(["correlation", *map(str, fit.correlations)], rows)
    return "\n\n".join(
        [
            f"# Fit of {fit.scenario.name}",
            f"{len(fit.residuals)} measured numbers, {fit.evaluations} evaluations, "
            f"{fit.wall_time:.0f} s. Sum of squared residuals per degree of freedom, in units of "
            f"the stated uncertainty: {fit.start_misfit:.3g} with the start values, "
            f"{fit.misfit:.3g} fitted; 1 is a model that is right. Intervals are of 95 %, "
            "from the derivatives at the fitted values. Where the misfit exceeds 1, they are wider "
            "by its root.",
            fit.table.markdown(),
            *([notes] if notes else []),
            *([UNKNOWN.replace("\n", " ")] if fit.parameters["low"].isna().any() else []),
            "![residuals](residuals.figure.svg)",
            correlations.markdown(),
            f"[{SCENARIO}]({SCENARIO}) has the fitted values.\n",
        ]
    )
