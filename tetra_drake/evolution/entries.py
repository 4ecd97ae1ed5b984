"""Files of a run's record and the content of their lines.

trial_00/
  evaluations.jsonl       one line per evaluation, in the optimiser's order; metrics in SI
  iterations.jsonl        one line per iteration: best fitness, the optimiser's report
  in_progress.jsonl       evaluations of the current iteration that are done
  best_gait.json          gait file of the fittest gait so far
  best.yaml               scenario with the body of this gait (only if bodies evolve)
  reevaluations.jsonl     gaits evaluated once more on the Drake diagram
elites.jsonl              the map's gaits on disturbed robots (only with !QualityDiversity)
spreads.jsonl             ranges of the metrics of the run's best gait for moved starts

Each line begins with the name of its run, and in a trial's folder with the number of the trial. It
ends with a checksum, so that damaged lines are found. Lines are only appended, so that a file
survives a kill at any moment. NAME.xz holds the earlier lines of NAME, compressed by `xz`, which
has its own checksums.
"""

from __future__ import annotations

import contextlib
import io
import itertools
import json
import lzma
import math
import os
import re
import zlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, NoReturn

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, JsonValue, ValidationError

from tetra_drake.errors import InputError
from tetra_drake.files import json_number, make_folder, read_bytes, writing
from tetra_drake.optimizers.base import Evaluation, Task
from tetra_drake.scenario.metrics import wrong_metric

EVALUATIONS, ITERATIONS = "evaluations.jsonl", "iterations.jsonl"
IN_PROGRESS, BEST_GAIT = "in_progress.jsonl", "best_gait.json"
BEST_SCENARIO = "best.yaml"
REEVALUATIONS, ELITES = "reevaluations.jsonl", "elites.jsonl"
SPREADS = "spreads.jsonl"

MOST = 2**30
"""Largest size of a file, and of its earlier lines when they are not compressed, in bytes."""

REMEDY = (
    "cut this line and those after it off the file, and `tetra-drake evolve --resume` makes good "
    "what is missing"
)

_PACKED = ".xz"
"""Suffix of compressed files."""

_CHECKSUM = re.compile(rb'(.*), "crc": "([0-9a-f]{8})"\}')
"""Pattern of a line: its content, then the CRC-32 of the content in hexadecimal digits."""


def _checked(metrics: dict[str, Any]) -> dict[str, Any]:
    """Checks metrics and returns them. Raises ValueError if one has a wrong type."""
    if name := wrong_metric(metrics):
        raise ValueError(f"{name} is of a wrong type")
    return metrics


WholeNumber = Annotated[int, Field(ge=0, lt=2**31)]
"""Type of counts and indices in a record: whole numbers below 2³¹."""


class Line(BaseModel):
    """Base class for the lines of a run's record files: the keys of a line with their types. A line
    may have further keys, which are kept."""

    model_config = ConfigDict(strict=True, allow_inf_nan=False, extra="allow")
    __pydantic_extra__: dict[str, JsonValue] = Field(init=False)

    identity: ClassVar[tuple[str, ...]] = ()
    """Keys that identify a line: no two lines of a file have the same values of them."""

    def content(self) -> dict[str, Any]:
        """Content of the line as a dictionary. Optional keys that the line lacks are left out."""
        return self.model_dump(exclude_unset=True)


class Draws(Line):
    """Fitness and distance (m) of one gait, with one number per draw. A draw is one set of random
    changes of the robot and its surroundings."""

    fitness: Annotated[list[float], Field(min_length=1)]
    distance: Annotated[list[float], Field(min_length=1)]


class EvaluationLine(Line):
    """Line of a record for one evaluation of a gait."""

    identity = ("index",)

    index: WholeNumber
    iteration: WholeNumber
    genome: Annotated[list[float], Field(min_length=1)] | None
    """Parameters of the gait; None in a thinned run."""
    metrics: Annotated[dict[str, Any], AfterValidator(_checked)]
    fitness: float | None
    """Fitness of the gait; None if the evaluation failed."""
    failure: str | None
    wall_time_s: float
    engine: str
    draws: Draws | None = None
    placed: WholeNumber | None = None
    """Index in the population; None if the gait was dropped. Optimisers without a population leave
    the key out."""

    @classmethod
    def of(cls, task: Task, evaluation: Evaluation, **more: Any) -> EvaluationLine:
        """The line for a task and its evaluation. `more` are further keys of the line, such as
        `placed`."""
        if evaluation.draws is not None:
            more = {"draws": dict(evaluation.draws), **more}
        return cls(
            index=task.index,
            iteration=task.iteration,
            genome=task.vector.tolist(),
            metrics=dict(evaluation.metrics),
            fitness=json_number(evaluation.fitness),
            failure=evaluation.failure,
            wall_time_s=round(evaluation.wall_time, 4),
            engine=evaluation.engine,
            **more,
        )

    def evaluation(self) -> Evaluation:
        """The evaluation that the line records."""
        return Evaluation(
            fitness=-math.inf if self.fitness is None else self.fitness,
            metrics=self.metrics,
            failure=self.failure,
            wall_time=self.wall_time_s,
            engine=self.engine,
            draws=None if self.draws is None else self.draws.content(),
        )


class IterationLine(Line):
    """Line of a record for one iteration of an optimiser. What the optimiser reports about the
    iteration, such as mean_fitness, is added as further keys."""

    identity = ("iteration",)

    iteration: WholeNumber
    evaluations: WholeNumber
    best_fitness: float | None
    best_evaluation: WholeNumber | None
    stop: str | None
    mean_fitness: float | None = None


class GaitLine(Line):
    """Line of a record for one gait of any trial."""

    identity = ("trial", "index")

    trial: WholeNumber
    index: WholeNumber


class EliteLine(GaitLine):
    """Line of a record for one elite, simulated on disturbed robots. An elite is the fittest gait
    in a cell of the map that !QualityDiversity fills; see lab.elites.elites."""

    kept: Annotated[float, Field(ge=0, le=1)]
    mean_distance: float | None


class SpreadLine(GaitLine):
    """Line of a record with the least and greatest values of a gait's metrics for moved starts; see
    lab.spread."""

    spread: dict[str, Annotated[list[float], Field(min_length=2, max_length=2)]]


LINES: dict[str, type[Line]] = {
    EVALUATIONS: EvaluationLine,
    ITERATIONS: IterationLine,
    IN_PROGRESS: EvaluationLine,
    REEVALUATIONS: EvaluationLine,
    ELITES: EliteLine,
    SPREADS: SpreadLine,
}
"""Class of the lines by file name."""

_COUNTED = (EVALUATIONS, ITERATIONS)
"""Files whose lines are numbered from 0, without gaps."""


def trial_folder(directory: Path, number: int) -> Path:
    """Folder of a trial in the directory of its run, such as trial_00."""
    return directory / f"trial_{number:02d}"


@dataclass(frozen=True)
class RecordFile:
    """An append-only file of JSON objects, one per line. Each line names its run, so that lines of
    another run are noticed."""

    path: Path
    owner: Mapping[str, Any]
    """First keys and values of each line: run, and trial for a file in a trial's folder."""

    @classmethod
    def of(cls, directory: Path, run: str, name: str, *, trial: int | None = None) -> RecordFile:
        """The file `name` of a run, in the run's directory or in the folder of a trial (its
        number). `run` is the name of the run, which each line has."""
        if trial is None:
            return cls(directory / name, {"run": run})
        return cls(trial_folder(directory, trial) / name, {"run": run, "trial": trial})

    def read(self) -> Iterator[Any]:
        """All complete lines, as objects of the file's class in LINES. Lines that were compressed
        to NAME.xz come first. Yields nothing if there is no file.

        Raises InputError, naming file and line, if a line is damaged, missing, repeated, or belongs
        to another run or trial.
        """
        kind, is_counted = LINES[self.path.name], self.path.name in _COUNTED
        entries = itertools.chain(entries_of(compressed(self.path)), entries_of(self.path))
        seen = set()
        for row, entry in enumerate(entries):
            for key, ours in self.owner.items():
                if (theirs := entry.pop(key, None)) != ours:
                    self.refuse(row, f"is of {key} {theirs}, expected {key} {ours}")
            try:
                line = kind.model_validate(entry)
            except ValidationError as error:
                key, problem = first_problem(error)
                self.refuse(row, f"is damaged: {key}: {problem}; {REMEDY}")

            names = " and ".join(kind.identity)
            numbers = tuple(getattr(line, key) for key in kind.identity)
            if is_counted and numbers != (row,):
                problem = f"is damaged: {names} is {numbers[0]}, expected {row}"
                self.refuse(row, f"{problem}; {REMEDY}")
            if numbers in seen:
                self.refuse(row, f"has {names} of a line before it; {REMEDY}")
            seen.add(numbers)
            yield line

    def append(self, lines: Iterable[Line]) -> None:
        """Appends lines; creates the folder if it is missing. On return the operating system has
        the lines. A kill during the call damages at most the last line."""
        make_folder(self.path.parent)
        text = "".join(json_line({**self.owner, **line.content()}) for line in lines)
        with writing(self.path), self.path.open("ab") as file:
            file.write(text.encode())

    def repair(self) -> None:
        """Cuts off an incomplete last line, which a kill during append() leaves."""
        if not os.path.lexists(self.path):
            return
        content = read_bytes(self.path, "record", most=MOST)
        if not content.endswith(b"\n"):
            with writing(self.path):
                os.truncate(self.path, content.rfind(b"\n") + 1)

    def refuse(self, row: int, problem: str) -> NoReturn:
        """Raises InputError about line `row`, counted from 0. The message counts lines from 1."""
        raise InputError(self.path, f"line {row + 1}", problem)


def first_problem(error: ValidationError) -> tuple[str, str]:
    """Dotted key of the first wrong value of a line, and what is wrong with it, from pydantic's
    error."""
    first = error.errors(include_url=False)[0]
    return ".".join(str(part) for part in first["loc"]), first["msg"]


def compressed(path: Path) -> Path:
    """Path of the file NAME.xz beside a record file NAME. It holds the earlier lines of NAME."""
    return path.with_name(path.name + _PACKED)


def json_line(entry: Mapping[str, Any]) -> str:
    """Line of JSON text for an entry. Its last key, `crc`, is the CRC-32 of the text before it."""
    text = json.dumps(entry, allow_nan=False).removesuffix("}")
    return f'{text}, "crc": "{zlib.crc32(text.encode()):08x}"}}\n'


def entries_of(path: Path) -> Iterator[dict[str, Any]]:
    """The JSON objects of a file's lines, without their checksums; none if there is no file.

    An incomplete last line, which a kill leaves, is left out. Raises InputError for any other
    damaged line. In a compressed file, lines need no checksum, and none may be incomplete.
    """
    if not os.path.lexists(path):
        return
    content, is_packed = read_bytes(path, "record", most=MOST), path.suffix == _PACKED
    if is_packed:
        unpacking = lzma.LZMADecompressor(lzma.FORMAT_XZ, memlimit=MOST)
        try:
            content = unpacking.decompress(content, MOST)
        except lzma.LZMAError as error:
            raise InputError(path, "", f"cannot be read: {error}") from error
        if not unpacking.eof or unpacking.unused_data:
            raise InputError(path, "", f"is cut, or has more than {MOST // 2**20} MB of lines")

    for number, line in enumerate(io.BytesIO(content), start=1):
        is_whole, problem = line.endswith(b"\n"), ""
        if not (is_whole or is_packed):
            return
        match = _CHECKSUM.fullmatch(line.removesuffix(b"\n"))
        entry: Any = None
        with contextlib.suppress(ValueError, RecursionError):
            entry = json.loads(line if match is None else match[1] + b"}")
        if not isinstance(entry, dict):
            problem = "it is no object of JSON"
        if match is None and not is_packed:
            problem = "it has no checksum"
        if not is_whole:
            problem = "it has no end"
        if match is not None and zlib.crc32(match[1]) != int(match[2], 16):
            problem = "its checksum does not match its content"
        if problem:
            raise InputError(path, f"line {number}", f"is damaged: {problem}; {REMEDY}")
        yield entry
