"""Predictions with intervals: what a robot does within the tolerances of its numbers."""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas

from tetra_drake import __version__
from tetra_drake.engines.engine import engine_of
from tetra_drake.engines.simulate import Outcome, simulate_many
from tetra_drake.errors import InputError, SimulationFailure, check_type, check_whole
from tetra_drake.figures.style import (
    OKABE_ITO,
    Drawn,
    figure_function,
    folded,
    legend_below,
    line_style,
    name_panel,
    page_of,
    page_width,
    save_findings,
    titled,
)
from tetra_drake.files import given_path
from tetra_drake.formatting import TextTable, fixed, rounded
from tetra_drake.robot.command import Command, Driver
from tetra_drake.robot.gait import GivenGait, given_gait, with_body
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.disturbances import stream
from tetra_drake.scenario.load import SCENARIO, GivenScenario, given_scenario, save_scenario
from tetra_drake.scenario.metrics import METRICS, UNITS
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.scenario.tolerances import Variate, variates_of
from tetra_drake.settings.quantities import Quantity
from tetra_drake.settings.refusals import hint
from tetra_drake.settings.section import value_at
from tetra_drake.study.equilibrium import EquilibriumStudy, study_equilibrium
from tetra_drake.study.page import write_page
from tetra_drake.study.statistics import json_rows

DRAWS = 200
LOW, HIGH = 0.05, 0.95
"""Ends of a 90 % interval, as quantiles."""
REST = "rest"
"""Name of the share that no tolerance alone explains: curvature, and tolerances that act
together."""
STILL = 1e-9
"""Spread, relative to the size of a quantity, that is a rounding error."""
PAGE, FIGURE = "predict.html", "predictions.figure"

_NAMES = 0.2  # largest width of the names, as a share of the page's width

AXES = "x", "y", "z"
OF_NODES = {"load": "N", "anchor_x": "N", "anchor_y": "N", "anchor_z": "N"}
OF_CABLES = {"tension": "N", "length": "m", "free_length": "m", "force_density": "N/m"}
FREQUENCY = "frequency"

Measure = str | Callable[[Any], float]
"""Name of a quantity, or a function of an EquilibriumStudy or a SimulationResult."""


@dataclass(frozen=True)
class Predictions:
    """Results of predict(): medians and intervals of quantities, and which tolerance makes how much
    of them."""

    scenario: Scenario = field(repr=False)
    seed: int
    quantities: pandas.DataFrame
    """A row per quantity in SI: nominal (with the scenario's own numbers), median, ends low and
    high of the 90 % interval, unit, and number of draws that have the quantity."""
    shares: pandas.DataFrame
    """A row per quantity: the share of its variance by each tolerance, and the rest. NaN where the
    draws are too few, or the quantity does not vary."""
    draws: pandas.DataFrame = field(repr=False)
    """A row per draw: the quantities in SI, and failure, a reason or empty."""
    wall_time: float
    """Wall time in s."""

    def __str__(self) -> str:
        tables = [self.about, self.table.text(), self.table_of_shares.text()]
        return "\n".join([*tables, *(f"note: {note}" for note in self.notes)])

    @property
    def about(self) -> str:
        """How the predictions were made, in a sentence or two."""
        tolerances = self.scenario.all_tolerances
        assumed = sum(each.source == "assumed" for each in tolerances.values())
        return (
            f"Predictions of {self.scenario.name} in {len(self.draws)} draws within "
            f"{len(tolerances)} tolerances, {assumed} of them assumed; seed {self.seed}, "
            f"{self.wall_time:.1f} s."
        )

    @property
    def notes(self) -> list[str]:
        """Draws that have no result with their most frequent reason, and quantities that are not in
        every draw."""
        failures = Counter(self.draws["failure"][self.draws["failure"] != ""])
        failed, count = failures.total(), len(self.draws)
        notes = []
        if failed:
            reason = failures.most_common(1)[0][0]
            notes.append(f"{failed} of {count} draws have no result and are left out: {reason}")
        for name, row in self.quantities.iterrows():
            if lacking := count - failed - int(row["draws"]):
                notes.append(f"{lacking} of {count} draws have no {name}")
        if self.shares.isna().all(axis=None):
            notes.append("the shares need more draws, or quantities that vary")
        return notes

    @property
    def table(self) -> TextTable:
        """Table of the medians and intervals, beside the values without tolerances."""
        rows = [
            [str(name), interval_text(row), rounded(row["nominal"], 4), row["unit"] or "1"]
            for name, row in self.quantities.iterrows()
        ]
        headings = ["quantity", "median, 90 % interval", "nominal", "unit"]
        return TextTable(headings, rows, text_columns=(0, 3))

    @property
    def table_of_shares(self) -> TextTable:
        """Table of the shares of each tolerance in the variance of the quantities."""
        tolerances = self.scenario.all_tolerances
        rows = []
        for key, shares in self.shares.T.iterrows():
            known = tolerances.get(str(key))
            size = f"± {known.size} {known.law}" if known else ""
            rows.append([str(key), size, *(fixed(100.0 * share, 0) for share in shares)])
        headings = ["share of the variance (%)", "tolerance", *map(str, self.shares.index)]
        return TextTable(headings, rows, text_columns=(0, 1))


def interval_text(row: pandas.Series) -> str:
    """Median and 90 % interval of a row of Predictions.quantities, as text with two digits of the
    width."""
    median, low, high = row["median"], row["low"], row["high"]
    width = high - low
    if not width > STILL * abs(median):
        return rounded(median, 4)
    digits = max(0, 1 - math.floor(math.log10(width)))
    return f"{fixed(median, digits)} ({fixed(low, digits)} to {fixed(high, digits)})"


def predict(
    scenario: GivenScenario,
    quantities: Sequence[str] | Mapping[str, Measure],
    *,
    gait: GivenGait | None = None,
    command: Command | None = None,
    draws: int = DRAWS,
    seed: int = 0,
    workers: int | None = None,
    out: str | Path | None = None,
) -> Predictions:
    """Predicts quantities of a robot with intervals, from the tolerances of its numbers.

        >>> known = {"robot.cables.side.stiffness": "2 %", "robot.nodes": "1 mm"}
        >>> scenario = td.load_scenario("prism").with_changes({"tolerances": known})
        >>> predictions = td.predict(scenario, ["frequency 1", "n3 z", "tension side"], draws=20)
        >>> median, shares = predictions.quantities["median"], predictions.shares

    A draw is the robot with other numbers, each at random within its tolerance. Draws are
    stratified (a Latin hypercube). The share of a tolerance is from a linear regression of the
    quantity on the errors of the draws; what remains is the rest.

    Args:
        scenario: a scenario, its name or file, or a run.
        quantities: names; or measures by names of your choice. A measure is a name, or a function
            to a number from the SimulationResult of a draw if there is a gait or a command, with
            its trajectory; else from its EquilibriumStudy. Names: a metric, such as "speed", of a
            gait or command; "n3 z", a coordinate at rest; "frequency 1"; and a column of the tables
            of study_equilibrium() with a node, a cable or a group of cables, which gives the mean:
            "tension side", "length side n0 n3", "load n0".
        gait: a gait, its file, or a run (its best gait). All draws are simulated side by side.
        command: a command for the actuators in place of a gait.
        draws: number of draws.
        seed: seed of the draws.
        workers: number of threads, see simulate_many().
        out: a folder for the scenario, tables, figure and page.

    Raises:
        InputError: names what cannot be used; also if there are no tolerances, or if the robot has
            no result without errors. Draws without result are counted.
    """
    began = time.perf_counter()
    check_whole("predict", "draws", draws, least=1)
    check_whole("predict", "seed", seed, least=0)
    check_type("predict", "quantities", quantities, Sequence, Mapping)
    given = [quantities] if isinstance(quantities, str) else quantities
    measures = dict(given) if isinstance(given, Mapping) else {name: name for name in given}
    if not measures:
        raise InputError("predict", "quantities", "found none, expected one at least")
    folder = None if out is None else given_path(out, "predict", "out")
    scenario = given_scenario(scenario)
    driver: Driver | None = command
    if gait is not None:
        if command is not None:
            raise InputError("predict", "command", "excludes a gait")
        scenario, driver = with_body(scenario, given_gait(gait, scenario))
    if driver is not None and not engine_of(scenario).has_threads:
        scenario = scenario.on_engine("compiled")
    variates = variates_of(scenario.model_dump(), scenario.all_tolerances)
    if not variates:
        expected = "expected the tolerance of a number, such as robot.masses: 2 %"
        raise InputError(f"scenario {scenario.name}", "tolerances", f"found none, {expected}")
    nominal = _values_of(_outcomes([scenario], measures, driver, workers)[0], measures)

    errors = errors_of(variates, seed, draws)
    drawn = _drawn(scenario, variates, errors)
    ready = [each for each in drawn if isinstance(each, Scenario)]
    outcomes = iter(_outcomes(ready, measures, driver, workers))
    found = [next(outcomes) if isinstance(each, Scenario) else each for each in drawn]
    failures, numbers = [], np.full((draws, len(measures)), math.nan)
    for row, each in zip(numbers, found, strict=True):
        try:
            row[:] = _values_of(each, measures)
            failures.append("")
        except (InputError, SimulationFailure) as error:
            failures.append(str(error))
    predictions = Predictions(
        scenario=scenario,
        seed=seed,
        quantities=_table(measures, nominal, numbers),
        shares=pandas.DataFrame(
            [shares_of(variates, errors, column) for column in numbers.T], index=list(measures)
        ),
        draws=pandas.DataFrame(numbers, columns=list(measures)).assign(failure=failures),
        wall_time=time.perf_counter() - began,
    )
    if folder is not None:
        save_predictions(predictions, folder)
    return predictions


def errors_of(variates: Sequence[Variate], seed: int, draws: int) -> np.ndarray:
    """Errors (draws, variates), stratified: each of `draws` equally likely ranges of an error has
    one draw. An error's numbers do not depend on the other variates."""
    columns = []
    for variate in variates:
        generator = stream([seed], variate.tolerance, *variate.deviations)
        places = generator.permutation(draws) + generator.random(draws)
        columns.append(variate.errors(places / draws))
    return np.column_stack(columns)


def _drawn(
    scenario: Scenario, variates: Sequence[Variate], errors: np.ndarray
) -> list[Scenario | InputError]:
    """The scenario with the errors (draws, variates) of each draw; an error where the scenario does
    not allow the numbers."""
    robot = scenario.robot.model_copy(update={"tolerances": {}})
    bare = scenario.with_sections(robot=robot, tolerances={}, evolve={}, disturbances=None)
    keys = [key for variate in variates for key in variate.deviations]
    lists = Counter(key.rpartition("[")[0] for key in keys if ".factors." in key)
    alike = {key: [1.0] * count for key, count in lists.items()}
    bare = bare.with_changes(
        {key: ones for key, ones in alike.items() if value_at(bare.model_dump(), key) is None}
    )
    tree, drawn = bare.model_dump(), list[Scenario | InputError]()
    is_held = bool(tree["robot"].get("anchors"))
    nodes = {} if is_held else tree["robot"].get("nodes", {})
    heights = {f"robot.nodes.{node}[2]": place[2] for node, place in nodes.items()}
    for draw in errors:
        numbers = {key: value_at(tree, key) for key in keys}
        for variate, error in zip(variates, draw.tolist(), strict=True):
            for key, deviation in variate.deviations.items():
                changed = numbers[key] + error * deviation
                unit = getattr(numbers[key], "unit", None)
                numbers[key] = Quantity(changed, unit) if unit else changed
        if falls := [value_at(tree, key) - numbers[key] for key in keys if key in heights]:
            up = max(0.0, *falls)  # the ground refuses nodes below it
            numbers |= {key: Quantity(numbers.get(key, z) + up, "m") for key, z in heights.items()}
        try:
            drawn.append(bare.with_changes(numbers))
        except InputError as error:
            drawn.append(error)
    return drawn


def _outcomes(
    scenarios: Sequence[Scenario],
    measures: Mapping[str, Measure],
    driver: Driver | None,
    workers: int | None,
) -> list[_Outcomes | InputError]:
    """Equilibrium and motion of each scenario, as far as the measures need them."""
    is_still = any(not _is_of_motion(each, driver) for each in measures.values())
    found: list[_Outcomes | InputError] = []
    for each in scenarios:
        try:
            robot = Robot.of(each, at_rest=driver is None)
            found.append(_Outcomes(each, study_equilibrium(robot) if is_still else None))
        except InputError as error:
            found.append(error)
    if driver is not None:
        able = [each for each in found if isinstance(each, _Outcomes)]
        record = any(callable(each) for each in measures.values())
        moving, drivers = [each.scenario for each in able], [driver] * len(able)
        moved = simulate_many(moving, drivers, record=record, workers=workers)
        for one, outcome in zip(able, moved, strict=True):
            one.motion = outcome
    return found


def _is_of_motion(measure: Measure, driver: Driver | None) -> bool:
    return measure in METRICS if isinstance(measure, str) else driver is not None


def _values_of(outcomes: _Outcomes | InputError, measures: Mapping[str, Measure]) -> list[float]:
    """Values of the measures; NaN for what is not finite. Raises InputError or SimulationFailure if
    there is no result."""
    if isinstance(outcomes, InputError):
        raise outcomes
    values = [outcomes.value(each) for each in measures.values()]
    return [value if math.isfinite(value) else math.nan for value in values]


@dataclass
class _Outcomes:
    """Equilibrium and motion of one draw, as far as they are needed."""

    scenario: Scenario
    study: EquilibriumStudy | None
    motion: Outcome | None = None

    def value(self, measure: Measure) -> float:
        """Value of a measure in SI. Raises InputError for an unknown name, and the failure of a
        simulation."""
        if isinstance(self.motion, SimulationFailure):
            raise self.motion
        if not isinstance(measure, str):
            return float(measure(self.motion or self.study))
        if measure not in METRICS:
            assert self.study is not None
            return value_at_rest(self.study, measure)
        if self.motion is None:
            problem = "is a metric of a motion, expected a gait or a command with it"
            raise InputError("predict", f"quantities.{measure}", problem)
        return float(getattr(self.motion.metrics, measure))


def value_at_rest(study: EquilibriumStudy, name: str) -> float:
    """Value of a quantity at rest in SI, such as "n3 z", "frequency 1", "tension side n0 n3", or
    "tension side" for the mean of a group. NaN for a frequency that the robot lacks. Raises
    InputError for an unknown name."""
    node, _, axis = name.rpartition(" ")
    column, _, row = name.partition(" ")
    if column == FREQUENCY and row.isdecimal() and int(row) > 0:
        frequencies = study.frequencies
        return float(frequencies[int(row) - 1]) if int(row) <= len(frequencies) else math.nan
    if axis in AXES and node in study.nodes.index:
        return float(study.nodes.loc[node, axis])
    if column in OF_NODES and row in study.nodes.index:
        return float(study.nodes.loc[row, column])
    if column in OF_CABLES and row in study.cables.index:
        return float(study.cables.loc[row, column])
    groups = study.cables["group"]
    if column in OF_CABLES and row in groups.to_numpy():
        return float(study.cables[column][groups == row].mean())
    known = [
        *METRICS,
        f"{FREQUENCY} 1",
        *(f"{one} {axis}" for one in study.nodes.index for axis in AXES),
    ]
    known += [f"{one} {node}" for one in OF_NODES for node in study.nodes.index]
    rows = [*groups.unique(), *study.cables.index]
    known += [f"{one} {cable}" for one in OF_CABLES for cable in rows]
    raise InputError("predict", f"quantities.{name}", f"is unknown; {hint(name, known)}")


def _unit(measure: Measure) -> str:
    """SI unit of a measure; "" for a number without unit, and for a function."""
    if not isinstance(measure, str):
        return ""
    column = measure.partition(" ")[0]
    units = UNITS | OF_NODES | OF_CABLES | {FREQUENCY: "Hz"}
    return units.get(column, "m")


def _table(
    measures: Mapping[str, Measure], nominal: Sequence[float], numbers: np.ndarray
) -> pandas.DataFrame:
    """Predictions.quantities, from the values without errors and in the draws (draws, measures)."""
    columns = pandas.DataFrame(numbers, columns=list(measures))
    table = pandas.DataFrame({"nominal": nominal}, index=list(measures))
    for name, share in (("median", 0.5), ("low", LOW), ("high", HIGH)):
        table[name] = columns.quantile(share)
    units = [_unit(each) for each in measures.values()]
    return table.assign(unit=units, draws=columns.count())


def shares_of(
    variates: Sequence[Variate], errors: np.ndarray, values: np.ndarray
) -> dict[str, float]:
    """Shares of tolerances in the variance of a quantity, from a linear regression of its values
    (draws,) on the errors (draws, variates), which have the variance 1.

    What the variance of the residuals adds to a squared coefficient is subtracted from it. NaN
    where the draws are too few, or the values do not vary.
    """
    keys = [*dict.fromkeys(variate.tolerance for variate in variates), REST]
    has = np.isfinite(values)
    regressors, values = np.insert(errors[has], 0, 1.0, axis=1), values[has]
    free = len(values) - regressors.shape[1]
    if free < 1 or np.ptp(values) <= STILL * np.abs(values).max():
        return dict.fromkeys(keys, math.nan)
    inverse = np.linalg.pinv(regressors)
    coefficients = inverse @ values
    residual = float(((values - regressors @ coefficients) ** 2).sum()) / free
    squares = coefficients**2 - residual * (inverse**2).sum(axis=1)
    parts = dict.fromkeys(keys, 0.0)
    for variate, square in zip(variates, squares[1:].tolist(), strict=True):
        parts[variate.tolerance] += square
    parts = {key: max(0.0, part) for key, part in parts.items()} | {REST: residual}
    return {key: part / sum(parts.values()) for key, part in parts.items()}


def save_predictions(predictions: Predictions, folder: Path) -> list[str]:
    """Writes the scenario, tables, the figure, and a page in Markdown and HTML to a folder. Returns
    the names of the files. Raises InputError if one cannot be written."""
    save_scenario(folder, predictions.scenario)
    tables = {
        "predictions": predictions.quantities.reset_index(names="quantity"),
        "shares": predictions.shares.reset_index(names="quantity"),
        "draws": predictions.draws,
    }
    summary = {
        "scenario": predictions.scenario.name,
        "version": __version__,
        "seed": predictions.seed,
        "draws": len(predictions.draws),
        "failed": int((predictions.draws["failure"] != "").sum()),
        "tolerances": {
            key: each.model_dump() for key, each in predictions.scenario.all_tolerances.items()
        },
        "quantities": json_rows(tables["predictions"].set_index("quantity")),
        "notes": predictions.notes,
        "wall_time_s": predictions.wall_time,
    }
    figure = predictions_figure(predictions)
    written = save_findings(figure, folder, FIGURE, tables=tables, summary=summary)
    shares = (
        "Each interval holds 90 % of the draws. The share of a tolerance in the variance of a "
        "quantity is from a linear regression over the draws; the rest is curvature and what "
        "tolerances do together."
    )
    pages = write_page(
        folder,
        PAGE,
        title=f"Predictions of {predictions.scenario.name}",
        about=f"{predictions.about} {shares}",
        table=predictions.table,
        notes=predictions.notes,
        figure=FIGURE,
        caption="intervals, and the share of each tolerance",
        second=predictions.table_of_shares,
        content="has the numbers and their tolerances",
    )
    return [*pages, SCENARIO, *written]


@figure_function
def predictions_figure(predictions: Predictions) -> Drawn:
    """Intervals of predicted quantities, and the shares of tolerances.

    Left: the median and the 90 % interval, relative to the nominal value; numbers are in SI. Where
    an interval is wider than the nominal value is large, its width is the unit. Right: the share of
    each tolerance in the variance.
    """
    table, shares = predictions.quantities.iloc[::-1], predictions.shares.iloc[::-1]
    places, width = np.arange(len(table)), _NAMES * page_width()
    page = page_of(height_in=0.5 * len(table) + 1.6)
    left, right = page.subplots(1, 2, sharey=True, width_ratios=(3, 2))
    size = np.maximum(table["nominal"].abs(), table["high"] - table["low"])
    scale = 100.0 / size.where(size > 0.0, 1.0)
    ends = {end: (table[end] - table["nominal"]) * scale for end in ("low", "median", "high")}
    left.axvline(0.0, color="black", linewidth=0.8)
    left.hlines(places, ends["low"], ends["high"], color=OKABE_ITO["sky_blue"], linewidth=5.0)
    left.plot(ends["median"], places, "o", color=OKABE_ITO["blue"])
    for place, (_, row) in zip(places, table.iterrows(), strict=True):
        text = f"{interval_text(row)} {row['unit']}".rstrip()
        left.annotate(
            text,
            (0.02, place),
            xycoords=("axes fraction", "data"),
            xytext=(0, 5),
            textcoords="offset points",
            fontsize="small",
        )
    name_panel(left, "median and 90 % interval")
    left.set(xlabel="difference from nominal (%)", ylim=(-0.6, len(table) - 0.2))
    left.set_yticks(places, [folded(str(name), width) for name in table.index])
    begin, styles = np.zeros(len(table)), {}
    for series, key in enumerate(shares):
        color = "0.8" if key == REST else line_style(series)["color"]
        part = 100.0 * shares[key].fillna(0.0).to_numpy()
        right.barh(places, part, left=begin, height=0.5, color=color)
        begin, styles[str(key)] = begin + part, {"color": color, "linewidth": 5.0}
    name_panel(right, "share of the variance")
    right.set(xlabel="share (%)", xlim=(0.0, 100.0))
    for panel in (left, right):
        panel.grid(visible=False, axis="y")
    legend_below(page, styles)
    return titled(page, f"Predictions of {predictions.scenario.name}")
