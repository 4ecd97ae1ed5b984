"""The commands `tetra-drake analyse` and `tetra-drake tables`."""

from __future__ import annotations

import argparse
from pathlib import Path

from tetra_drake import arguments


def add_analyse(commands: argparse._SubParsersAction) -> None:
    """Registers `analyse` with the parser's subcommands."""
    command = commands.add_parser(
        "analyse",
        help="simulate the best gaits of a run under other conditions",
        description="Simulates the best gait of each trial of a run with other integrator "
        "settings, and with robot and surroundings a few percent off, and writes what comes of "
        "it to analysis.json in the run's directory, for `tables`. Draws figures/engines there, "
        "how far the two engines agree, if the initial gaits were re-evaluated.",
    )
    command.add_argument("run_dir", metavar="RUN", type=Path, help="a folder written by `evolve`")
    arguments.add_workers(command)
    command.set_defaults(run=_analyse)


def _analyse(options: argparse.Namespace) -> None:
    from tetra_drake.evolution.executors import available_cores
    from tetra_drake.evolution.tables import load_run
    from tetra_drake.experiment.analysis import ANALYSIS, analyse
    from tetra_drake.experiment.engines import FIGURE, draw_engines
    from tetra_drake.report.run_page import FIGURES

    directory = options.run_dir
    analyse(
        directory,
        workers=options.workers or available_cores(),
        announce=lambda message: print(message, flush=True),
    )
    drawn = draw_engines(load_run(directory), directory / FIGURES)
    figures = f" and {FIGURES}/{FIGURE}.svg, .png" if drawn else ""
    print(f"wrote {ANALYSIS}{figures} to {directory}/")


def add_tables(commands: argparse._SubParsersAction) -> None:
    """Registers `tables` with the parser's subcommands."""
    command = commands.add_parser(
        "tables",
        help="make the tables of the thesis's experiment",
        description="Makes the tables of the experiment from the runs thesis, thesis-listing and "
        "thesis-drake (those there are) and what `analyse` wrote of them, and prints them or puts "
        "them between the marker lines of Markdown files.",
    )
    command.add_argument(
        "runs_dir", metavar="RUNS_DIR", type=Path, help="the folder that holds the runs"
    )
    command.add_argument(
        "--into",
        metavar="FILE",
        type=Path,
        action="append",
        default=[],
        help="a Markdown file in which each table stands between the lines "
        "`<!-- table NAME: made by tetra-drake tables -->` and `<!-- end -->`; may be given again",
    )
    command.set_defaults(run=_tables)


def _tables(options: argparse.Namespace) -> None:
    from tetra_drake.experiment.recorded import load_experiment
    from tetra_drake.experiment.tables import TABLES, write_tables

    experiment = load_experiment(options.runs_dir)
    if options.into:
        write_tables(options.into, experiment)
        print(f"made the tables in {', '.join(str(path) for path in options.into)}")
        return
    print("\n\n".join(f"{name}\n\n{make(experiment)}" for name, make in TABLES.items()))
