"""The command `tetra-drake bench`."""

from __future__ import annotations

import argparse
import contextlib
import json
import sys
from pathlib import Path

from tetra_drake import arguments
from tetra_drake.errors import InputError
from tetra_drake.files import whole_file
from tetra_drake.robot.gait import Gait, load_gait, seeded_gait
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.schema import Scenario

DEFAULT_GAITS = 12


def add_bench(commands: argparse._SubParsersAction) -> None:
    """Registers the command with the parser's subcommands."""
    command = commands.add_parser(
        "bench",
        help="measure both engines, and MuJoCo beside them: speed, error, cost by size",
        description="Walks gaits on the Drake diagram, on the compiled engine, and, if it is "
        "installed, in MuJoCo, and prints how many times faster than real time each is and how far "
        "its distances are from converged ones; then what a step of the compiled engine costs by "
        "number of tetrahedra. Takes some minutes; the times mean something on an idle machine.",
    )
    command.add_argument(
        "gaits", metavar="GAIT", type=Path, nargs="*", help="gait files; else gaits at random"
    )
    command.add_argument(
        "--gaits",
        dest="number",
        metavar="N",
        type=arguments.count,
        help=f"how many gaits at random, of the seeds 0, 1 ... (default: {DEFAULT_GAITS})",
    )
    arguments.add_scenario(command)
    command.add_argument(
        "--json", metavar="FILE", type=Path, help="write everything measured to a JSON file, too"
    )
    command.set_defaults(run=_bench)


def _bench(options: argparse.Namespace) -> None:
    scenario = load_scenario(options.scenario)
    gaits = _gaits(options, scenario)
    with contextlib.ExitStack() as stack:
        # Opened first: a path that cannot be written is refused before minutes are spent.
        file = stack.enter_context(whole_file(options.json)) if options.json else None

        from tetra_drake.benchmark.measure import measure
        from tetra_drake.benchmark.tables import measurement_to_json, summary
        from tetra_drake.evolution.executors import available_cores

        measurement = measure(scenario, gaits, cores=available_cores(), say=_say)
        print(summary(measurement))
        if file is not None:
            content = measurement_to_json(measurement)
            file.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def _gaits(options: argparse.Namespace, scenario: Scenario) -> list[Gait]:
    if not options.gaits:
        return [seeded_gait(scenario, seed) for seed in range(options.number or DEFAULT_GAITS)]
    if options.number is not None:
        raise InputError("--gaits", "", "not allowed with gait files")
    return [load_gait(path, scenario) for path in options.gaits]


def _say(stage: str) -> None:
    print(f"{stage} ...", file=sys.stderr, flush=True)
