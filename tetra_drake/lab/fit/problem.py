"""Least-squares problem of a fit: parameters, weighted residuals, and their derivatives."""

from __future__ import annotations

import contextlib
import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas

from tetra_drake.errors import InputError
from tetra_drake.evolution.entries import entries_of, json_line
from tetra_drake.files import json_number, write_whole
from tetra_drake.formatting import Say
from tetra_drake.lab.fit.measurements import Measured, Prediction
from tetra_drake.lab.predict.variates import variates_of
from tetra_drake.lab.study.sweep import with_joined_changes
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.settings.quantities import Quantity, separate
from tetra_drake.settings.section import Tree, value_at
from tetra_drake.settings.units import given_quantity

STEP = 1e-3
"""Step of finite differences, as a share of a parameter's start. With less, the contact's kinks and
the tolerance of the simulation show; with more, the curvature."""
HUGE = 1e200
"""Sum of squares where a simulation fails."""
KEPT_EVALUATIONS = "evaluations"
"""Name of the folder that keeps the evaluations of a fit. A file has a line with a checksum, as the
record of a run: the file's name, and the predicted numbers of all measurements."""

Bounds = Sequence[str | float]


class Parameter(NamedTuple):
    """A number of a scenario that a fit adjusts: key, unit, start value and bounds. All values are
    in SI."""

    key: str
    """The key, or several joined by commas."""
    unit: str
    start: float
    least: float
    most: float
    prior: float = math.inf
    """Standard deviation about the start by the scenario's tolerances; infinite without one."""

    @property
    def scale(self) -> float:
        """Divisor that makes the parameter dimensionless: the size of the start value, or the width
        of the bounds if the start is 0 or the bounds are narrower."""
        width = self.most - self.least
        return min(abs(self.start) or width, width)

    def value(self, number: float) -> str | float:
        """A number in SI as Scenario.with_changes() takes it: a text with the parameter's unit, or
        the number if it has none."""
        return f"{number!r} {self.unit}" if self.unit else number


def parameter_of(scenario: Scenario, key: str, bounds: Bounds, source: object) -> Parameter:
    """Parameter for a scenario key; its start is the scenario's value. `bounds` are the least and
    the greatest value: texts with units, or numbers in SI. Raises InputError, naming `source`, if
    key or bounds cannot be used."""
    place = f"parameters.{key}"
    values = scenario.model_dump()
    starts = [value_at(values, each) for each in separate(key)]
    for start in starts:
        if isinstance(start, bool) or not isinstance(start, float):
            what = "no value" if start is None else f"{start!r:.40}"
            raise InputError(source, place, f"found {what}, expected the key of a number to fit")
    start = starts[0]
    if any(other != start for other in starts):
        found = " and ".join(f"{each:g}" for each in starts)
        raise InputError(source, place, f"found {found}, expected joined keys of the same value")
    unit = start.unit if isinstance(start, Quantity) else ""
    least, most = (
        given_quantity(bound, unit, source, place) if isinstance(bound, str) else float(bound)
        for bound in bounds
    )
    if not least < most:
        raise InputError(source, place, f"found bounds {least:g} to {most:g}, expected least first")
    if not least <= start <= most:
        problem = f"found bounds {least:g} to {most:g} {unit}".rstrip()
        raise InputError(source, place, f"{problem}, expected them around the start, {start:g}")
    prior = _prior(scenario, values, separate(key))
    parameter = Parameter(key, unit, float(start), least, most, prior)
    try:
        for bound in (least, most):  # a scenario may have limits of its own
            with_joined_changes(scenario, {key: parameter.value(bound)})
    except InputError as error:
        named = "" if error.key in separate(key) else f"{error.key}: "
        raise InputError(source, place, f"{named}{error.problem}") from error
    return parameter


def _prior(scenario: Scenario, values: Tree, keys: Sequence[str]) -> float:
    """Standard deviation of the number at `keys`, which all get the same value, by the tolerances
    of the scenario; infinite if they have no tolerance in common. `values` is the scenario's
    content."""
    variates = variates_of(values, scenario.all_tolerances)
    moves = [{each.deviations.get(key, 0.0) for key in keys} for each in variates]
    squares = [move.pop() ** 2 for move in moves if len(move) == 1]
    return math.sqrt(sum(squares)) or math.inf


@dataclass(eq=False)
class FitProblem:
    """Weighted residuals of a fit, and their derivatives by dimensionless parameters.

    A point `x` is an array (n,) of the parameters, each divided by its Parameter.scale. A weighted
    residual is (predicted - measured) / uncertainty. A tolerance counts as a measurement of its
    parameter: its residual, (value - start) / standard deviation, comes after the others. All
    scenarios of an iteration are simulated in parallel.
    """

    scenario: Scenario
    parameters: Sequence[Parameter]
    measured: Sequence[Measured]
    digest: str
    """Digest of all that predictions depend on, except the fitted values."""
    folder: Path | None
    """Folder that keeps the evaluations; None to keep none."""
    say: Say

    def __post_init__(self) -> None:
        self.scale = np.array([parameter.scale for parameter in self.parameters])
        limits = np.array([[parameter.least, parameter.most] for parameter in self.parameters])
        self.bounds = limits.T / self.scale
        tables = [each.numbers.assign(measurement=each.name) for each in self.measured]
        self.numbers = pandas.concat(tables, ignore_index=True)
        self.values = self.numbers["measured"].to_numpy(dtype=float)
        self.uncertainty = self.numbers["uncertainty"].to_numpy(dtype=float)
        self.start = np.array([each.start for each in self.parameters]) / self.scale
        weights = self.scale / np.array([each.prior for each in self.parameters])
        self.tolerances = np.diag(weights)[weights > 0.0]
        self._known: dict[str, np.ndarray] = {}
        self._kept = self.folder and self.folder / KEPT_EVALUATIONS

    @property
    def evaluations(self) -> int:
        """Number of points, each a changed scenario, whose predictions are known so far: simulated,
        or read from the folder."""
        return len(self._known)

    def scenario_at(self, x: np.ndarray) -> Scenario:
        """The scenario with its fitted keys set to the values of the point `x`."""
        pairs = zip(self.parameters, (x * self.scale).tolist(), strict=True)
        changes = {parameter.key: parameter.value(number) for parameter, number in pairs}
        return with_joined_changes(self.scenario, changes)

    def residuals(self, x: np.ndarray) -> np.ndarray:
        """Weighted residuals (numbers,) at the point `x`, also of the tolerances. The
        neighbours of the point, which the derivatives need, are simulated at the same time."""
        before = self.evaluations
        self._evaluate([x, *self._neighbours(x, STEP)])
        residuals = self.residuals_at(x)
        if self.evaluations > before:
            self.tell(residuals)
        return residuals

    def residuals_at(self, x: np.ndarray) -> np.ndarray:
        """Weighted residuals (numbers,) at a point that was evaluated before; simulates nothing."""
        residuals = (self._known[self._name(x)] - self.values) / self.uncertainty
        return np.append(residuals, self.tolerances @ (x - self.start))

    def predictions(self, x: np.ndarray) -> dict[str, Prediction]:
        """What each measurement predicts at the point `x`, by its name, with the clock and notes of
        logs. All are simulated again."""
        return {each.name: each.predict([self.scenario_at(x)])[0] for each in self.measured}

    def sums_of_squares(self, points: np.ndarray) -> np.ndarray:
        """Sums (k,) of the squares of the weighted residuals at k points (k, n), which are
        simulated in parallel; 1e200 where a simulation fails."""
        self._evaluate(list(points))
        residuals = np.array([self.residuals_at(point) for point in points])
        return np.nan_to_num((residuals**2).sum(axis=1), nan=HUGE)

    def jacobian(self, x: np.ndarray, step: float = STEP) -> np.ndarray:
        """Derivatives (numbers, n) of the weighted residuals by the n parameters at the point `x`,
        by central differences of `step` in the dimensionless parameter; one-sided where a neighbour
        cannot be simulated. Raises InputError where none can."""
        points = self._neighbours(x, step)
        self._evaluate([x, *points])
        columns = []
        for place, parameter in enumerate(self.parameters):
            near = [points[2 * place], x, points[2 * place + 1]]
            sides = [(point[place], self.residuals_at(point)) for point in near]
            sides = [side for side in sides if np.isfinite(side[1]).all()]
            (low, left), (high, right) = sides[0], sides[-1]
            if low == high:
                problem = "neighbouring values cannot be simulated, expected other bounds"
                raise InputError(f"scenario {self.scenario.name}", parameter.key, problem)
            columns.append((right - left) / (high - low))
        return np.column_stack(columns)

    def misfit(self, residuals: np.ndarray) -> float:
        """Sum of the squares of these weighted residuals (numbers,) per degree of freedom, about 1
        for a right model."""
        return float(residuals @ residuals) / max(1, residuals.size - len(self.parameters))

    def tell(self, residuals: np.ndarray) -> None:
        """Passes a line about an iteration to `say`: the number of evaluations so far, and the
        misfit of these weighted residuals (numbers,)."""
        self.say(f"{self.evaluations} evaluations, misfit {self.misfit(residuals):.3g}")

    def _neighbours(self, x: np.ndarray, step: float) -> list[np.ndarray]:
        """Two neighbours of a point for each of the n parameters, for differences: a list of 2 n
        points, lower and upper in turn, `step` away in one parameter and clipped to the bounds."""
        moves = step * np.kron(np.eye(x.size), [[-1.0], [1.0]])
        return list(np.clip(x + moves, *self.bounds))

    def _evaluate(self, points: Sequence[np.ndarray]) -> None:
        """Makes the predictions of all measurements known at these points (n,): reads them from the
        folder, or simulates. Known points are skipped."""
        unknown = {self._name(point): point for point in points}
        unknown = {name: each for name, each in unknown.items() if name not in self._known}
        files = {name: self._kept / f"{name}.jsonl" for name in unknown} if self._kept else {}
        for name, file in files.items():
            with contextlib.suppress(InputError):  # a missing or damaged evaluation is made again
                kept = next(entries_of(file), {})
                if kept.get("name") == name:
                    self._known[name] = np.array(kept["numbers"], dtype=float)
                    del unknown[name]
        if not unknown:
            return
        scenarios = [self.scenario_at(point) for point in unknown.values()]
        by_measurement = [each.predict(scenarios) for each in self.measured]
        for name, predictions in zip(unknown, zip(*by_measurement, strict=True), strict=True):
            numbers = np.concatenate([each.values for each in predictions])
            self._known[name] = numbers
            if name in files:
                listed = [json_number(number) for number in numbers.tolist()]
                write_whole(files[name], json_line({"name": name, "numbers": listed}))

    def _name(self, x: np.ndarray) -> str:
        """Name of the evaluation of a point, and of its file: a hexadecimal digest of the data, and
        of keys and values of the parameters."""
        keys = [parameter.key for parameter in self.parameters]
        text = f"{self.digest} {keys} {(x * self.scale).tolist()}"
        return hashlib.sha256(text.encode()).hexdigest()[:24]
