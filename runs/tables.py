"""Tables of README.md, of the README in this folder and of recorded runs; the page index.html.

    python runs/tables.py [FILE ...]

Each table is in a Markdown file between two lines:

    <!-- table NAME: made by runs/tables.py -->
    <!-- end -->

index.html shows all runs. Each picture opens the replay of a run, on any host of static files.
"""

from __future__ import annotations

import functools
import math
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import jinja2
import numpy as np
import pandas
from analyse import DRAWN, MUJOCO, SHOWN, SPEED, TIGHT, TURNED, Analysis, load_analysis
from parting import partings
from PIL import Image
from readings import RECORD, load_record
from record import DIAGRAM, EXPERIMENTS, PICTURE, load_times

from tetra_drake.errors import InputError
from tetra_drake.evolution.manifest import MANIFEST
from tetra_drake.evolution.run import load_run
from tetra_drake.files import read_text, write_whole
from tetra_drake.formatting import TextTable, fixed, listed, rounded, uncertain
from tetra_drake.laws.friction import Coulomb
from tetra_drake.report.result_folder import REPLAY
from tetra_drake.scenario.load import SCENARIO, load_scenario
from tetra_drake.scenario.metrics import UNITS, looks_for_turns
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.settings.units import INCH, Units

HERE = Path(__file__).parent
FRONT = HERE.parent
"""Folder of the project's README."""
README, GALLERY = "README.md", "index.html"

APART = 0.3 * INCH
"""Largest difference (m) of distances on two engines that a page does not mention."""

HEIGHT = 96
"""Height of pictures in the gallery's table, in pixels."""

ENGINES = ("compiled", "diagram", "MuJoCo")

MEASURED = {
    "simplex": "a simplex of 2 m: heights under load",
    "spine": "a planar spine: poses",
    "jumper": "a jumper of six struts: height of jumps",
}
"""Figures of the folder `measured`, with what they show."""

PLANNED = {
    "goals": "twenty goals, on three robots",
    "courses": "courses with pillars",
}
"""Figures of the folder `planning`, with what they show."""

FAR = 5.0
"""Distance (in) from which a gait walks; of less, a difference in percent says little."""

_TABLE = re.compile(
    r"(?P<begin><!-- table (?P<name>\S+): made by runs/tables.py -->)\n.*?<!-- end -->", re.DOTALL
)


Runs = Mapping[str, Analysis]
"""The analyses of recorded runs by name."""


def load_all(directory: Path = HERE) -> dict[str, Analysis]:
    """Existing recorded runs, in the order of EXPERIMENTS."""
    there = (name for name in EXPERIMENTS if (directory / name / MANIFEST).exists())
    return {name: load_analysis(directory / name) for name in there}


def shown(name: str, file: str, about: str) -> str:
    """HTML of a picture of a run, HEIGHT high. It has a width, too: pages shrink wide pictures."""
    width = round(HEIGHT * aspect(HERE / name / file))
    return f'<img src="{name}/{file}" width="{width}" alt="{about}">'


def aspect(picture: Path) -> float:
    """Width of a picture over its height. Raises InputError if a drawing cannot be read."""
    if picture.suffix == ".svg":
        text = read_text(picture, "picture")
        width, height = map(float, re.findall(r'(?:width|height)="([\d.]+)pt"', text)[:2])
    else:
        with Image.open(picture) as opened:
            width, height = opened.size
    return width / height


@functools.cache
def scenario_of(name: str) -> Scenario:
    """Scenario of a run."""
    return load_scenario(HERE / name / SCENARIO)


@dataclass(frozen=True)
class Best:
    """The best gait of a run for the gallery."""

    title: str
    diagram: str
    """File of the picture beside PICTURE."""
    reached: Mapping[str, float]
    """Distances (m) by ENGINES, or angles (rad) if the objective is about turning; NaN if not
    simulated."""
    kept: float
    """Share of disturbed robots on which it does as well; NaN if it turns."""
    units: Units
    turns: bool = False
    relative_speed: float = math.nan
    """Body lengths per second; NaN if unknown or if it turns."""
    known: tuple[float, float] = (math.nan, math.nan)
    """Range of all distances (m) that are known of this gait under its law of friction: on the
    engines, in starts moved by 1 nm, and on 90 % of disturbed robots. NaN if it turns."""

    @property
    def speed(self) -> str:
        """Speed in body lengths per second as text; "-" if it is NaN."""
        return rounded(self.relative_speed, 2)

    def text(self, engine: str, digits: int = 2) -> str:
        """The distance, or the angle, on an engine."""
        reached = self.reached[engine]
        if math.isnan(reached):
            return "-"
        if self.turns:
            return f"{math.degrees(reached):.0f}°"
        return f"{fixed(reached / self.units.length, digits)} {self.units.length_name}"

    @property
    def first(self) -> str:
        """The distance on the first engine with the range of all that are known, or the angle."""
        if self.turns:
            return self.text(ENGINES[0])
        length, low, high = np.array([self.reached[ENGINES[0]], *self.known]) / self.units.length
        return f"{uncertain(fixed(length), length, low, high)} {self.units.length_name}"


def best_of_all(runs: Runs) -> dict[str, Best]:
    """The best gaits of the runs, by name of the folder."""
    return {name: best_gait(name, run) for name, run in runs.items()}


def best_gait(name: str, run: Analysis) -> Best:
    """The best gait of a run."""
    trial, title, scenario = run.best_trial, EXPERIMENTS[name].title, scenario_of(name)
    reached, kept = distances_of(run, trial), float(run.disturbed.loc[trial, "kept"])
    turns = looks_for_turns(scenario.objective)
    if turns:
        again = [run.again(trial, setting, TURNED) for setting in (TIGHT, MUJOCO)]
        reached, kept = np.array([run.best_gaits.loc[trial, TURNED], *again]), math.nan
    by_engine = dict(zip(ENGINES, reached, strict=True))
    gait, draws = run.best_gaits.loc[trial], run.disturbed.loc[trial]
    changed = INCH * gait["sensitivity_in"]
    # MuJoCo has Coulomb friction; under another law its distance is not one of this gait.
    alike = reached if isinstance(scenario.friction, Coulomb) else reached[:2]
    known = [*alike, reached[0] - changed, reached[0] + changed, *draws[list(DRAWN)]]
    return Best(
        title,
        f"{DIAGRAM}.svg",
        by_engine,
        kept,
        scenario.units,
        turns,
        relative_speed=math.nan if turns else gait[SPEED],
        known=(math.nan, math.nan) if turns else (np.nanmin(known), np.nanmax(known)),
    )


def distances_of(run: Analysis, trial: int) -> np.ndarray:
    """Distances (m) of a trial's fittest gait, in the order of ENGINES; NaN if not simulated."""
    return INCH * np.array(
        [run.undisturbed(trial), run.again(trial, TIGHT), run.again(trial, MUJOCO)]
    )


def gallery_table(runs: Runs) -> str:
    """Table of all runs with what their best gaits reach, and the work of two cores."""
    minutes = {
        name: sum(stage["cores_s"] for stage in stages.values()) / (2 * 60)
        for name, stages in load_times(HERE).items()
    }
    rows = []
    for name, best in best_of_all(runs).items():
        picture = shown(name, PICTURE, f"{name} walking")
        diagram = shown(name, best.diagram, f"how {name} moves")
        title = f"[`{name}`]({name}/{README}): {best.title}"
        title += f"<br>{picture} {diagram} [replay]({name}/{REPLAY})"
        reached = [best.first, *(best.text(engine) for engine in ENGINES[1:])]
        keeps = "-" if math.isnan(best.kept) else f"{100.0 * best.kept:.0f} %"
        rows.append([title, *reached, best.speed, keeps, fixed(minutes.get(name, math.nan), 0)])
    rows.append(["all", *["" for _ in ENGINES], "", "", fixed(sum(minutes.values()), 0)])
    return TextTable(
        ["experiment", *ENGINES, "body lengths/s", "keeps", "minutes"], rows
    ).markdown()


def differences(runs: Runs) -> pandas.DataFrame:
    """Differences of the best gaits' distances from the compiled engine's.

    Columns: run, trial, coulomb (True under Coulomb friction), diagram (in), mujoco (as a share;
    NaN for gaits that go less than FAR, or if not simulated), nanometre (in, in starts moved by
    1 nm). Runs with a policy are left out: a rover that rolls has chaotic impacts.
    """
    rows = []
    for name, run in runs.items():
        if scenario_of(name).policy is not None:
            continue
        for trial, gait in run.best_gaits.iterrows():
            compiled, diagram, mujoco = distances_of(run, trial) / INCH
            rows.append(
                {
                    "run": name,
                    "trial": trial,
                    "coulomb": isinstance(scenario_of(name).friction, Coulomb),
                    "diagram": abs(diagram - compiled),
                    "mujoco": abs(mujoco / compiled - 1.0) if abs(compiled) >= FAR else math.nan,
                    "nanometre": gait["sensitivity_in"],
                }
            )
    return pandas.DataFrame(rows)


def trust_table(runs: Runs) -> str:
    """Table of the differences between engines and their causes, by law of friction."""
    rows, found = [], differences(runs)
    for law, is_coulomb in (("Coulomb", True), ("the thesis's", False)):
        under_law = found[found["coulomb"] == is_coulomb]
        inches = under_law[["diagram", "nanometre"]].agg(["median", "max"])
        percent = [f"{100.0 * x:.0f} %" for x in under_law["mujoco"].agg(["median", "max"])]
        numbers = [fixed(x, 4) for x in inches.to_numpy().T.ravel()]
        rows.append([law, f"{under_law['run'].nunique()}", f"{len(under_law)}", *numbers, *percent])
    headings = ["friction", "runs", "gaits", "diagram, median (in)", "largest"]
    headings += ["1 nm, median (in)", "largest", "MuJoCo, median", "largest"]
    return TextTable(headings, rows).markdown()


def results_table(runs: Runs) -> str:
    """Table of the thesis's results and ours, for README.md."""
    names = {"thesis": "thesis", "thesis-listing": "listing"}
    readings, columns = load_record(RECORD), []
    for name, reading in names.items():
        best, trials = best_gait(name, runs[name]), pandas.DataFrame(readings[reading])
        columns.append(
            [
                fixed(trials["initial_farthest_in"].max()),
                f"{100.0 * trials['backward'].mean():.0f} %",
                best.text("compiled").removesuffix(" in"),
                best.text("diagram").removesuffix(" in"),
                fixed(trials["best_in"].mean()),
            ]
        )
    labels = {
        "best gait of ten initial populations": "6.6",
        "initial gaits that walk backward": "nearly half",
        "best evolved gait": "14.34",
        "the same on the Drake diagram": "",
        "best evolved gait, mean of ten trials": "",
    }
    rows = [[*row, *cells] for row, *cells in zip(labels.items(), *columns, strict=True)]
    headings = [f"[`{name}`]({HERE.name}/{name}/{README})" for name in names]
    return TextTable(["distance in 15 s, inches", "thesis", *headings], rows).markdown()


def gallery_page(runs: Runs) -> str:
    """The page index.html."""
    source = read_text(HERE / f"{GALLERY}.jinja", "template")
    template = jinja2.Template(source, autoescape=True, keep_trailing_newline=True)
    bests = best_of_all(runs)
    figures = {"measured": MEASURED, "planned": PLANNED}
    return template.render(bests=bests, replay=REPLAY, picture=PICTURE, **figures)


def trials_table(name: str, runs: Runs) -> str:
    """Table of the fittest gait of each trial of a run, on all engines and on disturbed robots.
    Below it, the trials with different distances on the engines."""
    run, units = runs[name], scenario_of(name).units
    of_metrics = {name: units.of(UNITS[name]) for name in SHOWN}
    rows, apart = [], []
    for trial, gait in run.best_gaits.iterrows():
        compiled, diagram, mujoco = distances_of(run, trial)
        if not abs(compiled - diagram) <= APART:
            apart.append(trial)
        judged = run.disturbed.loc[trial]
        distances = np.array([compiled, diagram, mujoco, judged["mean"]]) / units.length
        share, low, high = 100.0 * judged[["kept", "kept_low", "kept_high"]]
        kept = f"{share:.0f} ({low:.0f}–{high:.0f})"
        metrics = [gait[name] / size for name, (size, _) in of_metrics.items()]
        counts = [f"{trial}", f"{gait['evaluations']:.0f}", fixed(gait["fitness"])]
        rows.append([*counts, *map(fixed, distances), kept, *map(fixed, metrics)])
    headings = ["trial", "gaits", "fitness"]
    headings += [f"{where} ({units.length_name})" for where in (*ENGINES, "disturbed")]
    headings.append("keeps (%)")
    for name, (_, unit) in of_metrics.items():
        title = name.replace("_", " ")
        headings.append(f"{title} ({unit})" if unit else title)
    table = TextTable(headings, rows).markdown()
    if not apart:
        return table
    trials = "trial" if len(apart) == 1 else "trials"
    apart_by = f"{rounded(APART / units.length, 1)} {units.length_word}"
    return f"{table}\n\nThe engines differ by more than {apart_by} in {trials} {listed(apart)}."


def partings_table(name: str, other: str) -> str:
    """Table of where the trials of a run part from the same trials of another run."""
    found = partings(load_run(HERE / name), load_run(HERE / other))
    columns = ["apart", "farthest", "first_best", "second_best"]
    counts = found[["evaluations", "alike"]].astype(str)
    rows = [
        [f"{trial}", *counts.loc[trial], *map(fixed, numbers)]
        for trial, numbers in found[columns].iterrows()
    ]
    headings = [
        "trial",
        "gaits",
        "the same gaits",
        "their distances, apart by (in)",
        "at most (in)",
    ]
    return TextTable([*headings, f"`{name}` (in)", f"`{other}` (in)"], rows).markdown()


def pages(runs: Runs) -> list[Path]:
    """All pages with tables."""
    return [FRONT / README, HERE / README, *(HERE / name / README for name in runs)]


def made_again(page: Path, runs: Runs) -> str:
    """Text of a page with new tables. Raises InputError if the page cannot be read."""

    def make_table(name: str) -> str:
        tables = {
            "results": lambda: results_table(runs),
            "gallery": lambda: gallery_table(runs),
            "trust": lambda: trust_table(runs),
            "trials": lambda: trials_table(page.parent.name, runs),
            "partings": lambda: partings_table(page.parent.name, "thesis"),
        }
        return tables[name]()

    return filled(read_text(page, "page"), make_table)


def filled(text: str, make_table: Callable[[str], str]) -> str:
    """A text with new tables between the marker lines.

    Raises KeyError for an unknown table, ValueError for one without an end.
    """

    def remade(match: re.Match[str]) -> str:
        if match[0].count("<!-- table ") > 1:
            raise ValueError(f"table {match['name']} has no end before the next one")
        return f"{match['begin']}\n\n{make_table(match['name'])}\n\n<!-- end -->"

    text, tables = _TABLE.subn(remade, text)
    if tables < text.count("<!-- table "):
        raise ValueError("the last table has no end")
    return text


def main(arguments: Sequence[str]) -> None:
    """Runs the script: writes the tables of the given Markdown files, or of all pages and
    index.html."""
    runs = load_all()
    for page in [Path(name).resolve() for name in arguments] or pages(runs):
        write_whole(page, made_again(page, runs))
    if not arguments:
        write_whole(HERE / GALLERY, gallery_page(runs))


if __name__ == "__main__":
    try:
        main(sys.argv[1:])
    except InputError as error:
        sys.exit(f"tables.py: {error}")
