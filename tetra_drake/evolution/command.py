"""The command `tetra-drake evolve`."""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from tetra_drake import arguments
from tetra_drake.errors import InputError, SimulationFailure
from tetra_drake.scenario.load import load_scenario, shipped_scenarios
from tetra_drake.scenario.schema import Scenario

if TYPE_CHECKING:
    from tetra_drake.evolution.record import RunRecord

DEFAULT_SCENARIO = "thesis"
DEFAULT_SEED = 0


def add_evolve(commands: argparse._SubParsersAction) -> None:
    """Registers the command with the parser's subcommands."""
    command = commands.add_parser(
        "evolve",
        help="evolve gaits that walk far",
        description="Evolves gaits by the thesis's evolutionary algorithm, one simulation a "
        "candidate, and records every evaluation in a run directory. Ctrl-C ends it; the same "
        "command with --resume goes on. The result depends on scenario and seed only. In the end "
        "it writes report.html, replay.html and figures/ into the run directory, too.",
    )
    command.add_argument(
        "--scenario",
        metavar="NAME|FILE",
        help=f"a shipped scenario ({', '.join(shipped_scenarios())}) or a YAML file "
        f"(default: {DEFAULT_SCENARIO}; with --resume, the run's)",
    )
    command.add_argument(
        "--out", metavar="DIR", type=Path, required=True, help="the run directory, as runs/NAME"
    )
    arguments.add_engine(command)
    command.add_argument(
        "--trials",
        metavar="N",
        type=arguments.count,
        help="independent trials, instead of the scenario's",
    )
    command.add_argument(
        "--iterations",
        metavar="N",
        type=arguments.count,
        help="iterations of a trial at most, instead of the scenario's",
    )
    command.add_argument(
        "--seed", metavar="N", type=arguments.seed, help=f"of all chance (default: {DEFAULT_SEED})"
    )
    arguments.add_workers(command)
    command.add_argument(
        "--resume", action="store_true", help="go on with an interrupted run; needs only --out"
    )
    command.set_defaults(run=_evolve)


def add_reevaluate(commands: argparse._SubParsersAction) -> None:
    """Registers the command with the parser's subcommands."""
    command = commands.add_parser(
        "reevaluate",
        help="evaluate gaits of a run once more, on the Drake diagram",
        description="Evaluates gaits of a run made on the compiled engine once more, on the Drake "
        "diagram, and keeps that in the run's directory (reevaluations.jsonl of each trial): the "
        "best gaits of each trial, which evolve itself does when it ends, or all initial gaits. "
        "What has been done already is not done again.",
    )
    command.add_argument("run_directory", metavar="RUN", type=Path, help="the run directory")
    command.add_argument(
        "--initial", action="store_true", help="the initial gaits instead of the best"
    )
    arguments.add_workers(command)
    command.set_defaults(run=_reevaluate)


def _reevaluate(options: argparse.Namespace) -> None:
    from tetra_drake.evolution.executors import available_cores
    from tetra_drake.evolution.reevaluation import best_gaits, initial_gaits, reevaluate

    reevaluate(
        options.run_directory,
        initial_gaits if options.initial else best_gaits,
        workers=options.workers or available_cores(),
        progress=_show_progress,
    )


def _show_progress(done: int, total: int) -> None:
    if done % 20 == 0 or done == total:
        print(f"{done} of {total} gaits evaluated on the Drake diagram", flush=True)


def _evolve(options: argparse.Namespace) -> None:
    from tetra_drake.engines.compiled.engine import compile_engine
    from tetra_drake.evolution.evaluation import GaitEvaluation
    from tetra_drake.evolution.executors import available_cores, process_executor, thread_executor
    from tetra_drake.evolution.progress import make_progress
    from tetra_drake.evolution.record import BEST_GAIT, SCENARIO, RunRecord, trial_folder
    from tetra_drake.evolution.run import evolve
    from tetra_drake.evolution.summary import summary

    if options.resume:
        record = RunRecord.resume(
            options.out, scenario=_scenario_to_compare(options), seed=options.seed
        )
    else:
        record = RunRecord.create(
            options.out,
            scenario=_with_options(load_scenario(options.scenario or DEFAULT_SCENARIO), options),
            seed=DEFAULT_SEED if options.seed is None else options.seed,
        )
    workers = options.workers or available_cores()
    with record:
        _introduce(record, workers)
        compiled = record.scenario.simulation.engine == "compiled"
        if compiled:
            compile_engine(record.scenario, lambda message: print(message, flush=True))
        try:
            statuses = evolve(
                record,
                evaluate=GaitEvaluation(record.scenario),
                workers=workers,
                make_executor=thread_executor if compiled else process_executor,
                progress=make_progress(sys.stdout),
            )
            if compiled:
                _reevaluate_best(options.out, workers)
        except KeyboardInterrupt:
            print(
                f"\nnothing is lost; go on with: tetra-drake evolve --out {options.out} --resume",
                file=sys.stderr,
            )
            raise
    print(summary(statuses))
    best = max(statuses, key=lambda status: status.best_fitness)
    if math.isfinite(best.best_fitness):
        print(
            f"see the best gait with: tetra-drake simulate --scenario {options.out / SCENARIO} "
            f"--gait {trial_folder(options.out, best.number) / BEST_GAIT}",
            flush=True,
        )
    _report(options.out)


def _report(directory: Path) -> None:
    """Writes the report; the run is complete, whatever becomes of that."""
    from tetra_drake.report.run_page import write_report

    try:
        written = write_report(directory)
    except Exception as error:
        known = isinstance(error, (InputError, SimulationFailure))
        print(
            "tetra-drake: the run is complete, but its report could not be written: "
            f"{error if known else repr(error)}; try again with: tetra-drake figures {directory}",
            file=sys.stderr,
        )
    else:
        print(f"wrote {', '.join(written)} to {directory}/")


def _scenario_to_compare(options: argparse.Namespace) -> Scenario | None:
    """What the options say of the scenario of a run to resume; None if nothing."""
    from tetra_drake.evolution.record import read_manifest

    if options.scenario is not None:
        return _with_options(load_scenario(options.scenario), options)
    if (options.trials, options.iterations, options.engine) == (None, None, None):
        return None
    return _with_options(read_manifest(options.out).scenario, options)


def _with_options(scenario: Scenario, options: argparse.Namespace) -> Scenario:
    """The scenario with the engine and the numbers of trials and iterations asked for."""
    asked = {
        "simulation.engine": options.engine,
        "evolution.trials": options.trials,
        "evolution.max_iterations": options.iterations,
    }
    return scenario.with_changes({key: value for key, value in asked.items() if value is not None})


def _reevaluate_best(directory: Path, workers: int) -> None:
    from tetra_drake.evolution.reevaluation import best_distances, best_gaits, reevaluate
    from tetra_drake.evolution.tables import load_run

    print("evaluating the best gaits of each trial on the Drake diagram", flush=True)
    reevaluate(directory, best_gaits, workers=workers)
    for trial, compiled_in, drake_in in best_distances(load_run(directory)):
        print(f"trial {trial}: best gait {compiled_in:.2f} in, on the diagram {drake_in:.2f} in")


def _introduce(record: RunRecord, workers: int) -> None:
    from tetra_drake.results.result import versions

    settings = record.scenario.evolution
    print(
        f"{record.directory}: scenario {record.scenario.name}, seed {record.seed}, "
        f"{settings.trials} trial{'s' if settings.trials > 1 else ''} of at most "
        f"{settings.max_iterations} iterations, population {settings.population}, "
        f"engine {record.scenario.simulation.engine}, "
        f"{workers} worker{'s' if workers > 1 else ''}",
        flush=True,
    )
    now = versions()
    changed = [name for name in now if record.versions_then.get(name) != now[name]]
    if changed:
        then = ", ".join(f"{name} {record.versions_then.get(name)}" for name in changed)
        print(
            f"tetra-drake: the run was begun with {then}; with other versions it ends "
            "differently from an uninterrupted one",
            file=sys.stderr,
        )
