"""What these scripts have in common: command line, settings, records, figures, evolution."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from matplotlib.axes import Axes

from tetra_drake.engines.simulate import Outcome
from tetra_drake.errors import InputError
from tetra_drake.evolution.manifest import MANIFEST
from tetra_drake.evolution.progress import Progress
from tetra_drake.evolution.run import Run
from tetra_drake.experiment import evolve
from tetra_drake.files import read_json, read_text
from tetra_drake.formatting import listed
from tetra_drake.interrupts import heeding_interrupts
from tetra_drake.optimizers import MakeOptimizer
from tetra_drake.results.result import SimulationResult
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.scenario.yaml_text import parse_yaml

T = TypeVar("T")
Main = TypeVar("Main", bound=Callable[..., None])


def script(main: Main) -> Main:
    """Decorator of a script's main function, the last one of its file. Where the file is the script
    that was started, it runs with the arguments, or shows the docstring for --help. An InputError
    and an interrupt end it with one line."""
    name, arguments = Path(sys.argv[0]).name, sys.argv[1:]
    if main.__module__ != "__main__":
        return main
    if {"-h", "--help"} & {*arguments}:
        sys.exit(sys.modules["__main__"].__doc__)
    try:
        with heeding_interrupts():
            main(arguments)
    except InputError as error:
        sys.exit(f"{name}: {error}")
    except KeyboardInterrupt:
        sys.exit(f"{name}: interrupted; the same command goes on")
    return main


def chosen(names: Sequence[str], known: Iterable[str], what: str = "NAME") -> list[str]:
    """The given names, or all known ones without any. Raises InputError for an unknown name."""
    every = [*known]
    if unknown := sorted({*names} - {*every}):
        raise InputError(what, "", f"found {listed(unknown)}, expected {listed(every)}")
    return [*names] or every


def read_settings(file: Path) -> Any:
    """Content of a YAML file. Raises InputError if it cannot be read."""
    return parse_yaml(read_text(file, "settings"), file)


def with_defaults(given: Mapping[str, Any], defaults: Mapping[str, Any], file: Path) -> Any:
    """An entry of a file of settings, with the defaults of what it leaves out. Raises InputError
    for a key without a default."""
    if unknown := given.keys() - defaults.keys():
        raise InputError(file, min(unknown), f"is unknown, expected one of {listed([*defaults])}")
    return {**defaults, **given}


def read_record(path: Path, use: Callable[[Any], T], command: str) -> T:
    """What a function makes of a record in JSON. Raises InputError, which names the command that
    makes the record, if it is missing or damaged."""
    content = read_json(path, f"record; run `python runs/{command}`")
    try:
        return use(content)
    except (InputError, AttributeError, LookupError, TypeError, ValueError) as error:
        problem = f"cannot be read ({error!r}); run `python runs/{command}`"
        raise InputError(path, "", problem) from error


def measured(walk: Outcome, metric: str) -> float:
    """A metric of a simulation, such as "distance_in"; NaN if it failed."""
    return getattr(walk.metrics, metric) if isinstance(walk, SimulationResult) else math.nan


def draw_dots(axes: Axes, values: Mapping[str, np.ndarray], best: float) -> None:
    """Draws values as dots in a row per name, from the top, and a line at the best one."""
    for place, row in enumerate(values.values()):
        axes.plot(row, np.full(row.shape, place), "o", color=f"C{place}", alpha=0.6, ms=4)
    axes.axvline(best, color="0.7", linewidth=0.8)
    axes.set_yticks(range(len(values)), [*values])
    axes.set_ylim(len(values) - 0.5, -0.5)


def evolved(scenario: Scenario, folder: Path, optimizer: MakeOptimizer | None = None) -> Run:
    """Run of a scenario in a folder, evolved as far as it is not yet, by the scenario's optimiser
    or another."""
    return evolve(
        scenario,
        folder,
        resume=(folder / MANIFEST).exists(),
        optimizer=optimizer,
        reevaluate=False,
        report=False,
        progress=Progress(sys.stdout),
    )
