"""The command `tetra-drake replay`."""

from __future__ import annotations

import argparse
from pathlib import Path

from tetra_drake.scenario.load import shipped_scenarios


def add_replay(commands: argparse._SubParsersAction) -> None:
    """Registers the command with the parser's subcommands."""
    command = commands.add_parser(
        "replay",
        help="make a page that shows a gait in a browser",
        description="Writes one HTML page that shows the robot walk, in any browser, without "
        "server or network: from the trajectory that `simulate` recorded, or by simulating a "
        "gait file, or the best gait of a run of `evolve` on the run's scenario.",
    )
    command.add_argument(
        "source",
        metavar="RESULT_DIR|GAIT|RUN_DIR",
        type=Path,
        help="a folder written by `simulate`, a gait file, or a folder written by `evolve`",
    )
    command.add_argument(
        "--scenario",
        metavar="NAME|FILE",
        help=f"for a gait file: a shipped scenario ({', '.join(shipped_scenarios())}) or a YAML "
        "file (default: thesis)",
    )
    command.add_argument(
        "--out", metavar="FILE", type=Path, required=True, help="the HTML file to write"
    )
    command.set_defaults(run=_replay)


def _replay(options: argparse.Namespace) -> None:
    from tetra_drake.errors import InputError
    from tetra_drake.files import check_folder
    from tetra_drake.report.recording import load_recording
    from tetra_drake.visualization.replay import replay_title, save_replay

    if options.out.is_dir():
        raise InputError(options.out, "", "is a directory, expected a file to write")
    check_folder(options.out.parent)
    recording = load_recording(options.source, scenario=options.scenario)
    title = replay_title(recording.gait.name, recording.trajectory)
    save_replay(
        options.out, scenario=recording.scenario, trajectory=recording.trajectory, title=title
    )
    print(f"{title}\nwrote {options.out}")
