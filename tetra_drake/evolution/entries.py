"""Files of a run's record and the content of their lines.

trial_00/
  evaluations.jsonl       one line per evaluation, in the optimiser's order; metrics in SI
  iterations.jsonl        one line per iteration: best fitness, the optimiser's report
  in_progress.jsonl       evaluations of the current iteration that are done
  best_gait.json          gait file of the fittest gait so far
  reevaluations.jsonl     gaits evaluated once more on the Drake diagram
elites.jsonl              the map's gaits on disturbed robots (only with !QualityDiversity)

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
from typing import Annotated, Any, NamedTuple, NoReturn

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from tetra_drake.errors import InputError
from tetra_drake.files import json_number, make_folder, read_bytes, writing
from tetra_drake.optimizers.base import Evaluation, Task
from tetra_drake.scenario.metrics import wrong_metric

EVALUATIONS, ITERATIONS = "evaluations.jsonl", "iterations.jsonl"
IN_PROGRESS, BEST_GAIT = "in_progress.jsonl", "best_gait.json"
REEVALUATIONS, ELITES = "reevaluations.jsonl", "elites.jsonl"

MOST = 2**30
"""Largest size of a file, and of its earlier lines when they are not compressed, in bytes."""

REMEDY = (
    "cut this line and those after it off the file, and `tetra-drake evolve --resume` makes good "
    "what is missing"
)

_CHECKSUM = re.compile(rb'(.*), "crc": "([0-9a-f]{8})"\}')
"""Pattern of a line: its content, then the CRC-32 of the content in hexadecimal digits."""


def _checked(metrics: dict[str, Any]) -> dict[str, Any]:
    """The metrics. Raises ValueError if one is of a wrong type."""
    if name := wrong_metric(metrics):
        raise ValueError(f"{name} is of a wrong type")
    return metrics


_Count = Annotated[int, Field(ge=0, lt=2**31)]


class _Line(BaseModel):
    """Keys and types of a line. Further keys are ignored."""

    model_config = ConfigDict(strict=True, allow_inf_nan=False)


class _Draws(_Line):
    """Numbers of each draw of disturbances."""

    fitness: Annotated[list[float], Field(min_length=1)]
    distance: Annotated[list[float], Field(min_length=1)]


class _EvaluationLine(_Line):
    """Keys of an evaluation; `genome` is None in a thinned run."""

    index: _Count
    iteration: _Count
    genome: Annotated[list[float], Field(min_length=1)] | None
    metrics: Annotated[dict[str, Any], AfterValidator(_checked)]
    fitness: float | None
    failure: str | None
    wall_time_s: float
    engine: str
    placed: _Count | None = None
    draws: _Draws | None = None


class _IterationLine(_Line):
    """Keys of an iteration; `mean_fitness` is in the report of some optimisers."""

    iteration: _Count
    evaluations: _Count
    best_fitness: float | None
    best_evaluation: _Count | None
    stop: str | None
    mean_fitness: float | None = None


class _EliteLine(_Line):
    """Keys of an elite on disturbed robots."""

    trial: _Count
    index: _Count
    kept: Annotated[float, Field(ge=0, le=1)]
    mean_distance: float | None


class _Schema(NamedTuple):
    """Schema of the lines of a file."""

    line: type[_Line]
    keys: tuple[str, ...]
    """Keys whose values together are unique among the lines."""
    is_counted: bool = False
    """True if the single key is the number of the line, from 0."""


_SCHEMAS = {
    EVALUATIONS: _Schema(_EvaluationLine, ("index",), is_counted=True),
    ITERATIONS: _Schema(_IterationLine, ("iteration",), is_counted=True),
    IN_PROGRESS: _Schema(_EvaluationLine, ("index",)),
    REEVALUATIONS: _Schema(_EvaluationLine, ("index",)),
    ELITES: _Schema(_EliteLine, ("trial", "index")),
}
"""Schemas by file name."""


def trial_folder(directory: Path, number: int) -> Path:
    """The folder of a trial."""
    return directory / f"trial_{number:02d}"


def evaluation_entry(task: Task, evaluation: Evaluation) -> dict[str, Any]:
    """An evaluation as a line of the record; the fitness of a failure is null."""
    entry = {
        "index": task.index,
        "iteration": task.iteration,
        "genome": task.vector.tolist(),
        "metrics": dict(evaluation.metrics),
        "fitness": json_number(evaluation.fitness),
        "failure": evaluation.failure,
        "wall_time_s": round(evaluation.wall_time, 4),
        "engine": evaluation.engine,
    }
    if evaluation.draws is not None:
        entry["draws"] = dict(evaluation.draws)
    return entry


def recorded_evaluation(entry: Mapping[str, Any]) -> Evaluation:
    """The evaluation that a line of the record holds; inverse of evaluation_entry()."""
    return Evaluation(
        fitness=-math.inf if entry["fitness"] is None else entry["fitness"],
        metrics=entry["metrics"],
        failure=entry["failure"],
        wall_time=entry["wall_time_s"],
        engine=entry["engine"],
        draws=entry.get("draws"),
    )


@dataclass(frozen=True)
class RecordFile:
    """An append-only file of JSON objects, one per line. Each line names its run, so foreign lines
    are found."""

    path: Path
    owner: Mapping[str, Any]
    """First keys and values of each line: run, and trial for a file in a trial's folder."""

    @classmethod
    def of(cls, directory: Path, run: str, name: str, *, trial: int | None = None) -> RecordFile:
        """The file `name` in the directory of a run, or in the folder of a trial."""
        if trial is None:
            return cls(directory / name, {"run": run})
        return cls(trial_folder(directory, trial) / name, {"run": run, "trial": trial})

    def read(self) -> list[dict[str, Any]]:
        """The content of all complete lines, compressed or not, without the keys of `owner`. Empty
        if there is no file.

        Raises InputError, naming file and line, if a line is damaged, missing, repeated, or belongs
        to another run or trial.
        """
        packed, schema = compressed(self.path), _SCHEMAS[self.path.name]
        earlier = _parse(_unpacked(packed), packed, is_packed=True)
        later = _parse(_read(self.path), self.path, is_packed=False)
        entries: dict[tuple[int, ...], dict[str, Any]] = {}
        for row, entry in enumerate(itertools.chain(earlier, later)):
            for key, ours in self.owner.items():
                if (theirs := entry.pop(key, None)) != ours:
                    self.refuse(row, f"is of {key} {theirs}, expected {key} {ours}")
            try:
                schema.line.model_validate(entry)
            except ValidationError as error:
                first = error.errors(include_url=False)[0]
                key = ".".join(str(part) for part in first["loc"])
                self.refuse(row, f"is damaged: {key}: {first['msg']}; {REMEDY}")
            values, keys = tuple(entry[key] for key in schema.keys), " and ".join(schema.keys)
            if schema.is_counted and values != (row,):
                problem = f"is damaged: {keys} is {values[0]}, expected {row}"
                self.refuse(row, f"{problem}; {REMEDY}")
            if values in entries:
                self.refuse(row, f"has {keys} of a line before it; {REMEDY}")
            entries[values] = entry
        return list(entries.values())

    def append(self, entries: Iterable[Mapping[str, Any]]) -> None:
        """Appends lines; creates the folder if it is missing. On return the operating system has
        the lines. A kill during the call damages at most the last line."""
        make_folder(self.path.parent)
        text = "".join(json_line({**self.owner, **entry}) for entry in entries)
        with writing(self.path), self.path.open("ab") as file:
            file.write(text.encode())

    def repair(self) -> None:
        """Cuts off an incomplete last line."""
        content = _read(self.path)
        if content and not content.endswith(b"\n"):
            with writing(self.path):
                os.truncate(self.path, content.rfind(b"\n") + 1)

    def refuse(self, row: int, problem: str) -> NoReturn:
        """Raises InputError about the line with this number, counted from 0."""
        raise InputError(self.path, f"line {row + 1}", problem)


def compressed(path: Path) -> Path:
    """Path of the compressed file with the lines that precede the lines of `path`."""
    return path.with_name(path.name + ".xz")


def json_line(entry: Mapping[str, Any]) -> str:
    """An entry as a line of text with a checksum."""
    text = json.dumps(entry, allow_nan=False).removesuffix("}")
    return f'{text}, "crc": "{zlib.crc32(text.encode()):08x}"}}\n'


def _read(path: Path) -> bytes:
    """Content of a file, empty if there is none. Raises InputError if it cannot be read."""
    try:
        return read_bytes(path, "record", most=MOST)
    except InputError as error:
        if isinstance(error.__cause__, FileNotFoundError):
            return b""
        raise


def _unpacked(path: Path) -> bytes:
    """Content of a compressed file, empty if there is none. Raises InputError if it is damaged."""
    if not os.path.lexists(path):
        return b""
    unpacking = lzma.LZMADecompressor(lzma.FORMAT_XZ, memlimit=MOST)
    try:
        content = unpacking.decompress(read_bytes(path, "record", most=MOST), MOST)
    except lzma.LZMAError as error:
        raise InputError(path, "", f"cannot be read: {error}") from error
    if not unpacking.eof or unpacking.unused_data:
        raise InputError(path, "", f"is cut, or has more than {MOST // 2**20} MB of lines")
    return content


def _parse(content: bytes, file: Path, *, is_packed: bool) -> Iterator[dict[str, Any]]:
    """The entries of a file's lines. A line has a checksum unless it is packed. A kill may have cut
    the last line, but not before it was packed."""
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
            raise InputError(file, f"line {number}", f"is damaged: {problem}; {REMEDY}")
        yield entry
