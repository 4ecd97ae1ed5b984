"""Figure, page and files of a fit: the folder with README.md, tables, and the fitted scenario."""

from __future__ import annotations

from pathlib import Path

from matplotlib.ticker import MaxNLocator, StrMethodFormatter

from tetra_drake.figures.style import (
    Drawn,
    figure_function,
    legend_below,
    line_style,
    name_panel,
    page_of,
    save_findings,
    set_title,
)
from tetra_drake.files import write_whole
from tetra_drake.formatting import TextTable, fixed
from tetra_drake.scenario.load import SCENARIO, save_scenario
from tetra_drake.study.fit import Fit

PAGE = "README.md"

MANY = 100
"""Numbers of a measurement from which their points are small."""
MOST = 2000
"""Largest number of points in a panel; of more numbers, some are drawn by lot."""

UNKNOWN = """`± ?` is an unknown interval: the data do not determine the value, or predictions are
not smooth. Then their derivatives by steps of 0.1 % and 1 % of the start differ by more than 20 %.
One contact that comes or goes, in any part of a log, is enough: without this part, or with other
noise, there may be an interval."""


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


@figure_function
def residuals(fit: Fit) -> Drawn:
    """Residuals of a fit over time, or by number, in standard deviations of the measurements.

    A panel shows a measurement: predictions minus measured numbers, with the start values and with
    the fitted ones. The grey band holds 95 % of the residuals of a right model.
    """
    groups = list(fit.residuals.groupby("measurement", sort=False))
    page = page_of(height_in=0.8 + 1.7 * len(groups))
    panels = page.subplots(len(groups), 1, squeeze=False)[:, 0]
    styles = {}
    for panel, (name, rows) in zip(panels, groups, strict=True):
        panel.axhspan(-1.96, 1.96, color="0.9", linewidth=0.0)
        size = 3.0 if len(rows) > MANY else 9.0
        drawn = rows.sample(min(len(rows), MOST), random_state=0)
        for series, column in enumerate(("start", "fitted")):
            color = line_style(1 - series)["color"]
            style = {"color": color, "marker": ".", "linestyle": "none", "markersize": size}
            difference = (drawn[column] - drawn["measured"]) / drawn["uncertainty"]
            panel.plot(drawn["along"], difference, **style)
            styles[column] = style
        name_panel(panel, str(name))
        panel.set(ylabel="residual / std. dev.", yscale="symlog")
        panel.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        is_motion = (rows["along"] % 1.0).any()
        panel.set_xlabel("time of the log (s)" if is_motion else "number")
        if not is_motion:
            panel.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
    legend_below(page, styles)
    set_title(page, "Predictions minus measurements")
    return page
