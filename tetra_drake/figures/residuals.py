"""Figure of the residuals of a fit."""

from __future__ import annotations

from typing import TYPE_CHECKING

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
        for series, (column, label) in enumerate((("start", "start"), ("fitted", "fitted"))):
            color = line_style(1 - series)["color"]
            style = {"color": color, "marker": ".", "linestyle": "none", "markersize": 3.0}
            difference = (rows[column] - rows["measured"]) / rows["uncertainty"]
            panel.plot(rows["along"], difference, **style)
            styles[label] = style
        name_panel(panel, str(name))
        panel.set(ylabel="residual / std. dev.", yscale="symlog")
        is_motion = (rows["along"] % 1.0).any()
        panel.set_xlabel("time of the log (s)" if is_motion else "number")
    legend_below(page, styles)
    set_title(page, "Predictions minus measurements")
    return page
