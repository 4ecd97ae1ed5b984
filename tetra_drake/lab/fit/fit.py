"""Fit of a scenario's values to measurements: bounded least squares, with page and figure."""

from __future__ import annotations

import hashlib
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas
from matplotlib.ticker import StrMethodFormatter

from tetra_drake import __version__
from tetra_drake.errors import InputError, check_type
from tetra_drake.figures.style import (
    Drawn,
    figure_function,
    legend_below,
    line_style,
    name_panel,
    page_of,
    titled,
)
from tetra_drake.files import check_folder, given_path, read_bytes
from tetra_drake.formatting import Say, TextTable, fixed, listed, rounded, silent
from tetra_drake.lab.fit.measurements import FitFile, Measurement, files_of
from tetra_drake.lab.fit.placement import unknowns_of
from tetra_drake.lab.fit.problem import KEPT_EVALUATIONS, STEP, Bounds, FitProblem, parameter_of
from tetra_drake.lab.page import save_findings, write_page
from tetra_drake.optimizers.cma_es import Box, Search
from tetra_drake.scenario.load import SCENARIO, GivenScenario, given_scenario, save_scenario
from tetra_drake.scenario.scenario import Scenario

LONGER, ROUGH = 10.0, 0.2
"""Test of smooth predictions: factor of a longer step, and difference of the derivatives with both
steps, as a share of the derivative, from which a prediction is rough. Contacts that come and go
make predictions of long motion rough: the search may end in any of many minima, and intervals from
derivatives mean nothing."""
TOLERANCE = 1e-4
"""Relative change of parameters at which the fit ends: a tenth of STEP. A smooth fit is far more
exact by then, because its steps shrink quadratically."""
NEGLIGIBLE = 0.01
"""Change of the sum of squares at which the fit ends; 1 is a standard deviation."""
POPULATION, MOST = 16, 480
"""Evaluations per iteration of a global search, which fill the compiled engine on two cores; and
largest number of evaluations of the search."""
WIDTH_95 = 1.96
"""Half width of a 95 % interval in standard deviations."""
SAME_DIRECTION = 1e-10
"""Singular value, as a share of the greatest, below which the data do not determine a direction of
the parameters."""
LIKELY = 3.0
"""Excess of the misfit over 1, in standard deviations, up to which a fit explains the data."""
FAR, OUTLYING = 4.0, 16.0
"""Limits above which there are no intervals, as something is wrong: the misfit, with the same
excess, and the mean square of the weighted residuals of one coordinate or another number."""
STRONG = 0.95
"""Correlation above which a warning names two parameters."""

PAGE, FIGURE = "fit.html", "residuals.figure"

MANY = 100
"""Number of points in a panel of the figure from which on they are drawn small."""
POINTS = 2000
"""Largest number of points in a panel of the figure. If there are more, a random selection is
shown."""

NAMES = 24
"""Largest number of names on an axis of the figure. If there are more, only some are written."""

WRONG = (
    "the misfit of {misfit:.3g}, with residuals up to {largest}, allows no intervals: the model, a "
    "number or unit, or the clock, frame or a marker of a log is wrong (give it clock, origin and "
    "turn, or marker_offset), or an uncertainty is too small"
)
UNKNOWN = """`± ?` is an unknown interval: the data do not determine the value, the misfit is far
above 1, or predictions are not smooth. Then their derivatives by steps of 0.1 % and 1 % of the
start differ by more than 20 %. One contact that comes or goes, in any part of a log, is enough:
without this part, or with other noise, there may be an interval."""


@dataclass(frozen=True)
class Fit:
    """Fitted values of scenario keys, with intervals, residuals and warnings."""

    scenario: Scenario = field(repr=False)
    """The scenario with the fitted values."""
    parameters: pandas.DataFrame
    """A row per key in SI: value, its 95 % interval low and high (NaN if unknown), start, bounds
    least and most, unit, prior (standard deviation of its tolerance, infinite without one), whether
    the data and the tolerance determine it, and whether predictions are smooth in it."""
    correlations: pandas.DataFrame = field(repr=False)
    """Correlations of the parameters, by keys."""
    residuals: pandas.DataFrame = field(repr=False)
    """A row per measured number in SI: measurement, label, along (time in s, or number), measured,
    uncertainty, start and fitted: what the scenario predicts with the start and the fitted values.
    """
    clock_offsets: dict[str, float]
    """Time (s) by which the clock of each measurement is ahead of the simulated time."""
    placement: dict[str, Sequence[str]]
    """What was found besides for each measurement: frame and offsets of markers."""
    misfit: float
    """Sum of squares of the weighted residuals per degree of freedom; 1 if the model and the
    uncertainties are right."""
    start_misfit: float
    """The same as `misfit`, with the start values."""
    warnings: list[str]
    evaluations: int
    """Number of scenarios that were simulated for all measurements."""
    wall_time: float
    """Wall time in s."""

    def __str__(self) -> str:
        lines = [
            f"fit of {len(self.parameters)} values to {len(self.residuals)} numbers in "
            f"{self.evaluations} evaluations, {self.wall_time:.1f} s; misfit "
            f"{self.start_misfit:.3g} at the start, {self.misfit:.3g} fitted",
            self.table.text(),
        ]
        return "\n".join([*lines, *(f"note: {note}" for note in self.notes)])

    @property
    def notes(self) -> list[str]:
        """Warnings as sentences, and what was found for logs, such as a clock that is ahead of the
        simulated time."""
        offsets = {name: 1e3 * offset for name, offset in self.clock_offsets.items() if offset}
        clocks = [f"the clock of {name} is ahead by {ms:.2f} ms" for name, ms in offsets.items()]
        placed = [f"{name}: {note}" for name, notes in self.placement.items() for note in notes]
        return [*self.warnings, *clocks, *placed]

    @property
    def table(self) -> TextTable:
        """Table of the fitted values and their intervals, beside the start values."""
        rows = []
        for key, row in self.parameters.iterrows():
            value, half = row["value"], row["high"] - row["value"]
            text = f"{rounded(value)} ± ?"
            if half > 0.0:
                digits = max(0, 1 - math.floor(math.log10(half)))  # two of the half width
                text = f"{fixed(value, digits)} ± {fixed(half, digits)}"
            rows.append([str(key), text, rounded(row["start"]), row["unit"] or "1"])
        return TextTable(
            ["key", "value, 95 % interval", "start", "unit"], rows, text_columns=(0, 3)
        )


def fit(
    scenario: GivenScenario,
    measurements: Sequence[Measurement],
    parameters: Mapping[str, Bounds],
    *,
    search: bool = False,
    out: str | Path | None = None,
    say: Say = silent,
    source: object = "fit",
) -> Fit:
    """Fits values of a scenario to measurements of a robot, by bounded least squares.

        >>> scenario = td.load_scenario("prism")
        >>> heights = td.Rest(positions={"n3 z": "0.172 m", "n4 z": "0.172 m"})
        >>> bounds = {"robot.cables.side.stiffness": ("50 N/m", "200 N/m")}
        >>> fit = td.fit(scenario, [heights], bounds)
        >>> stiffer = fit.scenario

    Residuals are weighted by the uncertainties of the measurements. Their derivatives by the
    parameters are finite differences of scenarios that are simulated side by side. The 95 %
    intervals of the values follow from the derivatives.

    Args:
        scenario: a scenario, its name or file, or a run. Its values are the start.
        measurements: values of the kinds td.MotionCapture and td.Rest.
        parameters: the bounds, least and most, by scenario key. Texts have units; numbers are SI.
            Keys joined by commas get the same value.
        search: before least squares, searches all values within the bounds for a better start, by
            CMA-ES; for data that several minima may fit.
        out: a folder for the fitted scenario, tables, figure and page. It also keeps each
            evaluation, so that an interrupted fit goes on where it was.
        say: function that gets a line of text after each iteration.
        source: file with the parameters, for errors.

    Raises:
        InputError: names what cannot be used.
    """
    from scipy.optimize import least_squares

    began = time.perf_counter()
    check_type("fit", "say", say, Callable)
    folder = None if out is None else given_path(out, "fit", "out")
    if folder is not None:
        check_folder(folder)
        if (folder / SCENARIO).exists() and not (folder / KEPT_EVALUATIONS).exists():
            raise InputError(folder, "", f"has a {SCENARIO} of something else, expected a folder")
    given = FitFile.from_tree({"parameters": parameters, "measurements": measurements}, source)
    problem = _problem(given_scenario(scenario), given, folder, say, source)
    if not np.isfinite(problem.residuals(problem.start)).all():
        what = "is not simulated, or lacks equilibrium or frequencies, with the start values"
        raise InputError(problem.scenario.name, "", what)

    solution = least_squares(
        problem.residuals,
        _searched(problem) if search else problem.start,
        jac=problem.jacobian,
        bounds=problem.bounds,
        x_scale="jac",
        ftol=2.0 * NEGLIGIBLE / problem.values.size,
        xtol=TOLERANCE,
        gtol=np.finfo(float).eps,  # without it, no influence and no residual give NaN
    )
    fitted = unknowns_of(solution, "parameters")
    found = _result(problem, fitted, time.perf_counter() - began)
    if folder is not None:
        save_fit(found, folder)
    return found


def _problem(
    scenario: Scenario, given: FitFile, folder: Path | None, say: Say, source: object
) -> FitProblem:
    """The problem of a fit. Another fit to the same data reads the predictions of each simulated
    point in the `folder` in place of a simulation. Raises InputError, naming `source` or a
    measurement, if something cannot be used."""
    fitted = [parameter_of(scenario, key, each, source) for key, each in given.parameters.items()]
    measured = [
        each.read(scenario, f"measurement {number}")
        for number, each in enumerate(given.measurements, start=1)
    ]
    numbers = sum(len(each.numbers) for each in measured)
    if numbers < sum(math.isinf(each.prior) for each in fitted):
        found = f"found {len(fitted)} keys and {numbers} measured numbers"
        expected = "expected at least a number, or a tolerance, for each key"
        raise InputError(source, "parameters", f"{found}, {expected}")
    digest = hashlib.sha256(f"{__version__} {scenario.values()}".encode())
    for measurement in given.measurements:
        files = files_of(measurement)
        settings = measurement.model_dump(exclude=set(files))
        digest.update(f"{type(measurement).tag} {settings}".encode())
        for key, path in files.items():
            digest.update(key.encode() + read_bytes(path, key))
    return FitProblem(scenario, fitted, measured, digest.hexdigest(), folder, say)


def _searched(problem: FitProblem) -> np.ndarray:
    """Best point (n,) of a global search within the bounds, by CMA-ES, for the least sum of squares
    of residuals. The search ends when it has converged roughly; least squares refine its point."""
    (low, high), start = problem.bounds, problem.start
    origin = (start - low) / (high - low)
    search = Search(POPULATION, Box(start.size), np.random.default_rng(0), origin)
    while not search.restarts and search.evaluations < MOST:
        shares = search.draw()
        search.learn(shares, -problem.sums_of_squares(low + shares * (high - low)))
        problem.tell(problem.residuals_at(low + search.best_point * (high - low)))
    points = np.array([start, low + search.best_point * (high - low)])
    return points[np.argmin(problem.sums_of_squares(points))]


def _result(problem: FitProblem, x: np.ndarray, wall_time: float) -> Fit:
    """Result of a fit that ended at the solution `x` (n,), with intervals and warnings. The point
    is in the dimensionless parameters of FitProblem; `wall_time` is in s."""
    first, last = problem.residuals(problem.start), problem.residuals(x)
    misfit, jacobian = problem.misfit(last), problem.jacobian(x)
    half, correlation = _uncertainty(problem, jacobian, misfit)
    difference = np.linalg.norm(problem.jacobian(x, LONGER * STEP) - jacobian, axis=0)
    size = np.linalg.norm(jacobian, axis=0)
    smooth = difference / np.where(size > 0.0, size, 1.0) < ROUGH
    determined = np.isfinite(half)
    excess = LIKELY * math.sqrt(2.0 / max(1, last.size - x.size))
    labels = problem.numbers["label"] + " of " + problem.numbers["measurement"]
    squares = pandas.Series(last[: len(labels)] ** 2).groupby(labels).mean()
    is_wrong = misfit > FAR + excess or squares.max() > OUTLYING
    known = determined & (smooth | ~determined).all() & (not is_wrong)

    values, width = x * problem.scale, np.where(known, half, np.nan)
    given = pandas.DataFrame(problem.parameters).set_index("key")
    ends = {"value": values, "low": values - width, "high": values + width}
    table = pandas.DataFrame(ends, given.index).join(given)
    table = table.assign(determined=determined, smooth=smooth)
    correlations = pandas.DataFrame(correlation, index=given.index, columns=given.index)
    weighted = [each[: problem.values.size] for each in (first, last)]  # without tolerances
    predicted = [problem.values + problem.uncertainty * each for each in weighted]
    warnings = _warnings(table, correlations, explained=misfit <= 1.0 + excess)
    if is_wrong:
        largest = f"{math.sqrt(squares.max()):.3g} standard deviations for {squares.idxmax()}"
        warnings.insert(0, WRONG.format(misfit=misfit, largest=largest))
    again = problem.predictions(x)
    return Fit(
        scenario=problem.scenario_at(x),
        parameters=table,
        correlations=correlations,
        residuals=problem.numbers.assign(start=predicted[0], fitted=predicted[1]),
        clock_offsets={name: each.clock_offset for name, each in again.items()},
        placement={name: each.notes for name, each in again.items()},
        misfit=misfit,
        start_misfit=problem.misfit(first),
        warnings=warnings,
        evaluations=problem.evaluations,
        wall_time=wall_time,
    )


def _uncertainty(
    problem: FitProblem, jacobian: np.ndarray, misfit: float
) -> tuple[np.ndarray, np.ndarray]:
    """Half widths (n,) of the 95 % intervals of the n fitted values in SI, infinite if an interval
    is wider than the bounds; and correlations (n, n) of the values.

    `jacobian` (numbers, n) is FitProblem.jacobian() at the fitted point, `misfit` the sum of
    squares of the weighted residuals per degree of freedom. Where it exceeds 1, the intervals are
    wider by its root.
    """
    width = problem.bounds[1] - problem.bounds[0]
    _, singular, rows = np.linalg.svd(jacobian * width, full_matrices=False)
    told = singular > SAME_DIRECTION * singular.max(initial=np.finfo(float).tiny)
    weak = (rows[~told] ** 2).sum(axis=0) > SAME_DIRECTION
    directions = rows[told] / singular[told, np.newaxis]
    covariance = directions.T @ directions
    deviation = np.sqrt(covariance.diagonal())
    share = WIDTH_95 * math.sqrt(max(1.0, misfit)) * deviation
    half = np.where(weak | (share > 0.5), math.inf, share * width * problem.scale)
    spread = np.where(deviation > 0.0, deviation, 1.0)
    return half, covariance / np.outer(spread, spread)


def _warnings(
    table: pandas.DataFrame, correlations: pandas.DataFrame, *, explained: bool
) -> list[str]:
    """Warnings about a fit: values that the data do not determine, that are at a bound, that cannot
    be told apart, or whose predictions are not smooth.

    `table` and `correlations` are Fit.parameters and Fit.correlations. `explained` is True if the
    residuals are as small as the uncertainties of the measurements.
    """
    warnings = []
    for key, row in table.iterrows():
        value, width = row["value"], row["most"] - row["least"]
        if not row["determined"]:
            warnings.append(f"the data do not determine {key}: the bounds are all that is known")
        elif min(value - row["least"], row["most"] - value) < STEP * width:
            warnings.append(f"{key} is at a bound, {rounded(value)} {row['unit']}".rstrip())
    determined = table.index[table["determined"]]
    for place, one in enumerate(determined):
        strength = correlations.loc[one, determined[place + 1 :]].abs()
        if others := strength.index[strength > STRONG].tolist():
            warnings.append(f"the data hardly tell {one} from {listed(others)}")
    rough = [str(key) for key in determined if not table["smooth"][key]]
    if rough:
        problem = f"the predictions are not smooth in {listed(rough)}, so intervals are unknown"
        better = "a search of all values, a shorter motion, or a larger uncertainty may help"
        meaning = "the values explain the data" if explained else f"better ones may exist; {better}"
        warnings.append(f"{problem}; {meaning}")
    return warnings


def save_fit(fit: Fit, folder: Path) -> None:
    """Writes the scenario with the fitted values, tables, the figure of the residuals, and a page
    in Markdown and HTML to a folder. Raises InputError if a file cannot be written."""
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
        "placement": fit.placement,
        "warnings": fit.warnings,
        "evaluations": fit.evaluations,
        "wall_time_s": fit.wall_time,
    }
    save_findings(residuals(fit), folder, FIGURE, tables=tables, summary=summary)
    rows = [[str(key), *map(fixed, row)] for key, *row in fit.correlations.itertuples()]
    correlations = TextTable(["correlation", *map(str, fit.correlations)], rows)
    about = (
        f"{len(fit.residuals)} measured numbers, {fit.evaluations} evaluations, "
        f"{fit.wall_time:.0f} s. Sum of squared residuals per degree of freedom, in units of "
        f"the stated uncertainty: {fit.start_misfit:.3g} with the start values, "
        f"{fit.misfit:.3g} fitted; 1 is a model that is right. Intervals are of 95 %, "
        "from the derivatives at the fitted values. Where the misfit exceeds 1, they are wider "
        "by its root; far above 1 there are none. The tolerance of a value counts as a measurement."
    )
    unknown = UNKNOWN.replace("\n", " ") if fit.parameters["low"].isna().any() else ""
    write_page(
        folder,
        PAGE,
        title=f"Fit of {fit.scenario.name}",
        about=about,
        table=fit.table,
        notes=fit.notes,
        unknown=unknown,
        figure=FIGURE,
        caption="predictions minus measurements",
        second=correlations,
        content="has the fitted values",
    )


@figure_function
def residuals(fit: Fit) -> Drawn:
    """Residuals of a fit over time, or by the name of the measured value, in standard deviations of
    the measurements.

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
        drawn = rows.sample(min(len(rows), POINTS), random_state=0)
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
        panel.margins(x=0.03)  # dots at the ends are whole
        if is_motion:
            panel.set_xlabel("time of the log (s)")
        else:
            named = rows.iloc[:: math.ceil(len(rows) / NAMES)]
            panel.set_xticks(named["along"], named["label"], rotation=30, ha="right")
    legend_below(page, styles)
    return titled(page, "Predictions minus measurements")
