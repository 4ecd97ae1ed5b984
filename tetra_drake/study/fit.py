"""Fit of a scenario's values to measurements: bounded least squares."""

from __future__ import annotations

import contextlib
import hashlib
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas

from tetra_drake import __version__
from tetra_drake.errors import InputError
from tetra_drake.files import read_bytes, write_whole
from tetra_drake.formatting import Say, TextTable, fixed, listed, rounded, silent
from tetra_drake.optimizers.cma_es import Box, Search
from tetra_drake.scenario.common_sections import separate
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.settings.quantities import Quantity
from tetra_drake.settings.section import value_at
from tetra_drake.settings.units import given_quantity
from tetra_drake.study.joined_keys import with_joined_changes
from tetra_drake.study.measurements import FitFile, Measured, Measurement, Prediction

STEP = 1e-3
"""Step of finite differences, as a share of a parameter's start. With less, the contact's kinks and
the tolerance of the simulation show; with more, the curvature."""
LONGER, ROUGH = 10.0, 0.2
"""Factor of a longer step; and difference of the derivatives with both steps, as a share of the
derivative, from which a prediction is rough. Contacts that come and go make it so in long motion:
the search may end in any of many minima, and intervals from derivatives mean nothing."""
TOLERANCE = 1e-4
"""Relative change of parameters at which the fit ends: a tenth of STEP. A smooth fit is far more
exact by then, because its steps shrink quadratically."""
NEGLIGIBLE = 0.01
"""Change of the sum of squares at which the fit ends; 1 is a standard deviation."""
POPULATION, MOST = 16, 480
"""Evaluations per iteration of a global search, which fill the lanes of two cores; and the most of
all its iterations."""
WIDTH_95 = 1.96
"""Half width of a 95 % interval in standard deviations."""
SAME_DIRECTION = 1e-10
"""Singular value, as a share of the greatest, below which the data say nothing of a direction."""
LIKELY = 3.0
"""Excess of the misfit over 1, in standard deviations, up to which a fit explains the data."""
STRONG = 0.95
"""Correlation above which two parameters are named."""
HUGE = 1e200
"""Sum of squares where a simulation fails."""
SEAL = 32
"""Size of the digest in the file of an evaluation, in bytes."""
KEPT_EVALUATIONS = "evaluations"
"""Folder of the evaluations of a fit. A file has a digest of its name and of its numbers, and the
numbers: for each measurement the predicted ones and the offset of the clock."""

Bounds = Sequence[str | float]


class Parameter(NamedTuple):
    """A number of a scenario that is fitted, in SI."""

    key: str
    """The key, or several joined by commas."""
    unit: str
    start: float
    least: float
    most: float

    @property
    def scale(self) -> float:
        """Unit of the relative parameter: the start, or the width of the bounds if the start is 0
        or they are narrower."""
        width = self.most - self.least
        return min(abs(self.start) or width, width)

    def value(self, number: float) -> str | float:
        """The number as a value for the scenario."""
        return f"{number!r} {self.unit}" if self.unit else number


@dataclass(frozen=True)
class Fit:
    """Result of fit()."""

    scenario: Scenario = field(repr=False)
    """The scenario with the fitted values."""
    parameters: pandas.DataFrame
    """A row per key in SI: value, its 95 % interval low and high (NaN if unknown), start, bounds
    least and most, unit, whether the data determine it, and whether predictions are smooth in it.
    """
    correlations: pandas.DataFrame = field(repr=False)
    """Correlations of the parameters, by keys."""
    residuals: pandas.DataFrame = field(repr=False)
    """A row per measured number in SI: measurement, label, along (time in s, or number), measured,
    uncertainty, start and fitted: what the scenario predicts with the start and the fitted values.
    """
    clock_offsets: dict[str, float]
    """Time (s) by which the clock of each measurement is ahead."""
    misfit: float
    """Sum of squares of the weighted residuals per degree of freedom; 1 if the model is right and
    the uncertainties are."""
    start_misfit: float
    """The same with the start values."""
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
        """Warnings, and the offsets of clocks."""
        offsets = {name: 1e3 * offset for name, offset in self.clock_offsets.items() if offset}
        clocks = [f"the clock of {name} is ahead by {ms:.2f} ms" for name, ms in offsets.items()]
        return [*self.warnings, *clocks]

    @property
    def table(self) -> TextTable:
        """Values and intervals."""
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


def fit_values(
    scenario: Scenario,
    measurements: Sequence[Measurement],
    parameters: Mapping[str, Bounds],
    *,
    search: bool = False,
    folder: Path | None = None,
    say: Say = silent,
    source: object = "fit",
) -> Fit:
    """Values of a scenario's keys within bounds for which it meets measurements best.

    Args:
        scenario: the scenario whose values are the start.
        measurements: the measurements.
        parameters: the bounds, least and most, by key. Keys joined by commas get the same value.
        search: searches all values within the bounds for a better start, by CMA-ES.
        folder: keeps each evaluation; another fit to the same data takes them from there.
        say: is told of each iteration.
        source: file with the parameters, for errors.

    Raises:
        InputError: if an argument cannot be used, or the start cannot be simulated.
    """
    from scipy.optimize import least_squares

    began = time.perf_counter()
    given = FitFile.from_tree({"parameters": parameters, "measurements": measurements}, source)
    fitted = [_parameter(scenario, key, each, source) for key, each in given.parameters.items()]
    measured = [
        each.read(scenario, f"measurement {number}")
        for number, each in enumerate(given.measurements, start=1)
    ]
    numbers = sum(len(each.numbers) for each in measured)
    if numbers < len(fitted):
        found = f"found {len(fitted)} keys and {numbers} measured numbers"
        raise InputError(source, "parameters", f"{found}, expected at least a number for each key")
    digest = _digest(scenario, given.measurements)
    problem = _Problem(scenario, fitted, measured, digest, folder, say)
    start = np.array([parameter.start / parameter.scale for parameter in fitted])
    first = problem.residuals(start)
    if not np.isfinite(first).all():
        what = "is not simulated, or lacks equilibrium or frequencies, with the start values"
        raise InputError(scenario.name, "", what)
    solution = least_squares(
        problem.residuals,
        _searched(problem, start) if search else start,
        jac=problem.jacobian,
        bounds=problem.bounds,
        x_scale="jac",
        ftol=2.0 * NEGLIGIBLE / numbers,
        xtol=TOLERANCE,
        gtol=np.finfo(float).eps,  # without it, no influence and no residual give NaN
    )
    return _result(problem, start, solution.x, time.perf_counter() - began)


def _parameter(scenario: Scenario, key: str, bounds: Bounds, source: object) -> Parameter:
    """The parameter of a key. Raises InputError, naming `source`, if key or bounds cannot be
    used."""
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
    parameter = Parameter(key, unit, float(start), least, most)
    try:
        for bound in (least, most):  # a scenario may have limits of its own
            with_joined_changes(scenario, {key: parameter.value(bound)})
    except InputError as error:
        named = "" if error.key in separate(key) else f"{error.key}: "
        raise InputError(source, place, f"{named}{error.problem}") from error
    return parameter


def _digest(scenario: Scenario, measurements: Sequence[Measurement]) -> str:
    """Digest of all that predictions depend on, except the fitted values."""
    digest = hashlib.sha256(f"{__version__} {scenario.values()}".encode())
    for measurement in measurements:
        settings = measurement.model_dump(exclude=set(measurement.files))
        digest.update(f"{type(measurement).tag} {settings}".encode())
        for key, path in measurement.files.items():
            digest.update(key.encode() + read_bytes(path, key))
    return digest.hexdigest()


@dataclass(eq=False)
class _Problem:
    """Weighted residuals and their derivatives by relative parameters. All scenarios of an
    iteration are simulated side by side."""

    scenario: Scenario
    parameters: Sequence[Parameter]
    measured: Sequence[Measured]
    digest: str
    folder: Path | None
    say: Say

    def __post_init__(self) -> None:
        self.scale = np.array([parameter.scale for parameter in self.parameters])
        limits = np.array([[parameter.least, parameter.most] for parameter in self.parameters])
        self.bounds = limits.T / self.scale
        tables = [each.numbers.assign(measurement=each.name) for each in self.measured]
        self.numbers = pandas.concat(tables, ignore_index=True)
        self.values = self.numbers["measured"].to_numpy(dtype=float)
        self.uncertainty = self.numbers["uncertainty"].to_numpy(dtype=float)
        self._known: dict[str, list[Prediction]] = {}

    @property
    def evaluations(self) -> int:
        """Number of scenarios that were predicted so far."""
        return len(self._known)

    def scenario_at(self, x: np.ndarray) -> Scenario:
        """The scenario with relative parameters (n,)."""
        pairs = zip(self.parameters, (x * self.scale).tolist(), strict=True)
        changes = {parameter.key: parameter.value(number) for parameter, number in pairs}
        return with_joined_changes(self.scenario, changes)

    def residuals(self, x: np.ndarray) -> np.ndarray:
        """Weighted residuals (numbers,); the neighbours of the point are simulated with it."""
        before = self.evaluations
        self._evaluate([x, *self._neighbours(x, STEP)])
        residuals = self.residuals_at(x)
        if self.evaluations > before:
            self.tell(residuals)
        return residuals

    def sums_of_squares(self, points: np.ndarray) -> np.ndarray:
        """Sums (k,) of the squares of the weighted residuals at points (k, n), which are simulated
        side by side; a huge number where that fails."""
        self._evaluate(list(points))
        residuals = np.array([self.residuals_at(point) for point in points])
        return np.nan_to_num((residuals**2).sum(axis=1), nan=HUGE)

    def jacobian(self, x: np.ndarray, step: float = STEP) -> np.ndarray:
        """Derivatives (numbers, n) of the residuals by central differences; one-sided where a
        neighbour cannot be simulated. Raises InputError where none can."""
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

    def roughness(self, x: np.ndarray) -> np.ndarray:
        """Differences (n,) of the derivatives with a longer step, as shares of the derivatives."""
        derivatives = self.jacobian(x)
        difference = np.linalg.norm(self.jacobian(x, LONGER * STEP) - derivatives, axis=0)
        size = np.linalg.norm(derivatives, axis=0)
        return difference / np.where(size > 0.0, size, 1.0)

    def misfit(self, residuals: np.ndarray) -> float:
        """Sum of squares per degree of freedom."""
        return float(residuals @ residuals) / max(1, residuals.size - len(self.parameters))

    def tell(self, residuals: np.ndarray) -> None:
        """Tells the user of an iteration that ended with these residuals."""
        self.say(f"{self.evaluations} evaluations, misfit {self.misfit(residuals):.3g}")

    def predictions(self, x: np.ndarray) -> list[Prediction]:
        """Predictions for each measurement at a point that was evaluated."""
        return self._known[self._name(x)]

    def _neighbours(self, x: np.ndarray, step: float) -> list[np.ndarray]:
        """Two neighbours of a point for each parameter, within the bounds."""
        moves = step * np.kron(np.eye(x.size), [[-1.0], [1.0]])
        return list(np.clip(x + moves, *self.bounds))

    def residuals_at(self, x: np.ndarray) -> np.ndarray:
        """Weighted residuals (numbers,) at a point that was evaluated."""
        predicted = np.concatenate([each.values for each in self.predictions(x)])
        residuals: np.ndarray = (predicted - self.values) / self.uncertainty
        return residuals

    def _evaluate(self, points: Sequence[np.ndarray]) -> None:
        """Predicts all measurements at points that are not known."""
        unknown = {}
        for point in points:
            name = self._name(point)
            if name not in self._known and not self._restore(name):
                unknown[name] = point
        if not unknown:
            return
        scenarios = [self.scenario_at(point) for point in unknown.values()]
        by_measurement = [each.predict(scenarios) for each in self.measured]
        for name, predictions in zip(unknown, zip(*by_measurement, strict=True), strict=True):
            self._known[name] = list(predictions)
            if file := self._file(name):
                numbers = [[*each.values, each.clock_offset] for each in predictions]
                content = np.concatenate(numbers).tobytes()
                write_whole(file, _seal(name, content) + content)

    def _name(self, x: np.ndarray) -> str:
        """Name of an evaluation: a digest of the data, keys and values."""
        keys = [parameter.key for parameter in self.parameters]
        text = f"{self.digest} {keys} {(x * self.scale).tolist()}"
        return hashlib.sha256(text.encode()).hexdigest()[:24]

    def _file(self, name: str) -> Path | None:
        return self.folder and self.folder / KEPT_EVALUATIONS / f"{name}.bin"

    def _restore(self, name: str) -> bool:
        """Takes an evaluation from the folder. Returns False if it is not there, or damaged."""
        counts = [len(each.numbers) + 1 for each in self.measured]
        file, content = self._file(name), b""
        with contextlib.suppress(InputError):  # it is simulated again
            content = read_bytes(file, "evaluation") if file else b""
        numbers = content[SEAL:]
        if content[:SEAL] != _seal(name, numbers):
            return False
        arrays = np.split(np.frombuffer(numbers), np.cumsum(counts)[:-1])
        self._known[name] = [Prediction(each[:-1], float(each[-1])) for each in arrays]
        return True


def _seal(name: str, content: bytes) -> bytes:
    """Digest (SEAL bytes) of the name and the content of an evaluation."""
    return hashlib.sha256(name.encode() + content).digest()


def _searched(problem: _Problem, start: np.ndarray) -> np.ndarray:
    """Relative parameters (n,) with the least sum of squares in a search by CMA-ES, which ends when
    it has converged roughly."""
    low, high = problem.bounds
    origin = (start - low) / (high - low)
    search = Search(POPULATION, Box(start.size), np.random.default_rng(0), origin)
    while not search.restarts and search.evaluations < MOST:
        shares = search.draw()
        search.learn(shares, -problem.sums_of_squares(low + shares * (high - low)))
        problem.tell(problem.residuals_at(low + search.best_point * (high - low)))
    points = np.array([start, low + search.best_point * (high - low)])
    return points[np.argmin(problem.sums_of_squares(points))]


def _result(problem: _Problem, start: np.ndarray, x: np.ndarray, wall_time: float) -> Fit:
    """The result of a fit that started at relative parameters and ended at `x` (n,)."""
    first, last = problem.residuals(start), problem.residuals(x)
    misfit = problem.misfit(last)
    half, correlation = _uncertainty(problem, x, misfit)
    determined, smooth = np.isfinite(half), problem.roughness(x) < ROUGH
    explained = misfit <= 1.0 + LIKELY * math.sqrt(2.0 / max(1, last.size - x.size))
    known = determined & (smooth | ~determined).all()
    values, width = x * problem.scale, np.where(known, half, np.nan)
    given = pandas.DataFrame(problem.parameters).set_index("key")
    ends = {"value": values, "low": values - width, "high": values + width}
    table = pandas.DataFrame(ends, given.index).join(given)
    table = table.assign(determined=determined, smooth=smooth)
    predicted = [problem.values + problem.uncertainty * each for each in (first, last)]
    correlations = pandas.DataFrame(correlation, index=given.index, columns=given.index)
    clocks = zip(problem.measured, problem.predictions(x), strict=True)
    return Fit(
        scenario=problem.scenario_at(x),
        parameters=table,
        correlations=correlations,
        residuals=problem.numbers.assign(start=predicted[0], fitted=predicted[1]),
        clock_offsets={each.name: found.clock_offset for each, found in clocks},
        misfit=misfit,
        start_misfit=problem.misfit(first),
        warnings=_warnings(table, correlations, explained=explained),
        evaluations=problem.evaluations,
        wall_time=wall_time,
    )


def _uncertainty(problem: _Problem, x: np.ndarray, misfit: float) -> tuple[np.ndarray, np.ndarray]:
    """Half widths (n,) of the 95 % intervals in SI, infinite if the bounds are nearer; and
    correlations (n, n).

    Uncertainties are as given; where the residuals are larger, they are scaled to them.
    """
    width = problem.bounds[1] - problem.bounds[0]
    _, singular, rows = np.linalg.svd(problem.jacobian(x) * width, full_matrices=False)
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
    """What a reader of a fit has to know. `explained` is True if the residuals are as small as the
    uncertainties."""
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
