"""All tables of the experiment by their names, and the files they go into."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from tetra_drake.errors import InputError
from tetra_drake.experiment.comparison import comparison_table
from tetra_drake.experiment.markdown import fill_tables
from tetra_drake.experiment.recorded import Experiment
from tetra_drake.experiment.trust import (
    best_gaits_table,
    engines_table,
    resimulation_table,
    robust_gaits_table,
    robustness_table,
    runs_table,
    tau_mutation_table,
)
from tetra_drake.files import write_whole

TABLES: Mapping[str, Callable[[Experiment], str]] = {
    "comparison": comparison_table,
    "runs": runs_table,
    "best-gaits": best_gaits_table,
    "resimulation": resimulation_table,
    "robustness": robustness_table,
    "robust-gaits": robust_gaits_table,
    "tau-mutation": tau_mutation_table,
    "engines": engines_table,
}


def filled(path: Path, experiment: Experiment) -> str:
    """The text of a Markdown file with its tables made of the experiment.

    Raises InputError if the file cannot be read or its marker lines are no good.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError as error:
        raise InputError(path, "", "no such file") from error
    except (OSError, ValueError) as error:
        raise InputError(path, "", f"cannot be read as a text file: {error}") from error
    return fill_tables(text, lambda name: TABLES[name](experiment), source=path)


def write_tables(paths: Iterable[Path], experiment: Experiment) -> None:
    """Fills the tables of Markdown files; of all, or, if one is no good, of none."""
    texts = {path: filled(path, experiment) for path in paths}
    for path, text in texts.items():
        write_whole(path, text)
