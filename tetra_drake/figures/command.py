"""The command `tetra-drake figures`."""

from __future__ import annotations

import argparse
from pathlib import Path


def add_figures(commands: argparse._SubParsersAction) -> None:
    """Registers the command with the parser's subcommands."""
    command = commands.add_parser(
        "figures",
        help="draw the thesis's figures of a run or a simulation",
        description="Draws the thesis's figures, each as SVG and PNG, and Table 8 as CSV. For a "
        "run of `evolve`, finished or not: all of them, into figures/ in its directory, where "
        "report.html and replay.html are made anew, too. For a folder written by `simulate`: those "
        "for which one gait is enough, into figures/ in it.",
    )
    command.add_argument(
        "source",
        metavar="RUN_DIR|RESULT_DIR",
        type=Path,
        help="a folder written by `evolve` or by `simulate`",
    )
    command.add_argument(
        "--out",
        metavar="DIR",
        type=Path,
        help="draw into this folder instead, and leave the source as it is",
    )
    command.set_defaults(run=_figures)


def _figures(options: argparse.Namespace) -> None:
    from tetra_drake.errors import InputError
    from tetra_drake.evolution.record import MANIFEST
    from tetra_drake.evolution.study import study_run
    from tetra_drake.figures.book import draw_recording, draw_run
    from tetra_drake.files import check_folder
    from tetra_drake.report.run_page import FIGURES, write_report
    from tetra_drake.results.folder import RESULT, load_result_folder

    source, out = options.source, options.out
    if not ((source / MANIFEST).exists() or (source / RESULT).exists()):
        problem = f"holds neither {MANIFEST}, as `evolve` writes, nor {RESULT}, as `simulate` does"
        raise InputError(source, "", problem)
    check_folder(out or source / FIGURES)
    if not (source / MANIFEST).exists():
        pictures = draw_recording(load_result_folder(source), out or source / FIGURES)
    elif out is not None:
        pictures = draw_run(study_run(source), out)
    else:
        print(f"wrote {', '.join(write_report(source))} to {source}/")
        return
    print(f"wrote {len(pictures)} figures to {out or source / FIGURES}/")
