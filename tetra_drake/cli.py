"""The command line: each command is a function whose parameters are its options."""

from __future__ import annotations

import contextlib
import dataclasses
import io
import itertools
import json
import os
import shlex
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tetra_drake import __version__
from tetra_drake.command_options import (
    Cluster,
    CommandFile,
    Count,
    EngineName,
    File,
    Folder,
    FontSize,
    GaitPath,
    GaitSeed,
    Rate,
    ResultOrGait,
    RunOrResult,
    ScenarioName,
    Seed,
    Width,
    print_of,
    say,
    scenario_and_gait,
    warn,
)
from tetra_drake.errors import InputError, SimulationFailure
from tetra_drake.files import check_file
from tetra_drake.interrupts import heeding_interrupts
from tetra_drake.on_demand import loaded
from tetra_drake.options import BAD_INPUT, Parser
from tetra_drake.settings.units import INCH, SYSTEMS, shown_in

if TYPE_CHECKING:
    from tetra_drake.scenario.scenario import Scenario

FAILED, INTERRUPTED = 1, 130  # exit statuses beside BAD_INPUT


def main(argv: Sequence[str] | None = None) -> int:
    """Runs one command with arguments `argv`, by default the process's. Returns the exit status."""
    for name in ("stdout", "stderr"):
        # A shell may have closed it.
        stream = getattr(sys, name) or open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
        setattr(sys, name, stream)
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    command, options = make_parser().call_of(argv)
    units = options.pop("units")
    try:
        with heeding_interrupts(), shown_in(units):
            command(**options)
            sys.stdout.flush()
    except (InputError, SimulationFailure) as error:
        print(f"tetra-drake: {error}", file=sys.stderr)
        return BAD_INPUT if isinstance(error, InputError) else FAILED
    except OSError as error:
        # The reader of our output has closed it, such as `| head`; or the disk is full.
        if not isinstance(error, BrokenPipeError):
            what = error.filename or "output"
            print(f"tetra-drake: {what}: {error.strerror or error}", file=sys.stderr)
        try:  # Python would try to write at its end what was printed but not written
            sys.stdout.flush()
        except OSError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return FAILED
    except KeyboardInterrupt as interrupt:
        print("\ntetra-drake: interrupted", *interrupt.args, file=sys.stderr)
        return INTERRUPTED
    return 0


def make_parser() -> Parser:
    """The parser of all commands."""
    parser = Parser(
        prog="tetra-drake",
        description="Simulate a walking tensegrity robot, nested tetrahedra driven by a Matsuoka "
        "central pattern generator, as a Drake diagram, and evolve its gaits.",
        epilog="`tetra-drake COMMAND --help` explains a command.",
    )
    parser.add_argument("--version", action="version", version=f"%(prog)s {__version__}")
    common = Parser(add_help=False)
    common.add_argument(
        "--units",
        choices=[*SYSTEMS],
        help="units of lengths and forces in texts, pages and figures (default: the units in which "
        "the robot's lengths are round, or mm if it is given in mm)",
    )
    commands: list[Callable[..., None]] = [
        _simulate,
        _evolve,
        _replay,
        _figures,
        _cpg,
        _schema,
        _prepare,
        *loaded("tetra_drake.lab.commands:COMMANDS"),
    ]
    parser.add_commands(commands, common=common)
    return parser


def _simulate(
    gait: GaitPath | None = None,
    *,
    scenario: ScenarioName | None = None,
    seed: GaitSeed | None = None,
    command: CommandFile | None = None,
    engine: EngineName | None = None,
    out: Folder = Path("out"),
    spread: bool = False,
    meshcat: bool = False,
) -> None:
    """Simulate one gait.

    Simulates one gait, or a robot that follows a file of commands, and prints its metrics. Writes
    result.json (the numbers), trajectory.nc (motion and forces over time, for xarray), replay.html
    (open it in a browser) and scenario.yaml (all settings).

    Args:
        scenario: (default: the scenario of the gait's run or beside the command; else thesis)
        out: the folder to write to (default: %(default)s)
        spread: simulate 30 more starts, moved by 1 nm to 1e-7 m, and show the ranges of the numbers
        meshcat: show the robot in a browser while Drake simulates it, in real time at most

    Example: tetra-drake simulate --scenario coulomb --seed 3 --out out
    """
    from tetra_drake.engines.engine import check_can_be_watched, engine_of
    from tetra_drake.engines.simulate import simulate
    from tetra_drake.report.result_folder import REPLAY, check_result_folder, save_result_folder
    from tetra_drake.report.summary import result_text
    from tetra_drake.robot.command_file import load_command, scenario_beside
    from tetra_drake.scenario.load import load_scenario

    played = None
    if command is None:
        chosen, chosen_gait = scenario_and_gait(scenario, gait, seed, engine)
    else:
        beside = scenario_beside(command)
        chosen = load_scenario(scenario or beside or "thesis").on_engine(engine)
        if scenario and beside:
            warn(f"{command}: simulated on scenario {chosen.name}, not on {beside} beside it")
        chosen_gait, played = None, load_command(command, chosen)
    if meshcat:
        check_can_be_watched(chosen)
    check_result_folder(out)
    engine_of(chosen).prepare(chosen)
    view = None
    if meshcat:
        from tetra_drake.visualization.live import open_view

        view = open_view(chosen, say=say)
    result = simulate(chosen, chosen_gait, command=played, record=True, viewer=view)
    driver = played or chosen_gait
    if spread and driver is not None:
        result = dataclasses.replace(
            result, spread=loaded("tetra_drake.lab.spread:spread")(chosen, driver)
        )
    print(result_text(result))
    save_result_folder(out, result)
    print(
        f"wrote result.json, trajectory.nc, scenario.yaml and replay.html to {out}/\n"
        f"to watch the robot, open in a browser: {out / REPLAY}"
    )
    if view is not None:
        with contextlib.suppress(EOFError, KeyboardInterrupt):
            input("press Enter to close the view in the browser ")


def _evolve(
    *,
    scenario: ScenarioName | None = None,
    out: Folder,
    engine: EngineName | None = None,
    trials: Count | None = None,
    evaluations: Count | None = None,
    seed: Seed | None = None,
    workers: Count | None = None,
    dask: Cluster | None = None,
    resume: bool = False,
    reevaluate: bool = True,
) -> None:
    """Evolve gaits.

    Searches gaits with the scenario's optimiser, by default the thesis's evolutionary algorithm,
    and records every evaluation in a run directory. Ctrl-C stops it; --resume continues it. The
    result depends on scenario and seed only. At the end it writes report.html, replay.html,
    figures/ and, for a map, elites/ (gait files) into the run directory.

    Args:
        scenario: (default: quick, which takes minutes; with --resume, the run's)
        out: the run directory, such as runs/NAME
        trials: number of independent trials (default: the scenario's)
        evaluations: most evaluations of a trial (default: the scenario's)
        seed: random seed (default: 0)
        workers: worker processes (default: one per core)
        dask: evaluate on a Dask cluster, given by its scheduler's address, such as
            tcp://node1:8786; without an address, on a new one of --workers processes on this
            machine
        resume: continue an interrupted run; needs only --out, and keeps to the run's scenario,
            engine, seed, --no-reevaluate and --units
        reevaluate: skip the simulations after the search, which check the best gaits in Drake if
            the engine is another one, and the gaits of a map on disturbed robots

    Example: tetra-drake evolve --scenario quick --out runs/demo
    """
    from tetra_drake.evolution.manifest import MANIFEST, read_manifest
    from tetra_drake.evolution.progress import Progress
    from tetra_drake.experiment import evolve
    from tetra_drake.report.summary import run_text
    from tetra_drake.scenario.load import load_scenario

    counts = {"evolution.trials": trials, "evolution.evaluations": evaluations}
    changes = {key: count for key, count in counts.items() if count is not None}
    chosen: Scenario | None = None  # None means the scenario of the run
    if scenario is not None or not resume:
        chosen = load_scenario(scenario or "quick")
    elif changes or engine is not None:
        chosen = read_manifest(out).scenario
    if chosen is not None:
        chosen = chosen.on_engine(engine).with_changes(changes)

    executor: contextlib.AbstractContextManager[Any] = contextlib.nullcontext()
    if dask is not None:
        dask_cluster = loaded("tetra_drake.lab.cluster:dask_cluster")
        executor = dask_cluster(dask or None, workers=workers)
    try:
        with executor as make_executor:
            run = evolve(
                chosen,
                out,
                seed=seed,
                workers=workers,
                resume=resume,
                executor=make_executor,
                progress=Progress(sys.stdout),
                reevaluate=None if reevaluate else False,
            )
    except KeyboardInterrupt:
        if not (out / MANIFEST).exists():
            raise KeyboardInterrupt("(no gait was evaluated yet)") from None
        again = f"tetra-drake evolve --out {shlex.quote(str(out))} --resume"
        raise KeyboardInterrupt(f"(nothing is lost; continue with: {again})") from None
    with run.manifest.in_its_units():
        print(run_text(run))


def _replay(source: ResultOrGait, *, scenario: ScenarioName | None = None, out: File) -> None:
    """Write a page that shows a gait in a browser.

    Writes one HTML page (1.2 MB) that shows the robot walking, in any browser, without server or
    network. A folder of `simulate` has the recorded trajectory. A gait file, or the best gait of a
    run of `evolve`, is simulated.

    Args:
        source: a folder written by `simulate`, a gait file, or a folder written by `evolve`
        scenario: (default: the scenario of its run, or thesis; for gait files only)
        out: the HTML file to write

    Example: tetra-drake replay runs/champion --out champion.html
    """
    from tetra_drake.report.result_folder import load_or_simulate

    check_file(out)
    result = load_or_simulate(source, scenario=scenario, warn=warn)
    result.save_replay(out)
    print(f"{result.title}\nto watch the robot, open in a browser: {out}")


def _figures(
    source: RunOrResult,
    *,
    width: Width = 7.0 * INCH,
    font: FontSize = 9.0,
    title: bool = True,
    pdf: bool = False,
    out: Folder | None = None,
) -> None:
    """Draw the figures of a run or a simulation.

    Draws figures as SVG and PNG into figures/ in the given folder. A run of `evolve` need not be
    finished; its report.html, replay.html and elites/ are also written again. A folder written by
    `simulate` gets the figures of one gait.

    Args:
        source: a folder written by `evolve` or by `simulate`
        width: width of the figures, such as '3.4 in' for a column (default: 7 in)
        font: size of the letters in points (default: %(default)s)
        title: draw without titles
        pdf: also write PDF files
        out: draw into this folder instead, without changes to the source

    Example: tetra-drake figures runs/thesis --out figures
    """
    from tetra_drake.report.run_page import write_figures

    written = write_figures(source, out, print_of(width, font, title=title, pdf=pdf))
    print(f"wrote {', '.join(str(path) for path in written)}")


def _cpg(
    gait: GaitPath | None = None,
    *,
    scenario: ScenarioName | None = None,
    seed: GaitSeed | None = None,
    rate: Rate | None = None,
    out: File,
) -> None:
    """Write the oscillator signals of a gait to a CSV file.

    Writes the signals of the driven cables: time_s, signal_1, signal_2 ..., one per oscillator,
    zero before the start-up time. A positive signal shortens the cables that its oscillator drives.
    Comment lines (#) at the top of the file describe the columns. Gaits with feedback are refused,
    because feedback depends on the robot.

    Args:
        scenario: (default: the scenario of the gait's run; thesis for a gait in no run)
        rate: samples per second (default: 2000 Hz, by the scenario's cpg.listing_step)
        out: the CSV file to write

    Example: tetra-drake cpg --seed 3 --units SI --out signals.csv
    """
    from tetra_drake.robot.robot import Robot
    from tetra_drake.robot.signals import save_signals

    chosen, chosen_gait = scenario_and_gait(scenario, gait, seed)
    save_signals(out, Robot.of(chosen), chosen_gait, rate=rate)


def _schema(*, structure: bool = False) -> None:
    """Print the JSON Schema of scenario files.

    Editors and other tools read it: each key with its text, limits and default, each kind with its
    tag as title, each quantity as a text with a pattern, with its SI unit beside it.

    Args:
        structure: of structure files instead

    Example: tetra-drake schema
    """
    from tetra_drake.scenario.keys import schema_text

    text = schema_text(structure=structure)
    if "utf" not in (sys.stdout.encoding or "utf").lower():
        text = json.dumps(json.loads(text), indent=1) + "\n"
    print(text, end="")


def _prepare() -> None:
    """Compile everything.

    Compiles the kernels of all engines for this processor, once, in half a minute on two cores.
    Later commands find the machine code. Otherwise a command compiles what it needs.

    Args:

    Example: tetra-drake prepare
    """
    from tetra_drake.engines.preparation import FUNCTIONS, prepare
    from tetra_drake.evolution.progress import Progress

    title, numbers = "compiled functions", itertools.count(1)
    with Progress(sys.stdout) as display:
        prepare(lambda: display.stage(title, min(next(numbers), FUNCTIONS - 1), FUNCTIONS))
        display.stage(title, FUNCTIONS, FUNCTIONS)
