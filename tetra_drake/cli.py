"""The command line: each command parses its options, calls one function and prints."""

from __future__ import annotations

import argparse
import contextlib
import inspect
import os
import re
import shlex
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from tetra_drake import __version__
from tetra_drake.engines import ENGINES
from tetra_drake.errors import InputError, SimulationFailure
from tetra_drake.files import check_folder, write_whole
from tetra_drake.interrupts import heeding_interrupts
from tetra_drake.scenario.load import load_scenario, shipped_scenarios
from tetra_drake.scenario.refusals import hint
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.scenario.structure_files import shipped_structures

if TYPE_CHECKING:
    from tetra_drake.robot.gait import Gait

BAD_INPUT, FAILED, INTERRUPTED = 2, 1, 130  # exit statuses

_OF_GAIT = "the scenario of the gait's run; thesis for a gait in no run"
"""The default scenario of commands that take a gait."""

Options = argparse.Namespace


def main(argv: Sequence[str] | None = None) -> int:
    """Runs one command; returns the exit status."""
    options, unknown = make_parser().parse_known_args(argv)
    if unknown:
        names = re.findall(r"--[\w-]+", options.command.format_usage())
        options.command.error(f"there is no {unknown[0]}; {hint(unknown[0], names)}")
    try:
        with heeding_interrupts():
            options.run(options)
            sys.stdout.flush()
    except (InputError, SimulationFailure) as error:
        print(f"tetra-drake: {error}", file=sys.stderr)
        return BAD_INPUT if isinstance(error, InputError) else FAILED
    except OSError as error:
        # Its reader has closed our output, as `| head` does; the disk is full.
        if not isinstance(error, BrokenPipeError):
            what = error.filename or "output"
            print(f"tetra-drake: {what}: {error.strerror or error}", file=sys.stderr)
        _drop_output()
        return FAILED
    except KeyboardInterrupt as interrupt:
        print("\ntetra-drake: interrupted", *interrupt.args, file=sys.stderr)
        return INTERRUPTED
    return 0


def _drop_output() -> None:
    """Lets what has been printed but not written disappear, which Python would try to write at its
    end."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


class Command(argparse.ArgumentParser):
    """The parser of a command's options, whose errors are one line."""

    def error(self, message: str) -> NoReturn:
        """Ends the process."""
        self.exit(BAD_INPUT, f"{self.prog}: {message}; see {self.prog} --help\n")


def make_parser() -> Command:
    """The parser of all commands; each sets `run`, a function of the parsed options, and `command`,
    its own parser."""
    parser = Command(
        prog="tetra-drake",
        description="Simulate a walking tensegrity robot, nested tetrahedra driven by a Matsuoka "
        "central pattern generator, as a Drake diagram, and evolve its gaits.",
        epilog="`tetra-drake COMMAND --help` explains a command.",
    )
    parser.add_argument("--version", action="version", version=f"%(prog)s {__version__}")
    commands = parser.add_subparsers(metavar="COMMAND", required=True)

    for run, add_options in _COMMANDS:
        name = run.__name__.removeprefix("_")
        what, _, description = (inspect.getdoc(run) or "").partition("\n\n")
        command = commands.add_parser(name, help=what.rstrip("."), description=description)
        add_options(command)
        command.set_defaults(run=run, command=command)
    return parser


def _simulate_options(command: Command) -> None:
    _add_scenario(command, default="that of the gait's run, or beside the command; else thesis")
    gaits = _add_gait(command, "--gait")
    what = "a file of actuator commands (CSV) instead, as `export` writes"
    gaits.add_argument("--command", metavar="FILE", dest="command_file", type=Path, help=what)
    _add_engine(command)
    _add_path(command, "--out", "DIR", "the folder to write to (default: out)", default=Path("out"))
    what = "show the robot in a browser while Drake simulates it, in real time at most"
    command.add_argument("--meshcat", action="store_true", help=what)


def _simulate(options: Options) -> None:
    """Simulate one gait.

    Simulates one gait, or a robot that follows a file of commands, and prints its metrics. Writes
    result.json (the numbers), trajectory.nc (motion and forces over time, for xarray), replay.html
    (open it in a browser) and scenario.yaml (all settings).
    """
    from tetra_drake.engines.interface import check_can_be_watched
    from tetra_drake.engines.simulate import prepare, simulate
    from tetra_drake.prototype.command_file import load_command
    from tetra_drake.report.result_folder import REPLAY, check_result_folder, save_result_folder
    from tetra_drake.report.summary import result_text

    gait, command = None, None
    if options.command_file is None:
        scenario, gait = _chosen_gait(options)
    else:
        scenario = _scenario_of_command(options)
    scenario = scenario.with_changes(_engine_change(options))
    if options.command_file is not None:
        command = load_command(options.command_file, scenario)
    if options.meshcat:
        check_can_be_watched(scenario)
    check_result_folder(options.out)
    prepare(scenario)
    view = None
    if options.meshcat:
        from tetra_drake.visualization.live import open_view

        view = open_view(scenario, say=lambda text: print(text, flush=True))
    result = simulate(scenario, gait, command=command, record=True, viewer=view)
    print(result_text(result))
    save_result_folder(options.out, result)
    print(
        f"wrote result.json, trajectory.nc, scenario.yaml and replay.html to {options.out}/\n"
        f"to watch the robot, open in a browser: {options.out / REPLAY}"
    )
    if view is not None:
        with contextlib.suppress(EOFError, KeyboardInterrupt):
            input("press Enter to close the view in the browser ")


def _scenario_of_command(options: Options) -> Scenario:
    """The given scenario, or the one beside the command, or the thesis's."""
    from tetra_drake.prototype.command_file import scenario_beside

    file, beside = options.command_file, scenario_beside(options.command_file)
    scenario = load_scenario(options.scenario or beside or "thesis")
    if options.scenario and beside:
        _warn(f"{file}: simulated on scenario {scenario.name}, not on {beside} beside it")
    return scenario


def _export_options(command: Command) -> None:
    _add_gait(command, "gait", nargs="?")
    _add_scenario(command, default=_OF_GAIT)
    _add_engine(command)
    _add_rate(command, default="100 Hz", shown="100 Hz")
    _add_path(command, "--out", "DIR", "the new folder to write", required=True)


def _export(options: Options) -> None:
    """Write a gait as commands for the actuators of a prototype.

    Simulates a gait and writes command.csv (what each actuator shall do), expected.csv (positions
    of the nodes), limits.csv (the load on each actuator), scenario.yaml and README.md. Prints
    whether the scenario's actuators can play it, and how far the robot goes by these commands.
    """
    from tetra_drake.prototype.export import export

    scenario, gait = _chosen_gait(options)
    scenario = scenario.with_changes(_engine_change(options))
    print(export(scenario, gait, rate=options.rate, out=options.out))
    print(f"wrote {options.out}/")


def _evolve_options(command: Command) -> None:
    _add_scenario(command, default="quick, which takes minutes; with --resume, that of the run")
    _add_path(command, "--out", "DIR", "the run directory, such as runs/NAME", required=True)
    _add_engine(command)
    _add_count(command, "--trials", "number of independent trials (default: the scenario's)")
    _add_count(
        command,
        "--evaluations",
        "most evaluations of a trial (default: the scenario's)",
    )
    command.add_argument("--seed", metavar="N", type=_integer(0), help="random seed (default: 0)")
    _add_workers(command)
    cluster = (
        "evaluate on a Dask cluster, given by its scheduler's address, such as tcp://node1:8786; "
        "without an address, on a new one of --workers processes on this machine"
    )
    command.add_argument("--dask", metavar="ADDRESS", nargs="?", const="", help=cluster)
    resume = "continue an interrupted run; needs only --out"
    command.add_argument("--resume", action="store_true", help=resume)
    again = (
        "skip the simulations after the search, which check the best gaits in Drake if the engine "
        "is another one, and the gaits of a map on disturbed robots"
    )
    command.add_argument("--no-reevaluate", dest="reevaluate", action="store_false", help=again)


def _evolve(options: Options) -> None:
    """Evolve gaits.

    Searches gaits with the scenario's optimiser, by default the thesis's evolutionary algorithm,
    and records every evaluation in a run directory. Ctrl-C stops it; --resume continues it. The
    result depends on scenario and seed only. At the end it writes report.html, replay.html,
    figures/ and, for a map, elites/ (gait files) into the run directory.
    """
    from tetra_drake.evolution.manifest import MANIFEST
    from tetra_drake.evolution.progress import Display
    from tetra_drake.experiment import evolve
    from tetra_drake.report.summary import run_text

    executor: contextlib.AbstractContextManager[Any] = contextlib.nullcontext()
    if options.dask is not None:
        from tetra_drake.evolution.cluster import dask_cluster

        executor = dask_cluster(options.dask or None, workers=options.workers)
    try:
        with executor as make_executor:
            run = evolve(
                _scenario_to_evolve(options),
                options.out,
                seed=options.seed,
                workers=options.workers,
                resume=options.resume,
                executor=make_executor,
                progress=Display(sys.stdout),
                reevaluate=options.reevaluate,
            )
    except KeyboardInterrupt:
        if not (options.out / MANIFEST).exists():
            raise KeyboardInterrupt("(no gait was evaluated yet)") from None
        resume = f"tetra-drake evolve --out {shlex.quote(str(options.out))} --resume"
        raise KeyboardInterrupt(f"(nothing is lost; continue with: {resume})") from None
    print(run_text(run))


def _scenario_to_evolve(options: Options) -> Scenario | None:
    """The scenario with the options' changes; None if they leave a run to resume as it is."""
    from tetra_drake.evolution.manifest import read_manifest

    changes = _engine_change(options)
    if options.trials is not None:
        changes["evolution.trials"] = options.trials
    if options.evaluations is not None:
        changes["evolution.evaluations"] = options.evaluations
    if options.scenario is None and options.resume:
        return read_manifest(options.out).scenario.with_changes(changes) if changes else None
    return load_scenario(options.scenario or "quick").with_changes(changes)


def _replay_options(command: Command) -> None:
    source = "a folder written by `simulate`, a gait file, or a folder written by `evolve`"
    _add_path(command, "source", "RESULT_DIR|GAIT|RUN_DIR", source)
    _add_scenario(command, default="that of its run, or thesis; for gait files only")
    _add_path(command, "--out", "FILE", "the HTML file to write", required=True)


def _replay(options: Options) -> None:
    """Write a page that shows a gait in a browser.

    Writes one HTML page (1.2 MB) that shows the robot walking, in any browser, without server or
    network: from the trajectory that `simulate` recorded, or by simulating a gait file, or the
    best gait of a run of `evolve` on the run's scenario.
    """
    from tetra_drake.report.replay_page import write_replay

    title = write_replay(options.source, options.out, scenario=options.scenario, warn=_warn)
    print(f"{title}\nto watch the robot, open in a browser: {options.out}")


def _figures_options(command: Command) -> None:
    source = "a folder written by `evolve` or by `simulate`"
    _add_path(command, "source", "RUN_DIR|RESULT_DIR", source)
    _add_path(command, "--out", "DIR", "draw into this folder; leave the source as it is")


def _figures(options: Options) -> None:
    """Draw the figures of a run or a simulation.

    Draws figures as SVG and PNG. For a run of `evolve`, finished or not: into figures/ in its
    directory, where report.html, replay.html and elites/ are written anew, too. For a folder
    written by `simulate`: the figures of one gait, into figures/ in it.
    """
    from tetra_drake.report.run_page import write_figures

    written = write_figures(options.source, options.out)
    print(f"wrote {', '.join(str(path) for path in written)}")


def _robustness_options(command: Command) -> None:
    _add_path(command, "source", "GAIT|RUN", "a gait file, or a folder written by `evolve`")
    _add_scenario(command, default=_OF_GAIT)
    _add_count(command, "--draws", "number of draws (default: 200)", default=200)
    seed = "random seed of the draws (default: 0)"
    command.add_argument("--seed", metavar="N", type=_integer(0), default=0, help=seed)
    _add_workers(command)
    _add_path(command, "--out", "DIR", "write tables (CSV, JSON) and the figure into this folder")


def _robustness(options: Options) -> None:
    """Test gaits under disturbances that were not used in evolution.

    Simulates a gait, or the best gait of each trial of a run, on the compiled engine: undisturbed,
    in new draws of the scenario's disturbances (5 percent if it has none), and with each
    disturbance alone. Prints how far it walks, in how many draws it is robust (loses at most a
    tenth of its undisturbed distance), and which disturbance hurts most.
    """
    from tetra_drake.analysis.robustness import judge
    from tetra_drake.evolution.source import load_source
    from tetra_drake.report.analysis_text import robustness_text

    source = load_source(options.source, scenario=options.scenario, warn=_warn)
    if options.out:
        check_folder(options.out)
    judgement = judge(
        source.scenario,
        source.gaits,
        draws=options.draws,
        seed=options.seed,
        workers=options.workers,
    )
    print(robustness_text(judgement))
    if options.out:
        from tetra_drake.figures.robustness import save_judgement

        print(f"wrote {', '.join(save_judgement(judgement, options.out))} to {options.out}/")


def _compare_options(command: Command) -> None:
    runs = "folders written by `evolve`, finished or not, all with the same objective"
    _add_path(command, "runs", "RUN", runs, nargs="+")
    reach = "also count simulations until a trial walks this distance, such as '14.34 in'"
    command.add_argument("--reach", metavar="LENGTH", type=_quantity("m"), help=reach)
    _add_path(command, "--out", "DIR", "write tables (CSV, JSON) and the figure into this folder")


def _compare(options: Options) -> None:
    """Compare how well runs search.

    Compares the best fitness of each trial at the same number of simulations. An evaluation is
    one simulation, or one for each draw of disturbances. Prints interquartile means with bootstrap
    intervals, simulations until a trial reaches a distance, and time. With --out it writes
    trials.csv, curves.csv, summary.json and the figure comparison.
    """
    from tetra_drake.analysis.comparison import compare
    from tetra_drake.report.analysis_text import comparison_text

    if options.out:
        check_folder(options.out)
    compared = compare(options.runs, reach=options.reach)
    print(comparison_text(compared))
    if options.out:
        from tetra_drake.figures.comparison import save_comparison

        print(f"wrote {', '.join(save_comparison(compared, options.out))} to {options.out}/")


def _cpg_options(command: Command) -> None:
    _add_scenario(command, default=_OF_GAIT)
    _add_gait(command, "--gait")
    command.add_argument("--unit", choices=("lbf", "N"), default="lbf", help="default: lbf")
    _add_rate(command, default=None, shown="2000 Hz, by the scenario's cpg.listing_step")
    _add_path(command, "--out", "FILE", "the CSV file to write", required=True)


def _cpg(options: Options) -> None:
    """Write the oscillator signals of a gait to a CSV file.

    Writes the signals that the cables of a gait are fed: time_s, signal_1, signal_2 ..., a column
    per oscillator, zero before the start-up time. A positive signal shortens the cables that its
    oscillator drives. The file's first lines, which begin with #, say what each column is. Feedback
    depends on the robot: gaits with it are refused.
    """
    from tetra_drake.robot.robot import Robot
    from tetra_drake.robot.signals import save_signals

    scenario, gait = _chosen_gait(options)
    robot = Robot.of(scenario)
    save_signals(options.out, robot, gait, unit=options.unit, rate=options.rate)


def _structure_options(command: Command) -> None:
    names = ", ".join(shipped_structures())
    command.add_argument("source", metavar="NAME|FILE", help=f"a structure file, or one of {names}")
    unit = "the unit of length of a file of NTRT, as dm"
    command.add_argument("--unit", metavar="UNIT", help=unit)
    _add_path(command, "--out", "FILE", "write an HTML page that shows the structure at rest")
    _add_path(command, "--mjcf", "FILE", "write a model for MuJoCo, with its tendons")


def _structure(options: Options) -> None:
    """Tell what a structure is, and how it rests.

    Reads a structure file, or one of NTRT, and finds its rest on flat ground without actuation.
    Prints bodies, cables, states of self-stress, infinitesimal mechanisms, natural frequencies,
    tensions and heights.
    """
    from tetra_drake.analysis.equilibrium import study_equilibrium
    from tetra_drake.engines.mujoco import make_mjcf
    from tetra_drake.report.structure_page import robot_of_file, save_structure_page, structure_text

    study = study_equilibrium(robot_of_file(options.source, unit=options.unit))
    text = structure_text(study)
    if options.out:
        save_structure_page(study, options.out)
        text += f"\nto see the structure, open in a browser: {options.out}"
    if options.mjcf:
        write_whole(options.mjcf, make_mjcf(study.robot))
        text += f"\nwrote {options.mjcf}"
    print(text)


def _add_scenario(command: Command, *, default: str) -> None:
    names = ", ".join(shipped_scenarios())
    what = f"a shipped scenario ({names}) or a YAML file (default: {default})"
    command.add_argument("--scenario", metavar="NAME|FILE", help=what)


def _add_engine(command: Command) -> None:
    what = "the Drake diagram, the same laws compiled, or MuJoCo (default: the scenario's)"
    command.add_argument("--engine", choices=ENGINES, help=what)


def _add_path(command: Command, name: str, metavar: str, what: str, **more: Any) -> None:
    command.add_argument(name, metavar=metavar, type=Path, help=what, **more)


def _add_count(command: Command, name: str, what: str, **more: Any) -> None:
    command.add_argument(name, metavar="N", type=_integer(1), help=what, **more)


def _add_rate(command: Command, *, default: str | None, shown: str) -> None:
    what = f"samples per second (default: {shown})"
    command.add_argument("--rate", metavar="RATE", type=_quantity("Hz"), default=default, help=what)


def _add_workers(command: Command) -> None:
    _add_count(command, "--workers", "worker processes (default: one per core)")


def _add_gait(command: Command, name: str, **more: Any) -> argparse._MutuallyExclusiveGroup:
    """Adds the ways to choose a gait, and returns their group."""
    group = command.add_mutually_exclusive_group()
    what = "a gait file (JSON), or a folder written by `evolve` for its best gait"
    group.add_argument(name, metavar="FILE|RUN", type=Path, help=what, **more)
    seed = "a random gait of this seed instead (default: one that walks)"
    group.add_argument("--seed", metavar="N", type=_integer(0), help=seed)
    return group


def _engine_change(options: Options) -> dict[str, Any]:
    """The change of the scenario by --engine."""
    return {"engine": f"!{options.engine.capitalize()}"} if options.engine else {}


def _chosen_gait(options: Options) -> tuple[Scenario, Gait]:
    """The scenario and the gait to simulate on it."""
    from tetra_drake.evolution.source import load_source
    from tetra_drake.robot.gait import WALKING_SEED, seeded_gait

    if options.gait is None:
        scenario = load_scenario(options.scenario or "thesis")
        seed = WALKING_SEED if options.seed is None else options.seed
        return scenario, seeded_gait(scenario, seed)
    source = load_source(options.gait, scenario=options.scenario, warn=_warn)
    return source.scenario, source.best


def _integer(least: int) -> Callable[[str], int]:
    def parse(text: str) -> int:
        if text.isascii() and text.isdecimal() and int(text) >= least:
            return int(text)
        problem = f"found '{text}', expected an integer, {least} or more"
        raise argparse.ArgumentTypeError(problem)

    return parse


def _quantity(unit: str) -> Callable[[str], float]:
    def parse(text: str) -> float:
        from tetra_drake.scenario.units import quantity_to_si

        try:
            return quantity_to_si(text, unit)
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from error

    return parse


def _warn(text: str) -> None:
    print(f"tetra-drake: {text}", file=sys.stderr, flush=True)


_COMMANDS: tuple[tuple[Callable[[Options], None], Callable[[Command], None]], ...] = (
    (_simulate, _simulate_options),
    (_evolve, _evolve_options),
    (_export, _export_options),
    (_replay, _replay_options),
    (_figures, _figures_options),
    (_robustness, _robustness_options),
    (_compare, _compare_options),
    (_cpg, _cpg_options),
    (_structure, _structure_options),
)
"""Each command, whose docstring is its help, and what adds its options."""
