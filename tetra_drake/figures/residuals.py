"""Figure of the residuals of a fit."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.ticker import MaxNLocator, StrMethodFormatter

from tetra_drake.figures.style import (
    Drawn,
    Page,
    figure_function,
    legend_below,
    line_style,
    name_panel,
    page_of,
    set_title,
)

if TYPE_CHECKING:
    from tetra_drake.analysis.fit import Fit

MANY = 100
"""Numbers of a measurement from which their points are small."""
MOST = 2000
"""Largest number of points in a panel; of more numbers, some are drawn by lot."""


@figure_function
def residuals(fit: Fit, *, figure: Page | None = None) -> Drawn:
    """Residuals of a fit over time, or by number, in standard deviations of the measurements.

    A panel shows a measurement: predictions minus measured numbers, with the start values and with
    the fitted ones. The grey band holds 95 % of the residuals of a right model.
    """
    groups = list(fit.residuals.groupby("measurement", sort=False))
    page = page_of(figure, height_in=0.8 + 1.7 * len(groups))
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
