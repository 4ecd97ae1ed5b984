"""Predictions with intervals: what a robot does within the tolerances of its numbers."""

from __future__ import annotations

import contextlib
import functools
import math
import re
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import NoneType
from typing import Any

import numpy as np
import pandas

from tetra_drake import __version__
from tetra_drake.engines.engine import engine_of
from tetra_drake.engines.simulate import Outcome, simulate_each
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
    titled,
)
from tetra_drake.files import given_path
from tetra_drake.formatting import TextTable, fixed, rounded
from tetra_drake.lab.page import save_findings, write_page
from tetra_drake.lab.predict.variates import Variate, variates_of
from tetra_drake.lab.study.equilibrium import EquilibriumStudy, study_equilibrium
from tetra_drake.lab.study.statistics import json_rows
from tetra_drake.machine import threads_for
from tetra_drake.robot.command import Command, Driver
from tetra_drake.robot.gait_file import GivenGait, given_gait
from tetra_drake.robot.parameter_space import with_body
from tetra_drake.robot.remarks import yielding_remark
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.disturbances import stream
from tetra_drake.scenario.load import GivenScenario, given_scenario, save_scenario
from tetra_drake.scenario.metrics import METRICS, UNITS
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.settings.quantities import Quantity
from tetra_drake.settings.refusals import hint
from tetra_drake.settings.section import value_at

DRAWS = 200
LOW, HIGH = 0.05, 0.95
"""Ends of a 90 % interval, as quantiles."""
REST = "rest"
"""Name of the share that no tolerance alone explains: curvature, and tolerances that act
together."""
STILL = 1e-9
"""Spread, relative to the size of a quantity, that is a rounding error."""
PAGE, FIGURE = "predict.html", "predictions.figure"
ABOUT = """Each interval holds 90 % of the draws. The share of a tolerance in the variance of a
quantity is from a linear regression over the draws; the rest is curvature and what tolerances do
together.""".replace("\n", " ")

_NAMES = 0.3  # largest width of the names, as a share of the page's width

OF_REST = {"load": "N", "tension": "N", "force_density": "N/m", "frequency": "Hz"}
OF_REST |= {"length": "m", "free_length": "m"} | {f"anchor_{axis}": "N" for axis in "xyz"}
"""Units of quantities at rest, by first words. Others are coordinates."""

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
        """How the predictions were made, in a sentence."""
        tolerances = self.scenario.all_tolerances
        assumed = sum(each.source == "assumed" for each in tolerances.values())
        return (
            f"Predictions of {self.scenario.name} in {len(self.draws)} draws within "
            f"{len(tolerances)} tolerances, {assumed} of them assumed; seed {self.seed}, "
            f"{self.wall_time:.1f} s."
        )

    @functools.cached_property
    def notes(self) -> list[str]:
        """How many draws lack a quantity, with a reason, whether shares are missing, and what gives
        way at rest."""
        count, reasons = len(self.draws), [text for text in self.draws["failure"] if text]
        failed = f"{len(reasons)} of {count} draws have no result and are left out"
        notes = [f"{failed}, the first because: {reasons[0]}"] if reasons else []
        lacking = count - len(reasons) - self.quantities["draws"]
        notes += [f"{n} of {count} draws have no {name}" for name, n in lacking.items() if n]
        if self.shares.isna().all(axis=None):
            notes.append("the shares need more draws, or quantities that vary")
        gives_way = yielding_remark(Robot.of(self.scenario, at_rest=True))
        return [*notes, gives_way] if gives_way else notes

    @property
    def table(self) -> TextTable:
        """Table of the medians and intervals, beside the values without errors."""
        rows = [
            [str(name), interval_text(row), rounded(row["nominal"], 4), row["unit"] or "1"]
            for name, row in self.quantities.iterrows()
        ]
        return TextTable(["quantity", "median, 90 % interval", "nominal", "unit"], rows, (0, 3))

    @property
    def table_of_shares(self) -> TextTable:
        """Table of the shares of the tolerances in the variance of each quantity."""
        rows = [
            [str(key), *(fixed(100.0 * share, 0) for share in shares)]
            for key, shares in self.shares.T.iterrows()
        ]
        return TextTable(["share of the variance (%)", *map(str, self.shares.index)], rows)


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
            its trajectory; else from its EquilibriumStudy. Names with a gait or a command: metrics,
            such as "speed", and names at rest, of the robot without signals. Names at rest: "n3 z",
            a coordinate; "frequency 1"; and a column of the tables of study_equilibrium() with a
            node, a cable or a group of cables, which gives the mean: "tension side", "length side
            n0 n3", "load n0".
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
    check_type("predict", "command", command, Command, NoneType)
    threads = threads_for(workers, source="predict")
    given = [quantities] if isinstance(quantities, str) else quantities
    for name in given:
        check_type("predict", "quantities", name, str)
    measures = dict(given) if isinstance(given, Mapping) else {name: name for name in given}
    if not measures:
        raise InputError("predict", "quantities", "found none, expected one at least")
    for name, measure in measures.items():
        check_type("predict", f"quantities.{name}", measure, str, Callable)
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
    (nominal,) = _values([scenario], measures, driver, threads)
    if isinstance(nominal, Exception):
        raise nominal
    errors = errors_of(variates, seed, draws)
    found = _values(drawn_scenarios(scenario, variates, errors), measures, driver, threads)
    nothing = [math.nan] * len(measures)
    failures = [str(each) if isinstance(each, Exception) else "" for each in found]
    rows = [nothing if isinstance(each, Exception) else each for each in found]
    table = pandas.DataFrame(rows, columns=list(measures))
    results, shares = intervals(variates, errors, table)
    results.insert(0, "nominal", nominal)
    results.insert(4, "unit", [_unit(each) for each in measures.values()])
    predictions = Predictions(
        scenario=scenario,
        seed=seed,
        quantities=results,
        shares=shares,
        draws=table.assign(failure=failures),
        wall_time=time.perf_counter() - began,
    )
    if folder is not None:
        save_predictions(predictions, folder)
    return predictions


def intervals(
    variates: Sequence[Variate], errors: np.ndarray, table: pandas.DataFrame
) -> tuple[pandas.DataFrame, pandas.DataFrame]:
    """Median, low and high of the 90 % interval and number of draws of each quantity, and the share
    of each tolerance in its variance, from a table with a row per draw and a column per quantity.
    `errors` (draws, variates) are the errors of the draws."""
    columns = {}
    for name, share in {"median": 0.5, "low": LOW, "high": HIGH}.items():
        place = (len(table) * share - 0.5) / max(1, len(table) - 1)  # middles of equal ranges
        columns[name] = table.quantile(min(1.0, max(0.0, place)))
    shares = [shares_of(variates, errors, column.to_numpy()) for _, column in table.items()]
    quantities = pandas.DataFrame(columns).assign(draws=table.count())
    return quantities, pandas.DataFrame(shares, index=table.columns)


def errors_of(variates: Sequence[Variate], seed: int, draws: int) -> np.ndarray:
    """Errors (draws, variates), stratified: each of `draws` equally likely ranges of an error has
    one draw. An error's numbers do not depend on the other variates."""
    columns = []
    for variate in variates:
        generator = stream([seed], variate.tolerance, *variate.deviations)
        places = generator.permutation(draws) + generator.random(draws)
        columns.append(variate.errors(places / draws))
    return np.column_stack(columns)


def drawn_scenarios(
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
    nodes = {} if tree["robot"].get("anchors") else tree["robot"].get("nodes", {})
    heights = [f"robot.nodes.{node}[2]" for node in nodes]
    numbers = {key: value_at(tree, key) for key in [*keys, *heights]}
    is_height = np.array([key in heights for key in numbers])
    moves = [[each.deviations.get(key, 0.0) for key in numbers] for each in variates]
    for shift in errors @ np.array(moves):
        shift[is_height] -= shift[is_height].min(initial=0.0)  # the ground refuses nodes below it
        changes: dict[str, float] = {}
        for (key, x), by in zip(numbers.items(), shift.tolist(), strict=True):
            changes[key] = Quantity(x + by, x.unit) if isinstance(x, Quantity) else x + by
        try:
            drawn.append(bare.with_changes(changes))
        except InputError as error:
            drawn.append(error)
    return drawn


def _values(
    scenarios: Sequence[Scenario | InputError],
    measures: Mapping[str, Measure],
    driver: Driver | None,
    threads: int,
) -> list[list[float] | Exception]:
    """Values of the measures for each scenario, NaN if not finite; or why there are none."""
    able = [each for each in scenarios if isinstance(each, Scenario)]
    if driver is None:
        found = iter([_measured(each, None, measures) for each in able])
    else:
        walks, record = [(each, driver) for each in able], any(map(callable, measures.values()))
        with contextlib.closing(simulate_each(walks, record=record, threads=threads)) as outcomes:
            pairs = zip(able, outcomes, strict=True)
            found = iter([_measured(each, outcome, measures) for each, outcome in pairs])
    return [next(found) if isinstance(each, Scenario) else each for each in scenarios]


def _measured(
    scenario: Scenario, outcome: Outcome | InputError | None, measures: Mapping[str, Measure]
) -> list[float] | Exception:
    """Values of the measures for a scenario and the outcome of its simulation, None for a robot at
    rest, NaN if not finite; or why there are none, such as an unknown name."""
    if isinstance(outcome, Exception):
        return outcome
    names = {each for each in measures.values() if isinstance(each, str)}
    known = {} if outcome is None else {name: getattr(outcome.metrics, name) for name in METRICS}
    study = None
    try:
        if outcome is None or not known.keys() >= names:
            study = study_equilibrium(Robot.of(scenario, at_rest=True))
        if study and names:
            known |= values_at_rest(study)
        for name in names - known.keys():
            if not re.fullmatch(r"frequency [1-9]\d*", name):
                what = "needs a gait or a command" if name in METRICS else "is unknown"
                raise InputError("predict", f"quantities.{name}", f"{what}; {hint(name, known)}")
            known[name] = math.nan  # the robot has fewer frequencies
        values = [
            known[each] if isinstance(each, str) else float(each(outcome or study))
            for each in measures.values()
        ]
    except (InputError, SimulationFailure) as error:
        return error
    return [value if math.isfinite(value) else math.nan for value in values]


def values_at_rest(study: EquilibriumStudy) -> dict[str, float]:
    """Numbers of a robot at rest in SI by name, such as "n3 z", "frequency 1", "tension side n0 n3"
    and "tension side" for the mean of the group."""
    nodes, cables = study.nodes.drop(columns="body"), study.cables
    groups = cables.groupby("group").mean()
    tables = nodes.drop(columns=list("xyz")), cables.drop(columns="group"), groups
    values = {f"{node} {axis}": nodes.loc[node, axis] for node in nodes.index for axis in "xyz"}
    for table in tables:
        values |= {f"{name} {row}": table.loc[row, name] for name in table for row in table.index}
    return values | {f"frequency {i}": x for i, x in enumerate(study.frequencies, start=1)}


def _unit(measure: Measure) -> str:
    """SI unit of a measure; "" for a number without unit, and for a function."""
    if not isinstance(measure, str):
        return ""
    return (UNITS | OF_REST).get(measure.partition(" ")[0], "m")


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


def save_predictions(predictions: Predictions, folder: Path) -> None:
    """Writes the scenario, tables, the figure, and a page in Markdown and HTML to a folder. Raises
    InputError if a file cannot be written."""
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
        "quantities": json_rows(predictions.quantities),
        "notes": predictions.notes,
        "wall_time_s": predictions.wall_time,
    }
    figure = predictions_figure(predictions)
    save_findings(figure, folder, FIGURE, tables=tables, summary=summary)
    write_page(
        folder,
        PAGE,
        title=f"Predictions of {predictions.scenario.name}",
        about=f"{predictions.about} {ABOUT}",
        table=predictions.table,
        notes=predictions.notes,
        unknown="",
        figure=FIGURE,
        caption="intervals, and the share of each tolerance",
        second=predictions.table_of_shares,
        content="has the numbers and their tolerances",
    )


@figure_function
def predictions_figure(predictions: Predictions) -> Drawn:
    """Intervals of predicted quantities, and the shares of tolerances.

    Left: the median and the 90 % interval, as differences from the nominal value in percent of it;
    numbers are in SI. An interval ten times as wide as its nominal value is not drawn there. Right:
    the share of each tolerance in the variance.
    """
    table, shares = predictions.quantities.iloc[::-1], predictions.shares.iloc[::-1]
    names = [f"{name}: {interval_text(row)} {row['unit']}" for name, row in table.iterrows()]
    page = page_of(height_in=0.5 * len(table) + 1.6)
    left, right = page.subplots(1, 2, sharey=True)
    size, width = table["nominal"].abs(), table["high"] - table["low"]
    scale = 100.0 / size.where((size > 0.0) & (width < 10.0 * size))
    low, middle, high = (
        (table[end] - table["nominal"]) * scale for end in ("low", "median", "high")
    )
    places, begin, styles = range(len(table)), np.zeros(len(table)), {}
    left.axvline(0.0, color="black", linewidth=0.8)
    left.hlines(places, low, high, color=OKABE_ITO["sky_blue"], linewidth=5.0)
    left.plot(middle, places, "o", color=OKABE_ITO["blue"])
    left.set(xlabel="difference from nominal (%)")
    for place in np.flatnonzero(scale.isna()):
        left.text(0.0, place, " too wide for percent", va="center", fontsize="small")
    left.margins(x=0.05)
    left.set_yticks(places, [folded(name, _NAMES * page_width()) for name in names])
    for series, (key, column) in enumerate(shares.items()):
        color, part = line_style(series)["color"], 100.0 * column.fillna(0.0).to_numpy()
        right.barh(places, part, left=begin, height=0.5, color="0.8" if key == REST else color)
        begin, styles[str(key)] = begin + part, {"color": right.patches[-1].get_facecolor()}
    name_panel(left, "median and 90 % interval")
    name_panel(right, "share of the variance")
    right.set(xlabel="share (%)", xlim=(0.0, 100.0))
    legend_below(page, styles)
    return titled(page, f"Predictions of {predictions.scenario.name}")
