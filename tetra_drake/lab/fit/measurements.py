"""Measurements of a robot, for fit(): its motion, or its shape, tensions and frequencies at rest.

A measurement has settings, reads its numbers, and predicts them for other scenarios.
"""

from __future__ import annotations

import functools
import io
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import pandas
from pydantic import AfterValidator, Field

from tetra_drake.engines.simulate import Outcome, simulate_many
from tetra_drake.errors import InputError, SimulationFailure
from tetra_drake.files import read_bytes, read_text
from tetra_drake.formatting import fixed
from tetra_drake.lab.study.equilibrium import study_equilibrium
from tetra_drake.laws.model import WORLD
from tetra_drake.robot.command import Command, Driver
from tetra_drake.robot.command_file import TIME_S, column_numbers, load_command, table_cells
from tetra_drake.robot.gait_file import load_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import Structure, node_positions
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.scenario.yaml_text import read_mapping
from tetra_drake.settings.quantities import (
    Angle,
    ForceQuantity,
    Frequency,
    Keyed,
    Length,
    Position,
    Time,
    different_keys,
)
from tetra_drake.settings.refusals import hint
from tetra_drake.settings.section import Kinds, Section
from tetra_drake.settings.units import given_quantity

SAMPLE_PERIOD = 5e-3
"""Time (s) between samples of simulated motion. Cubic curves join the samples."""
ROUNDING = 1e-6
"""Time (s) by which times in a log may be rounded."""
DELAY = 0.1
"""Time (s) by which a log with a clock of its own may begin before the simulation, or end after."""
MARKERS, ALIKE = 3, 2.0
"""Least number of markers that tell the frame of a log; factor of their size that is no error."""
CUT = 0.05
"""Share of the duration of a command that may be missing at the end of a log."""
LEAST, MOST = 1e-12, 1e12
"""Least uncertainty of a measured number, and its largest size, in SI."""
INSTALL = "pip install 'tetra_drake[parquet]'"

_SIZE, _UNCERTAINTY = Field(ge=-MOST, le=MOST), Field(ge=LEAST, le=MOST)


class Prediction(NamedTuple):
    """Numbers that one scenario predicts for one measurement, in the order of the measured ones."""

    values: np.ndarray
    """Numbers (numbers,) in SI; NaN if there is none."""
    clock_offset: float = 0.0
    """Time (s) by which the clock of the measurement is ahead of the simulated time."""
    notes: Sequence[str] = ()
    """What was found besides: frame, and offsets of markers."""


@dataclass(frozen=True)
class Measured:
    """Measured numbers of one measurement, and the function that predicts them for scenarios."""

    name: str
    numbers: pandas.DataFrame
    """A row per number in SI: label, such as "n3 z"; along, its time (s) or its position in the
    list; measured; uncertainty, its standard deviation."""
    predict: Callable[[Sequence[Scenario]], list[Prediction]]
    """What scenarios predict; NaN if a scenario cannot be simulated."""


class _Placed(Section):
    """Base class of measurements whose positions may be in another frame than the model's."""

    origin: Position | None = None
    """Position of the model's origin in the frame of the measurement."""
    turn: Annotated[list[Angle], Field(min_length=3, max_length=3)] | None = None
    """Angles of the model in this frame: about x, the turned y and z. -90 degrees about x: y is
    up."""

    def frame(self) -> tuple[np.ndarray, np.ndarray]:
        """Rotation (3, 3) and origin (3,) in m of the model's world in the frame of the
        measurement; what is not given is 0."""
        from scipy.spatial.transform import Rotation

        turn = Rotation.from_euler("XYZ", self.turn or np.zeros(3)).as_matrix()
        return turn, np.array(self.origin or np.zeros(3))


class MotionCapture(_Placed):
    """Measurement of a robot in motion, for a fit: a log of the positions of markers on nodes over
    time, as a motion capture records them. If neither `origin` nor `turn` is given, a fit finds
    both, from three markers on.

        >>> td.MotionCapture(log="lab/log.csv", command="lab/command.csv", uncertainty=2e-4)

    Numbers are SI.
    """

    log: str
    """CSV or Parquet file: a column time_s and columns such as "n3 x_mm". An empty cell is a gap.
    The log lasts as long as the command, or as the simulation if it is shorter."""
    command: str | None = None
    """File of the commands that the robot followed."""
    gait: str | None = None
    """File of the gait that the robot walked with, in place of a command."""
    uncertainty: Annotated[Length, _UNCERTAINTY]
    """Standard deviation of a coordinate."""
    clock: Annotated[Time, Field(ge=0)] | None = None
    """Largest offset between the clocks of log and command. A fit finds the offset; 0 for none. If
    not given, any is found if the log is not within the simulated time; otherwise there is none."""
    markers: Keyed[str, str] = Field(default={})
    """Nodes by the names of markers whose names are no nodes."""
    marker_offset: Annotated[Length, Field(ge=0, le=MOST)] = 0.0
    """Standard deviation of a marker's place beside its node along the axes of its body. A fit
    finds such offsets; 0 for none."""

    def read(self, scenario: Scenario, name: str) -> Measured:
        """Reads the log: the measured coordinates, and a function that predicts them. `name` is the
        measurement's name in texts. Raises InputError, naming file and line or column, if the log
        is wrong."""
        if (self.command is None) == (self.gait is None):
            problem = f"found {'neither' if self.gait is None else 'both'}, expected one of them"
            raise InputError(name, "command", f"{problem}, a command or a gait")
        if self.command is not None:
            driver: Driver = load_command(self.command, scenario)
        else:
            driver = load_gait(str(self.gait), scenario)
        structure = Robot.of(scenario).structure
        table = _log(self.log, [*structure.node_names, *self.markers])
        (first, last), duration = table.index[[0, -1]], scenario.simulation.duration
        found, slack = last - first, ROUNDING + (self.clock or 0.0)
        is_outside = first < -slack or last > duration + slack
        if found > duration + ROUNDING or (is_outside and self.clock is not None):
            problem = f"found {first:.12g} to {last:.12g} s, expected 0 to {duration:g} s"
            remedy = "give simulation.duration more" if found > duration else "leave out `clock`"
            raise InputError(self.log, TIME_S, f"{problem}; {remedy}")
        least = 0.0
        if isinstance(driver, Command):
            least = min(duration, driver.period * (len(driver.samples) - 1))
        if found < (1.0 - CUT) * least:
            expected = f"expected at least the command's {least:g} s"
            problem = f"found {found:g} s, {expected}; give simulation.duration less to fit a part"
            raise InputError(self.log, TIME_S, problem)
        table = self._named(table, structure)
        row, column = np.nonzero(np.isfinite(table.to_numpy()))
        offsets = [f"{x[:-1]}offset {x[-1]}" for x in table if self.marker_offset]
        none = [0.0] * len(offsets)
        numbers = {
            "label": [*table.columns[column], *offsets],
            "along": [*table.index[row], *none],
            "measured": [*table.to_numpy()[row, column], *none],
            "uncertainty": [self.uncertainty] * len(row) + [self.marker_offset] * len(offsets),
        }
        predict = functools.partial(self.predict, driver=driver, log=table)
        return Measured(f"{name}, {Path(self.log).name}", pandas.DataFrame(numbers), predict)

    def _named(self, log: pandas.DataFrame, structure: Structure) -> pandas.DataFrame:
        """The log with all coordinates of its nodes as columns. Raises InputError for a wrong name
        in `markers`, and where markers are not as far apart as their nodes."""
        nodes, names = structure.node_names, [*dict.fromkeys(name[:-2] for name in log)]
        found = [self.markers.get(name, name) for name in names]
        for marker, node in self.markers.items():
            if node not in nodes or marker not in names or found.count(node) > 1:
                problem = f"found {node}, expected a node of its own for a marker of the log"
                raise InputError(self.log, f"markers.{marker}", problem)
        log = log.reindex(columns=_coordinates(names))
        seen = _by_node(log)
        whole = np.isfinite(seen).all(axis=2)
        used = whole.any(axis=0)
        row = whole[:, used].all(axis=1).argmax()
        if used.sum() >= MARKERS and whole[row, used].all():
            p_WN = node_positions(structure, structure.initial_state)
            p_WN = p_WN[[nodes.index(node) for node in found]][used]
            ratio = math.sqrt(seen[row, used].var(axis=0).sum() / p_WN.var(axis=0).sum())
            if not 1.0 / ALIKE < ratio < ALIKE:
                problem = f"found markers {ratio:.3g} times as far apart as their nodes"
                raise InputError(self.log, "", f"{problem}, expected another unit")
        return log.set_axis(_coordinates(found), axis="columns")

    def predict(
        self, scenarios: Sequence[Scenario], *, driver: Driver, log: pandas.DataFrame
    ) -> list[Prediction]:
        """Predictions of the coordinates in a log, one Prediction per scenario, by simulation.

        `log` is the table of measured coordinates (m), with times (s) as index. `driver` is the
        command or the gait that moves the robot. What settings leave open of the log's clock, its
        frame and the places of its markers is what fits the log best.
        """
        often = {"simulation.sample_period": SAMPLE_PERIOD}
        finely = [each.with_numbers(often) for each in scenarios]
        outcomes = simulate_many(finely, [driver] * len(finely), record=True)
        return [self._prediction(outcome, log) for outcome in outcomes]

    def _prediction(self, outcome: Outcome, log: pandas.DataFrame) -> Prediction:
        from scipy.interpolate import CubicHermiteSpline, make_interp_spline
        from scipy.spatial.transform import Rotation

        from tetra_drake.lab.fit.placement import nearest

        seen, first, last = _by_node(log), float(log.index[0]), float(log.index[-1])
        if isinstance(outcome, SimulationFailure):
            count = np.isfinite(seen).sum() + seen[0].size * bool(self.marker_offset)
            return Prediction(np.full(count, np.nan))
        moved, structure, names = outcome.trajectory, outcome.robot.structure, log.columns[::3]
        nodes = [structure.node_names.index(name[:-2]) for name in names]
        p, v = (each.values[:, nodes] for each in (moved.p_WN, moved.v_WN))
        q_WB, end = moved.q_WB.values, float(moved.time[-1])
        R_WB = Rotation.from_quat(np.roll(q_WB, -1, axis=2).reshape(-1, 4)).as_matrix()
        fixed_too = np.pad(R_WB.reshape(*q_WB.shape[:2], 3, 3), ((0, 0), (0, 1), (0, 0), (0, 0)))
        fixed_too[:, WORLD] = np.eye(3)
        positions = CubicHermiteSpline(moved.time.values, p, v)
        axes = make_interp_spline(moved.time.values, fixed_too[:, structure.carriers[nodes]], k=1)

        def times(shift: float) -> np.ndarray:
            # The robot stands still before and after the simulation.
            return np.clip(log.index.to_numpy() - first - shift, 0.0, end)

        slack = self.clock or 0.0
        clock = -first - slack, slack - first
        if self.clock is None and not -ROUNDING <= first <= last <= end + ROUNDING:
            clock = last - first - end - DELAY, DELAY
        markers = np.isfinite(seen).all(axis=2).any(axis=0).sum()
        is_free = self.origin is self.turn is None and markers >= MARKERS
        frame = None if is_free else self.frame()
        share = self.uncertainty / self.marker_offset if self.marker_offset else 0.0
        found = nearest(positions, axes, times, seen, clock=clock, frame=frame, share=share)
        notes = list[str]()
        if self.marker_offset:
            beside = 1e3 * np.linalg.norm(found.offsets, axis=1)
            where = names[beside.argmax()][:-2]
            notes.append(f"markers are beside nodes, at most by {beside.max():.1f} mm at {where}")
        if is_free:
            turn, origin = found.frame
            place = ", ".join(f"{fixed(1e3 * each, 1)} mm" for each in origin)
            angles = Rotation.from_matrix(turn).as_euler("XYZ", degrees=True)
            angle = ", ".join(f"{fixed(each)} deg" for each in angles)
            notes.append(f"the frame has origin: [{place}], turn: [{angle}]")
        offsets = found.offsets if self.marker_offset else np.zeros((0, 3))
        values = np.append(found.p[np.isfinite(seen)], offsets)
        return Prediction(values, found.shift + float(first), notes)


class Rest(_Placed):
    """Measurement of a robot at rest, for a fit: node coordinates, cable tensions and natural
    frequencies.

        >>> pulled = {"robot.loads.n3": ["0 N", "0 N", "-0.5 N"]}
        >>> td.Rest(changes=pulled, positions={"n3 z": 0.17}, position_uncertainty=5e-4)

    The robot rests in equilibrium without actuation. Numbers are SI. `changes` are settings of the
    scenario in this case only, such as a load that pulls at a node, as in Scenario.with_changes().
    """

    changes: Keyed[str, Any] = Field(default={})
    """Values of scenario keys in this case, such as loads."""
    positions: Keyed[str, Annotated[Length, _SIZE]] = Field(default={})
    """Coordinates by node and axis, such as "n3 z"."""
    tensions: Keyed[str, Annotated[ForceQuantity, _SIZE]] = Field(default={})
    """Tensions by the names of the cables."""
    frequencies: list[Annotated[Frequency, _SIZE]] = Field(default=[])
    """Natural frequencies, the lowest one first."""
    position_uncertainty: Annotated[Length, _UNCERTAINTY] = 1e-3
    """Standard deviation of a coordinate."""
    tension_uncertainty: Annotated[ForceQuantity, _UNCERTAINTY] = 1.0
    """Standard deviation of a tension."""
    frequency_uncertainty: Annotated[Frequency, _UNCERTAINTY] = 0.05
    """Standard deviation of a frequency."""

    def read(self, scenario: Scenario, name: str) -> Measured:
        """The measured numbers, and a function that predicts them. `name` is the measurement's name
        in texts and errors. Raises InputError for an unknown node or cable."""
        structure = Robot.of(scenario.with_changes(self.changes)).structure
        places = _coordinates(structure.node_names)
        for key, known in {"positions": places, "tensions": structure.cable_names}.items():
            for label in getattr(self, key):
                if label not in known:
                    raise InputError(name, f"{key}.{label}", f"is unknown; {hint(label, known)}")
        counts = [len(self.positions), len(self.tensions), len(self.frequencies)]
        spread = self.position_uncertainty, self.tension_uncertainty, self.frequency_uncertainty
        modes = [f"frequency {mode + 1}" for mode in range(len(self.frequencies))]
        numbers = {
            "label": [*self.positions, *self.tensions, *modes],
            "along": 1.0 + np.arange(sum(counts)),
            "measured": [*self.positions.values(), *self.tensions.values(), *self.frequencies],
            "uncertainty": np.repeat(spread, counts),
        }
        return Measured(name, pandas.DataFrame(numbers), self.predict)

    def predict(self, scenarios: Sequence[Scenario]) -> list[Prediction]:
        """Predictions of the measured numbers, one Prediction per scenario, from its equilibrium.
        The order is positions, tensions, frequencies; all NaN if there is no equilibrium."""
        modes = len(self.frequencies)
        nothing = np.full(len(self.positions) + len(self.tensions) + modes, np.nan)
        predictions = []
        for scenario in scenarios:
            try:
                study = study_equilibrium(scenario.with_changes(self.changes))
            except InputError:  # there may be no equilibrium with such values
                predictions.append(Prediction(nothing))
                continue
            turn, origin = self.frame()
            p = study.nodes[["x", "y", "z"]].to_numpy() @ turn.T + origin
            places = pandas.Series(p.ravel(), _coordinates(list(study.nodes.index)))
            forces = study.cables.loc[list(self.tensions), "tension"]
            found = study.frequencies[:modes] if modes else np.zeros(0)
            lacking = np.full(modes - len(found), np.nan)
            numbers = [places[list(self.positions)], forces, found, lacking]
            predictions.append(Prediction(np.concatenate(numbers)))
        return predictions


_Pair = Annotated[list[str | float], Field(min_length=2, max_length=2)]
Measurement = Annotated[MotionCapture | Rest, Kinds()]


class FitFile(Section):
    """Content of the YAML file of a fit: bounds of the scenario values to fit, and measurements."""

    parameters: Annotated[Keyed[str, _Pair], Field(min_length=1), AfterValidator(different_keys)]
    """Bounds, least and most, by scenario key. Keys joined by commas get the same value."""
    measurements: list[Measurement] = Field(min_length=1)


def files_of(measurement: Measurement) -> dict[str, str]:
    """Paths of the files that a measurement names, by key: log, command, gait. A Rest has none."""
    paths = measurement.model_dump(include={"log", "command", "gait"})
    return {key: path for key, path in paths.items() if path is not None}


def load_fit_file(path: str | Path) -> FitFile:
    """Reads the YAML file of a fit: parameters to fit, and measurements. Paths in the file are
    relative to its folder. Raises InputError, naming file and key, if the content is wrong."""
    path = Path(path)
    tree = read_mapping(path, "file of a fit", keys=FitFile.model_fields)
    given = FitFile.from_tree(tree, path)
    placed = []
    for measurement in given.measurements:
        paths = {key: str(path.parent / file) for key, file in files_of(measurement).items()}
        placed.append(measurement.model_copy(update=paths))
    return given.model_copy(update={"measurements": placed})


def _coordinates(nodes: Sequence[str]) -> list[str]:
    """Names of the x, y and z coordinates of each node, such as "n3 z"."""
    return [f"{node} {axis}" for node in nodes for axis in "xyz"]


def _by_node(log: pandas.DataFrame) -> np.ndarray:
    """Positions (times, nodes, 3) in m of a log with the columns of _coordinates()."""
    return log.to_numpy().reshape(len(log), -1, 3)


def _log(path: str, nodes: Sequence[str]) -> pandas.DataFrame:
    """Reads a log file (CSV or Parquet): a table of coordinates (m) with times (s) as index and
    columns such as "n3 z"; NaN in gaps. `nodes` are the names that it may have. Raises InputError,
    naming line or column, if the log is wrong."""
    if path.endswith(".parquet"):
        try:
            stored = pandas.read_parquet(io.BytesIO(read_bytes(path, "log")))
        except ImportError as error:
            raise InputError(path, "", f"cannot be read: pyarrow is missing; {INSTALL}") from error
        except (ValueError, OSError) as error:
            raise InputError(path, "", f"is no Parquet file: {error}") from error
        text = stored.to_csv(index=bool(stored.index.name))
    else:
        text = read_text(path, "log")
    cells = table_cells(text, path)
    if TIME_S not in cells:
        raise InputError(path, TIME_S, "is missing, expected a column with the time in s")
    times = column_numbers(cells.pop(TIME_S), path)
    for row in np.flatnonzero(np.diff(times) <= 0.0):
        found = f"found {times[row + 1]:g} after {times[row]:g}"
        raise InputError(path, f"line {row + 3}, {TIME_S}", f"{found}, expected ascending times")
    columns = {}
    for name in cells:
        match = re.fullmatch(r"((.+) [xyz])_(\w+)", name)
        if match is None:
            expected = f"expected node, axis and unit, such as '{nodes[0]} x_mm'"
            raise InputError(path, name, f"is no column of a log; {expected}")
        coordinate, node, unit = match.groups()
        if node not in nodes:
            problem = f"found unknown node '{node}'; {hint(node, nodes)}"
            raise InputError(path, name, f"{problem}; give the node of a marker in `markers`")
        scale = given_quantity(f"1 {unit}", "m", path, name)
        columns[coordinate] = scale * column_numbers(cells[name], path, gaps=True)
        for row in np.flatnonzero(np.abs(columns[coordinate]) > MOST):
            problem = f"found {cells[name][row]}, expected at most {MOST:g} m"
            raise InputError(path, f"line {row + 2}, {name}", problem)
    table = pandas.DataFrame(columns, index=times)
    if not np.isfinite(table.to_numpy(dtype=float)).any():
        raise InputError(path, "", "has no positions, expected one at least")
    return table
