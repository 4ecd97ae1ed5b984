"""The command line: `tetra-drake COMMAND ...`."""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from tetra_drake import arguments
from tetra_drake.benchmark.settings import SETS
from tetra_drake.errors import InputError, SimulationFailure
from tetra_drake.files import whole_file
from tetra_drake.robot.gait import WALKING_SEED, Gait, load_gait, seeded_gait
from tetra_drake.scenario.load import load_scenario, shipped_scenarios
from tetra_drake.scenario.schema import Scenario

if TYPE_CHECKING:
    from tetra_drake.visualization.live import LiveView

BENCHMARK_GAITS = 12

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
    _add_evolve(commands)
    _add_reevaluate(commands)
    _add_replay(commands)
    _add_figures(commands)
    _add_robustness(commands)
    _add_benchmark(commands)
    _add_cpg(commands)
    _add_diagram(commands)
    return parser


def _add_simulate(commands: argparse._SubParsersAction) -> None:
    command = commands.add_parser(
        "simulate",
        help="simulate one gait",
        description="Simulates one gait, prints how far and how straight the robot walked, and "
        "writes result.json (the numbers), trajectory.nc (motion and forces over time, for "
        "xarray), replay.html (open it in a browser) and scenario.yaml (the scenario in full).",
    )
    arguments.add_scenario(command)
    _add_gait(command)
    arguments.add_engine(command)
    command.add_argument(
        "--out",
        metavar="DIR",
        type=Path,
        default=Path("out"),
        help="the folder to write to, made if missing (default: %(default)s)",
    )
    command.add_argument(
        "--meshcat",
        action="store_true",
        help="show the robot in a browser during the simulation, at most in real time (does not "
        "affect results)",
    )
    command.set_defaults(run=_simulate)


def _scenario(options: argparse.Namespace) -> Scenario:
    """The scenario of the options, on the engine that they ask for."""
    scenario = load_scenario(options.scenario)
    engine = options.engine or scenario.simulation.engine
    return scenario.with_changes({"simulation.engine": engine})


def _simulate(options: argparse.Namespace) -> None:
    from tetra_drake.engines.simulate import simulate
    from tetra_drake.results.folder import REPLAY, check_result_folder, save_result_folder
    from tetra_drake.results.result import summary

    scenario = _scenario(options)
    gait = _gait(options, scenario)
    check_result_folder(options.out)
    if scenario.simulation.engine == "compiled":
        from tetra_drake.engines.compiled.engine import compile_engine

        compile_engine(scenario, lambda message: print(message, flush=True))
    view = _open_view(scenario) if options.meshcat else None
    result = simulate(scenario=scenario, gait=gait, record=True, viewer=view)
    assert result.trajectory is not None
    print(summary(scenario, gait, result))
    save_result_folder(options.out, scenario=scenario, gait=gait, result=result)
    print(
        f"wrote result.json, trajectory.nc, scenario.yaml and replay.html to {options.out}/\n"
        f"to watch the robot, open in a browser: {options.out / REPLAY}"
    )
    if view is not None:
        view.replay(result.trajectory)
        with contextlib.suppress(EOFError, KeyboardInterrupt):
            input("the browser repeats the motion; press Enter to end ")


def _open_view(scenario: Scenario) -> LiveView:
    from pydrake.geometry import MeshcatParams

    from tetra_drake.visualization.live import LiveView
    from tetra_drake.visualization.replay import quiet_meshcat

    meshcat = quiet_meshcat(MeshcatParams())
    print(f"open {meshcat.web_url()} in a browser, which starts the simulation", flush=True)
    return LiveView(meshcat, scenario)


FIRST_SCENARIO = "quick"
"""The scenario that `evolve` starts without another: it ends in minutes."""


def _add_evolve(commands: argparse._SubParsersAction) -> None:
    command = commands.add_parser(
        "evolve",
        help="evolve gaits that walk far",
        description="Evolves gaits by the thesis's evolutionary algorithm, one simulation per "
        "candidate, and records every evaluation in a run directory. Ctrl-C ends it; the same "
        "command with --resume continues it. The result depends on scenario and seed only. At the "
        "end it writes report.html, replay.html and figures/ into the run directory.",
    )
    command.add_argument(
        "--scenario",
        metavar="NAME|FILE",
        help=f"a shipped scenario ({', '.join(shipped_scenarios())}) or a YAML file "
        f"(default: {FIRST_SCENARIO}, which takes minutes; with --resume, the run's)",
    )
    command.add_argument(
        "--out", metavar="DIR", type=Path, required=True, help="the run directory, as runs/NAME"
    )
    arguments.add_engine(command)
    command.add_argument(
        "--trials",
        metavar="N",
        type=arguments.count,
        help="number of independent trials, instead of the scenario's",
    )
    command.add_argument(
        "--iterations",
        metavar="N",
        type=arguments.count,
        help="greatest number of iterations per trial, instead of the scenario's",
    )
    command.add_argument(
        "--seed", metavar="N", type=arguments.seed, help="random seed (default: 0)"
    )
    arguments.add_workers(command)
    command.add_argument(
        "--resume", action="store_true", help="continue an interrupted run; needs only --out"
    )
    command.set_defaults(run=_evolve)


def _evolve(options: argparse.Namespace) -> None:
    from tetra_drake.evolution.progress import make_progress
    from tetra_drake.evolution.summary import summary, whole_experiment
    from tetra_drake.run import evolve

    if options.scenario is None and not options.resume:
        print(whole_experiment(load_scenario("thesis"), seconds=0.2), flush=True)
    try:
        run = evolve(
            _scenario_to_evolve(options),
            options.out,
            seed=options.seed,
            workers=options.workers,
            resume=options.resume,
            progress=make_progress(sys.stdout),
        )
    except KeyboardInterrupt:
        resume = f"tetra-drake evolve --out {options.out} --resume"
        print(f"\nnothing is lost; continue with: {resume}", file=sys.stderr)
        raise
    print(summary(run))


def _scenario_to_evolve(options: argparse.Namespace) -> Scenario | None:
    """The scenario with the options' changes; None if they leave a run to resume as it is."""
    from tetra_drake.evolution.record import read_manifest

    asked = {
        "simulation.engine": options.engine,
        "evolution.trials": options.trials,
        "evolution.max_iterations": options.iterations,
    }
    changes = {key: value for key, value in asked.items() if value is not None}
    if options.scenario is None and options.resume:
        return read_manifest(options.out).scenario.with_changes(changes) if changes else None
    return load_scenario(options.scenario or FIRST_SCENARIO).with_changes(changes)


def _add_reevaluate(commands: argparse._SubParsersAction) -> None:
    command = commands.add_parser(
        "reevaluate",
        help="evaluate gaits of a run once more, on the Drake diagram",
        description="Evaluates gaits of a run made on another engine once more, on the Drake "
        "diagram, and adds them to the run's record (reevaluations.jsonl of each trial): the best "
        "gaits of each trial, which evolve itself does at its end, or all initial gaits. Gaits "
        "that have been evaluated so already are skipped.",
    )
    command.add_argument("run_directory", metavar="RUN", type=Path, help="the run directory")
    command.add_argument(
        "--initial", action="store_true", help="the initial gaits instead of the best"
    )
    arguments.add_workers(command)
    command.set_defaults(run=_reevaluate)


def _reevaluate(options: argparse.Namespace) -> None:
    from tetra_drake.evolution.progress import make_progress
    from tetra_drake.evolution.reevaluation import reevaluate
    from tetra_drake.evolution.summary import summary

    with make_progress(sys.stdout) as progress:
        run = reevaluate(
            options.run_directory,
            initial=options.initial,
            workers=options.workers,
            progress=progress,
        )
    print(summary(run))


def _add_replay(commands: argparse._SubParsersAction) -> None:
    command = commands.add_parser(
        "replay",
        help="write a page that shows a gait in a browser",
        description="Writes one HTML page that shows the robot walking, in any browser, without "
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
    from tetra_drake.report.replay_page import write_replay

    title = write_replay(options.source, options.out, scenario=options.scenario)
    print(f"{title}\nto watch the robot, open in a browser: {options.out}")


def _add_figures(commands: argparse._SubParsersAction) -> None:
    command = commands.add_parser(
        "figures",
        help="draw the figures of a run or a simulation",
        description="Draws figures as SVG and PNG, and the table of the two best gaits as CSV. "
        "For a run of `evolve`, finished or not: into figures/ in its directory, where report.html "
        "and replay.html are written anew, too. For a folder written by `simulate`: the figures "
        "of one gait, into figures/ in it.",
    )
    command.add_argument(
        "source",
        metavar="RUN_DIR|RESULT_DIR",
        type=Path,
        help="a folder written by `evolve` or by `simulate`",
    )
    command.add_argument(
        "--out", metavar="DIR", type=Path, help="draw into this folder; leave the source as it is"
    )
    command.set_defaults(run=_figures)


def _figures(options: argparse.Namespace) -> None:
    from tetra_drake.report.run_page import write_figures

    written = write_figures(options.source, options.out)
    print(f"wrote {', '.join(str(path) for path in written)}")


def _add_cpg(commands: argparse._SubParsersAction) -> None:
    command = commands.add_parser(
        "cpg",
        help="write the oscillator signals of a gait to a CSV file",
        description="Writes the signals that the cables of a gait are fed: time_s, signal_1, "
        "signal_2 ..., a column per junction, from 0 to the scenario's duration, zero before the "
        "start-up time. A positive signal shortens the two bottom outer cables of its junction. "
        "The file's first lines, which begin with #, say what each column is.",
    )
    arguments.add_scenario(command)
    _add_gait(command)
    command.add_argument(
        "--out", metavar="FILE", type=Path, required=True, help="the CSV file to write"
    )
    command.add_argument(
        "--signals",
        choices=("listing", "recorded"),
        help="how the network is integrated, instead of the scenario's cpg.signals: forward Euler "
        "as in the thesis's listing, or accurately",
    )
    command.add_argument("--unit", choices=("lbf", "N"), default="lbf", help="default: lbf")
    command.add_argument(
        "--rate", metavar="HZ", type=arguments.rate, help="samples per second (default: 2000)"
    )
    command.add_argument(
        "--raw",
        action="store_true",
        help="write y_extensor - y_flexor: no gain, and no zeros before the start-up time",
    )
    command.set_defaults(run=_cpg)


def _cpg(options: argparse.Namespace) -> None:
    from tetra_drake.robot.signals import save_signals

    scenario = load_scenario(options.scenario)
    if options.signals:
        scenario.cpg.signals = options.signals
    gait = _gait(options, scenario)
    save_signals(options.out, scenario, gait, unit=options.unit, rate=options.rate, raw=options.raw)


def _add_robustness(commands: argparse._SubParsersAction) -> None:
    command = commands.add_parser(
        "robustness",
        help="simulate gaits with the robot or its surroundings slightly changed",
        description="Simulates a gait, or the best gait of each trial of a run, on the compiled "
        "engine with starting pose, friction, cables and ground changed by a few percent, one at "
        "a time, and prints how much that changes the distance.",
    )
    command.add_argument(
        "source", metavar="GAIT|RUN", type=Path, help="a gait file, or a folder written by `evolve`"
    )
    command.add_argument(
        "--scenario",
        metavar="NAME|FILE",
        help="a shipped scenario or a YAML file (default: the run's, thesis for a gait file)",
    )
    command.add_argument(
        "--percent",
        metavar="P",
        type=arguments.rate,
        nargs="+",
        default=[2.0, 5.0],
        help="changes in percent, each with both signs (default: 2 5)",
    )
    arguments.add_workers(command)
    command.add_argument(
        "--out", metavar="FILE", type=Path, help="a CSV file: the distance (m) of each simulation"
    )
    command.set_defaults(run=_robustness)


def _robustness(options: argparse.Namespace) -> None:
    from tetra_drake.engines.compiled.engine import compile_engine
    from tetra_drake.evolution.robustness import describe, robustness
    from tetra_drake.evolution.tables import load_run
    from tetra_drake.files import write_whole

    if options.source.is_dir():
        run = load_run(options.source)
        run.fittest()  # or an error
        gaits = {f"trial {t}": run.gait(t, i) for t, i in run.best()[["trial", "index"]].to_numpy()}
        scenario = load_scenario(options.scenario) if options.scenario else run.manifest.scenario
    else:
        scenario = load_scenario(options.scenario or "thesis")
        gait = load_gait(options.source, scenario)
        gaits = {gait.name: gait}
    compile_engine(scenario, lambda message: print(message, flush=True))
    print(f"gaits: {len(gaits)}; simulating each under every change", flush=True)
    table = robustness(scenario, gaits, percents=options.percent, workers=options.workers)
    print(describe(table))
    if options.out:
        write_whole(
            options.out, table.rename(columns={"distance": "distance_m"}).to_csv(index=False)
        )
        print(f"wrote {options.out}")


def _add_diagram(commands: argparse._SubParsersAction) -> None:
    command = commands.add_parser(
        "diagram",
        help="draw the block diagram",
        description="Draws the block diagram of the robot. FILE.dot is Graphviz source; .svg, "
        ".png and .pdf are drawn by Graphviz's program `dot`, which must be installed.",
    )
    arguments.add_scenario(command)
    command.add_argument(
        "--out", metavar="FILE", type=Path, required=True, help="the file to write"
    )
    command.set_defaults(run=_diagram)


def _diagram(options: argparse.Namespace) -> None:
    from tetra_drake.figures.block_diagram import save_block_diagram
    from tetra_drake.systems.diagram import MakeTensegrityDiagram

    scenario = load_scenario(options.scenario)
    save_block_diagram(MakeTensegrityDiagram(scenario, seeded_gait(scenario)), options.out)


def _add_benchmark(commands: argparse._SubParsersAction) -> None:
    command = commands.add_parser(
        "benchmark",
        help="measure speed and accuracy of the engines and their settings",
        description="Simulates gaits on the engines with different settings and prints how many "
        "times faster than real time each is, the errors of its distances against converged ones, "
        "and the compiled engine's cost per step by number of tetrahedra. Takes some minutes; the "
        "set integrators takes longer. Times are meaningful on an idle machine only.",
    )
    command.add_argument(
        "gaits", metavar="GAIT", type=Path, nargs="*", help="gait files (default: random gaits)"
    )
    command.add_argument(
        "--gaits",
        dest="number",
        metavar="N",
        type=arguments.count,
        help=f"number of random gaits, of seeds 0, 1 ... (default: {BENCHMARK_GAITS})",
    )
    command.add_argument(
        "--settings",
        metavar="SET",
        nargs="+",
        choices=SETS,
        default=["default"],
        help="sets of settings: default (a few for each engine), integrators (many for the "
        "diagram), compiled or mujoco (many for that engine)",
    )
    command.add_argument(
        "--sizes",
        metavar="N",
        nargs="*",
        type=arguments.count,
        help="numbers of tetrahedra to measure the cost per step for (default: 5 10 20 40 with "
        "the default settings, else none)",
    )
    arguments.add_scenario(command)
    command.add_argument("--json", metavar="FILE", type=Path, help="also write a JSON file")
    command.set_defaults(run=_benchmark)


def _benchmark(options: argparse.Namespace) -> None:
    scenario = load_scenario(options.scenario)
    if options.gaits and options.number is not None:
        raise InputError("--gaits", "", "not allowed with gait files")
    gaits = [load_gait(path, scenario) for path in options.gaits] or [
        seeded_gait(scenario, seed) for seed in range(options.number or BENCHMARK_GAITS)
    ]
    with contextlib.ExitStack() as stack:
        # Opened first: a path that cannot be written is refused before minutes are spent.
        file = stack.enter_context(whole_file(options.json)) if options.json else None

        from tetra_drake.benchmark.measure import SIZES, measure
        from tetra_drake.benchmark.tables import to_markdown

        sizes = options.sizes
        if sizes is None:
            sizes = SIZES if options.settings == ["default"] else ()
        found = measure(scenario, gaits, sets=options.settings, sizes=sizes, say=_say)
        print(to_markdown(found))
        if file is not None:
            file.write_text(json.dumps(found, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def _say(stage: str) -> None:
    print(f"{stage} ...", file=sys.stderr, flush=True)


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
        return load_gait(options.gait, scenario)
    return seeded_gait(scenario, options.seed)


if __name__ == "__main__":
    sys.exit(main())
