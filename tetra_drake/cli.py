"""The command line: `tetra-drake COMMAND ...`."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from tetra_drake import arguments
from tetra_drake.errors import InputError, SimulationFailure
from tetra_drake.evolution.command import add_evolve
from tetra_drake.gait import WALKING_SEED, Gait, load_gait, seeded_gait
from tetra_drake.scenario import Scenario, load_scenario, shipped_scenarios

BAD_INPUT, FAILED = 2, 1
"""Exit statuses: the input cannot be used; the simulation failed."""


def main(argv: Sequence[str] | None = None) -> int:
    """Runs one command; returns the exit status."""
    options = make_parser().parse_args(argv)
    try:
        options.run(options)
    except InputError as error:
        print(f"tetra-drake: {error}", file=sys.stderr)
        return BAD_INPUT
    except SimulationFailure as error:
        print(f"tetra-drake: {error}", file=sys.stderr)
        return FAILED
    except BrokenPipeError:  # who read our output has closed it, as `| head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return FAILED
    except KeyboardInterrupt:
        print("tetra-drake: interrupted", file=sys.stderr)
        return 130
    return 0


def make_parser() -> argparse.ArgumentParser:
    """The parser of all commands; each sets `run`, a function of the parsed options."""
    parser = argparse.ArgumentParser(
        prog="tetra-drake",
        description="Simulate a walking tensegrity robot, five nested tetrahedra driven by a "
        "Matsuoka central pattern generator, as a Drake diagram.",
        epilog="`tetra-drake COMMAND --help` explains a command.",
    )
    commands = parser.add_subparsers(metavar="COMMAND", required=True)
    _add_simulate(commands)
    add_evolve(commands)
    _add_cpg(commands)
    _add_diagram(commands)
    _add_work_precision(commands)
    return parser


def _add_simulate(commands: argparse._SubParsersAction) -> None:
    command = commands.add_parser(
        "simulate",
        help="simulate one gait and say how far it walks",
        description="Builds one diagram for one gait, simulates it, prints how far and how "
        "straight the robot walked, and writes result.json (the numbers), trajectory.nc (motion "
        "and forces over time, for xarray) and replay.html (open it in a browser).",
    )
    _add_scenario(command)
    _add_gait(command)
    command.add_argument(
        "--out",
        metavar="DIR",
        type=Path,
        default=Path("out"),
        help="the folder to write to, made if missing (default: %(default)s)",
    )
    command.set_defaults(run=_simulate)


def _simulate(options: argparse.Namespace) -> None:
    from tetra_drake.files import check_folder
    from tetra_drake.replay import save_replay
    from tetra_drake.results import save_result, summary
    from tetra_drake.simulation import simulate
    from tetra_drake.trajectory import save_dataset

    scenario = load_scenario(options.scenario)
    gait = _gait(options, scenario)
    check_folder(options.out)
    result = simulate(scenario=scenario, gait=gait, record=True)
    assert result.trajectory is not None
    print(summary(scenario, gait, result))
    save_dataset(result.trajectory, options.out / "trajectory.nc")
    save_replay(
        options.out / "replay.html",
        scenario=scenario,
        trajectory=result.trajectory,
        title=f"{gait.name}: {result.metrics.distance_in:.2f} in in {result.duration:g} s",
    )
    save_result(options.out / "result.json", scenario, gait, result)
    print(f"wrote result.json, trajectory.nc and replay.html to {options.out}/")


def _add_cpg(commands: argparse._SubParsersAction) -> None:
    command = commands.add_parser(
        "cpg",
        help="write the oscillator signals of a gait to a CSV file",
        description="Integrates the oscillator network of a gait alone, with error control, and "
        "writes its signals: time_s, then signal_1, signal_2 ... in lbf, zero before the start-up "
        "time. (Scenarios whose cpg.signals is `listing`, such as thesis, feed the robot what "
        "--listing writes.)",
    )
    _add_scenario(command)
    _add_gait(command)
    command.add_argument(
        "--out", metavar="FILE", type=Path, required=True, help="the CSV file to write"
    )
    command.add_argument(
        "--raw",
        action="store_true",
        help="write y_extensor - y_flexor: no gain, and no zeros before the start-up time",
    )
    command.add_argument(
        "--listing",
        action="store_true",
        help="step the network as the thesis's listing does: forward Euler, 0.5 ms",
    )
    command.set_defaults(run=_cpg)


def _cpg(options: argparse.Namespace) -> None:
    from tetra_drake.signals import save_signals

    scenario = load_scenario(options.scenario)
    gait = _gait(options, scenario)
    save_signals(options.out, scenario, gait, raw=options.raw, listing=options.listing)


def _add_diagram(commands: argparse._SubParsersAction) -> None:
    command = commands.add_parser(
        "diagram",
        help="draw the block diagram",
        description="Draws the block diagram of the robot. FILE.dot is Graphviz source; .svg, "
        ".png and .pdf are drawn by Graphviz's program `dot`, which must be installed.",
    )
    _add_scenario(command)
    command.add_argument(
        "--out", metavar="FILE", type=Path, required=True, help="the file to write"
    )
    command.set_defaults(run=_diagram)


def _diagram(options: argparse.Namespace) -> None:
    from tetra_drake.diagram import MakeTensegrityDiagram
    from tetra_drake.figures.block_diagram import save_block_diagram

    scenario = load_scenario(options.scenario)
    save_block_diagram(MakeTensegrityDiagram(scenario, seeded_gait(scenario)), options.out)


def _add_work_precision(commands: argparse._SubParsersAction) -> None:
    command = commands.add_parser(
        "work-precision",
        help="measure what each integrator setting costs and how exact it is",
        description="Simulates gaits with many integrator settings and prints, for each, the "
        "distance error against a converged run, derivative evaluations and wall time.",
    )
    _add_scenario(command)
    command.add_argument(
        "gaits", metavar="GAIT", type=Path, nargs="+", help="gait files; at least six say something"
    )
    command.add_argument(
        "--workers",
        type=arguments.count,
        default=1,
        help="processes; 1 for times that mean something",
    )
    command.set_defaults(run=_work_precision)


def _work_precision(options: argparse.Namespace) -> None:
    from tetra_drake.work_precision import HEADER, format_row, measure

    scenario = load_scenario(options.scenario)
    gaits = [load_gait(path, oscillators=scenario.oscillators) for path in options.gaits]
    print(HEADER)
    for row in measure(scenario, gaits, workers=options.workers):
        print(format_row(row, scenario.simulation.duration), flush=True)


def _add_scenario(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--scenario",
        metavar="NAME|FILE",
        default="thesis",
        help=f"a shipped scenario ({', '.join(shipped_scenarios())}) or a YAML file "
        "(default: %(default)s)",
    )


def _add_gait(command: argparse.ArgumentParser) -> None:
    group = command.add_mutually_exclusive_group()
    group.add_argument("--gait", metavar="FILE", type=Path, help="a gait file (JSON)")
    group.add_argument(
        "--seed",
        metavar="N",
        type=arguments.seed,
        default=WALKING_SEED,
        help="instead, a gait drawn at random with this seed (default: %(default)s, which walks)",
    )


def _gait(options: argparse.Namespace, scenario: Scenario) -> Gait:
    if options.gait is not None:
        return load_gait(options.gait, oscillators=scenario.oscillators)
    return seeded_gait(scenario, options.seed)


if __name__ == "__main__":
    sys.exit(main())
