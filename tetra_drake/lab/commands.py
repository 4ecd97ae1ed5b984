"""Commands of the laboratory; see tetra_drake.cli for the core's."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tetra_drake.command_options import (
    CommandFile,
    Count,
    EngineName,
    File,
    FitPath,
    Folder,
    FontSize,
    FrameRate,
    GaitOrRun,
    GaitPath,
    GaitSeed,
    Labels,
    PlaybackSpeed,
    Quantities,
    Rate,
    Reach,
    ResultOrGait,
    RunFolder,
    ScenarioName,
    Seed,
    Size,
    StructureName,
    UnitName,
    View,
    Width,
    print_of,
    say,
    scenario_and_gait,
    warn,
)
from tetra_drake.errors import InputError
from tetra_drake.files import check_folder, file_names, write_whole
from tetra_drake.settings.units import INCH


def _robustness(
    source: GaitOrRun,
    *,
    scenario: ScenarioName | None = None,
    draws: Count = 200,
    seed: Seed = 0,
    workers: Count | None = None,
    out: Folder | None = None,
) -> None:
    """Test gaits under disturbances that were not used in evolution.

    Simulates a gait, or the best gait of each trial of a run, on the compiled engine: undisturbed,
    in random draws of the scenario's disturbances (5 percent if it has none), and with each
    disturbance alone. Prints how far it walks, in how many draws it is robust (loses at most a
    tenth of its undisturbed distance), and which disturbance hurts most.

    Args:
        source: a gait file, or a folder written by `evolve`
        scenario: (default: the scenario of the gait's run; thesis for a gait in no run)
        draws: number of draws (default: %(default)s)
        seed: random seed of the draws (default: %(default)s)
        workers: worker processes (default: one per core)
        out: write tables (CSV, JSON) and the figure into this folder

    Example: tetra-drake robustness runs/thesis --draws 50 --out robustness
    """
    from tetra_drake.evolution.run import load_source
    from tetra_drake.lab.study.robustness import robustness, robustness_text, save_judgement

    found = load_source(source, scenario=scenario, warn=warn)
    if out:
        check_folder(out)
    judgement = robustness(found.scenario, found.gaits, draws=draws, seed=seed, workers=workers)
    print(robustness_text(judgement))
    if out:
        print(f"wrote {', '.join(save_judgement(judgement, out))} to {out}/")


def _structure(
    source: StructureName,
    *,
    unit: UnitName | None = None,
    without: Labels | None = None,
    out: File | None = None,
    mode: Count | None = None,
    mjcf: File | None = None,
    sdf: File | None = None,
) -> None:
    """Analyse a structure and its equilibrium.

    Reads a structure file, one of NTRT, an MJCF file (.xml) with tendons, or the robot of a
    scenario, and computes its equilibrium on flat ground without actuation. Prints bodies, cables,
    states of self-stress, infinitesimal mechanisms, natural frequencies, damping ratios, tensions
    and heights.

    Args:
        unit: unit of length of the file's bare coordinates, such as dm; files of NTRT need it
        without: bodies of an MJCF file to leave out
        out: write an HTML page that shows the structure in equilibrium; a name that ends in .yaml
            writes a structure file instead, such as one converted from MJCF
        mode: show in --out only the mode with damping that has this number
        mjcf: write a model for MuJoCo, with tendons, motors and the key frame `rest`
        sdf: write a model in SDFormat: bodies, and nodes as frames, without cables

    Example: tetra-drake structure six_bar --out six_bar.html
    """
    from tetra_drake.engines.mjcf import loose_remark, make_mjcf
    from tetra_drake.lab.bridges.conversion import converted
    from tetra_drake.lab.bridges.formats import format_of, save_structure
    from tetra_drake.lab.bridges.sdf import make_sdf
    from tetra_drake.lab.study.equilibrium import (
        robot_of_file,
        robot_of_structure,
        save_structure_page,
        structure_text,
        study_equilibrium,
    )
    from tetra_drake.scenario.structure_files import read_structure

    if mode is not None and (out is None or out.suffix in (".yaml", ".yml")):
        raise InputError("structure", "--mode", "needs --out, a page")
    structure = None
    if without or format_of(source) in ("MuJoCo", "NTRT"):
        structure = converted(Path(source), unit=unit, without=without or ())
    if out and out.suffix in (".yaml", ".yml"):
        structure = structure or read_structure(source, unit=unit)
        save_structure(structure, out, source=source)
        say(f"wrote {out}")
        source, out = str(out), None
    whole = robot_of_structure(structure, source) if structure else robot_of_file(source, unit=unit)
    study = study_equilibrium(whole)
    text, robot = structure_text(study), study.robot
    rest = robot.equilibrium.state
    if out:
        save_structure_page(study, out, mode=mode)
        text += f"\nto see the structure, open in a browser: {out}"
    if mjcf:
        write_whole(mjcf, make_mjcf(robot, rest=rest))
        text += f"\nwrote {mjcf}"
        if remark := loose_remark(robot):
            warn(remark)
    if sdf:
        write_whole(sdf, make_sdf(robot.structure, rest, name=robot.scenario.name))
        text += f"\nwrote {sdf}"
    print(text)


def _export(
    gait: GaitPath | None = None,
    *,
    seed: GaitSeed | None = None,
    scenario: ScenarioName | None = None,
    engine: EngineName | None = None,
    rate: Rate = 100.0,
    out: Folder,
) -> None:
    """Write a gait as commands for the actuators of a prototype.

    Simulates a gait and writes command.csv (setpoints of each actuator), expected.csv (positions of
    the nodes), limits.csv (the load on each actuator), scenario.yaml and README.md. Prints whether
    the scenario's actuators can follow these commands, and how far the robot walks with them.

    Args:
        scenario: (default: the scenario of the gait's run; thesis for a gait in no run)
        rate: samples per second (default: 100 Hz)
        out: the new folder to write

    Example: tetra-drake export runs/motors --out lab
    """
    from tetra_drake.lab.prototype.export import export

    chosen, chosen_gait = scenario_and_gait(scenario, gait, seed, engine)
    print(export(chosen, chosen_gait, rate=rate, out=out))
    print(f"wrote {out}/")


def _video(
    source: ResultOrGait,
    *,
    scenario: ScenarioName | None = None,
    size: Size = (1920, 1080),
    fps: FrameRate = 30.0,
    view: View = "free",
    speed: PlaybackSpeed = 1.0,
    out: File,
) -> None:
    """Write a video of a gait, for talks.

    Draws the frames of the replay page in a headless browser, without texts; the camera follows the
    robot. It needs Chromium or Chrome, and the Python packages playwright and imageio-ffmpeg. A
    frame takes about a second without a graphics card.

    Args:
        source: a folder written by `simulate`, a gait file, or a folder written by `evolve`
        scenario: (default: the scenario of its run, or thesis; for gait files only)
        size: (default: 1920x1080)
        fps: frames per second (default: %(default)s)
        view: (default: %(default)s)
        speed: speed as a multiple of the robot's (default: %(default)s)
        out: the file to write, .mp4 or .gif

    Example: tetra-drake video runs/champion --out talk.mp4 --view side
    """
    from tetra_drake.lab.films.video import check_video
    from tetra_drake.report.result_folder import load_or_simulate

    check_video(out, fps=fps)
    result = load_or_simulate(source, scenario=scenario, warn=warn)
    result.save_video(out, size=size, fps=fps, view=view, speed=speed, say=say)
    print(f"{result.title}\nwrote {out}")


def _compare(
    runs: list[RunFolder],
    *,
    labels: Labels | None = None,
    scenarios: bool = False,
    reach: Reach | None = None,
    width: Width = 7.0 * INCH,
    font: FontSize = 9.0,
    title: bool = True,
    pdf: bool = False,
    out: Folder | None = None,
) -> None:
    """Compare how well runs search.

    Compares the best fitness of each trial at the same number of simulations. An evaluation is
    one simulation, or one for each draw of disturbances. Prints interquartile means with bootstrap
    intervals, the probability that a trial of one run ends fitter than a trial of another with its
    interval, simulations until a trial reaches a distance, and time. With --out it writes
    trials.csv, curves.csv, summary.json and the figure comparison.

    Args:
        runs: folders written by `evolve`, finished or not, all with the same objective
        labels: names of the runs in tables and figures, one for each (default: of the folders)
        scenarios: compare the runs of each scenario, by its name; equal labels stand for one method
        width: width of the figure (default: 7 in)
        font: size of the figure's letters in points (default: %(default)s)
        title: draw without title
        pdf: also write a PDF file
        reach: also count simulations until a trial walks this distance, such as '14.34 in'
        out: write tables (CSV, JSON) and the figure into this folder

    Example: tetra-drake compare runs/thesis runs/cma-es --reach "14.34 in"
    """
    from tetra_drake.lab.comparison import (
        compare,
        compare_scenarios,
        comparison_text,
        improvement_over,
        improvement_text,
        save_comparison,
    )

    printed = print_of(width, font, title=title, pdf=pdf)
    if out:
        check_folder(out)
    if scenarios:
        by_scenario = compare_scenarios(runs, reach=reach, labels=labels)
    else:
        by_scenario = {"": compare(runs, reach=reach, labels=labels)}
    folders = file_names(by_scenario) if scenarios else {"": ""}
    for name, compared in by_scenario.items():
        print(f"\nScenario {name}:\n" if name else "", comparison_text(compared), sep="")
        if out:
            written = save_comparison(compared, out / folders[name], printed)
            print(f"wrote {', '.join(written)} to {out / folders[name]}/")
    if len(by_scenario) > 1:
        means = improvement_over(compared.trials for compared in by_scenario.values())
        print(f"\nMean over {len(by_scenario)} scenarios:\n\n{improvement_text(means)}")


def _fit(
    source: FitPath,
    *,
    scenario: ScenarioName | None = None,
    search: bool = False,
    out: Folder = Path("fit"),
) -> None:
    """Fit values of a scenario to measurements.

    Reads a YAML file with `parameters`, scenario keys with bounds, and `measurements`: a
    !MotionCapture has a log of positions over time, a !Rest has positions, tensions and frequencies
    at rest. Finds the values for which the simulation meets the measurements, with 95 percent
    intervals. Writes the fitted scenario.yaml, tables, the figure of the residuals, and the page
    fit.html, also as README.md.
    After Ctrl-C the same command goes on.

    Args:
        source: the file of the fit
        scenario: (default: scenario.yaml beside the file, or thesis)
        search: first search all values within the bounds, by CMA-ES; a few hundred simulations
        out: the folder to write to (default: %(default)s)

    Example: tetra-drake fit lab/fit.yaml --scenario prism --out fit
    """
    from tetra_drake.lab.fit.fit import fit
    from tetra_drake.lab.fit.measurements import load_fit_file
    from tetra_drake.robot.command_file import scenario_beside
    from tetra_drake.scenario.load import load_scenario

    given = load_fit_file(source)
    measurements, parameters = given.measurements, given.parameters
    chosen = load_scenario(scenario or scenario_beside(source) or "thesis")
    try:
        found = fit(
            chosen, measurements, parameters, search=search, out=out, say=say, source=source
        )
    except KeyboardInterrupt:
        raise KeyboardInterrupt("(nothing is lost; the same command goes on)") from None
    print(f"{found}\nwrote scenario.yaml, tables, figure, README.md and fit.html to {out}/")
    print(f"to see the fit, open in a browser: {out / 'fit.html'}")


def _predict(
    source: StructureName,
    *,
    quantities: Quantities | None = None,
    gait: GaitPath | None = None,
    command: CommandFile | None = None,
    draws: Count = 200,
    seed: Seed = 0,
    out: Folder | None = None,
) -> None:
    """Predict quantities with intervals, from the tolerances of a robot's numbers.

    Draws robots whose numbers differ within the `tolerances` of the file. Prints the median and the
    90 percent interval of each quantity, and which tolerance makes how much of its variance. Names
    of quantities: 'frequency 1', 'n3 z' (a node at rest), 'tension side n0 n3' or 'tension side'
    (mean of a group; also length, force_density), and with a gait or a command any metric, such as
    speed.

    Args:
        quantities: (default: three frequencies and mean tensions; with a gait or a command,
            distance and speed)
        draws: number of draws (default: %(default)s)
        seed: random seed of the draws (default: %(default)s)
        out: write the page predict.html, tables, figure and scenario into this folder

    Example: tetra-drake predict my.yaml --quantities 'n3 z' --out out
    """
    from tetra_drake.lab.bridges.formats import format_of
    from tetra_drake.lab.predict.predict import predict
    from tetra_drake.lab.study.equilibrium import robot_of_file
    from tetra_drake.robot.command_file import load_command
    from tetra_drake.scenario.load import load_scenario

    is_scenario = format_of(source) == "scenario"
    scenario = load_scenario(source) if is_scenario else robot_of_file(source).scenario
    played = None if command is None else load_command(command, scenario)
    if quantities is None:
        groups = dict.fromkeys(scenario.robot.blueprint().cable_groups)
        at_rest = [*(f"frequency {mode}" for mode in (1, 2, 3)), *(f"tension {g}" for g in groups)]
        quantities = at_rest if gait is None and command is None else ["distance", "speed"]
    driver: dict[str, Any] = {"gait": gait, "command": played}
    print(predict(scenario, quantities, **driver, draws=draws, seed=seed, out=out))
    if out:
        print(f"to see the predictions, open in a browser: {out / 'predict.html'}")


COMMANDS = (_robustness, _structure, _export, _video, _compare, _fit, _predict)
"""Functions of the commands, for the command line."""
