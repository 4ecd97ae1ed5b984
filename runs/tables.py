"""Tables of README.md, of the README in this folder and of recorded runs.

    python runs/tables.py [FILE ...]

Each table is in a Markdown file between two lines:

    <!--tables.py:NAME-->
    <!--end-->
"""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas
from analyse import DRAWN, SPEED, Analysis, load_analysis
from page import rendered
from parting import partings
from PIL import Image
from readings import load_tables
from record import EXPERIMENTS, PICTURE
from script import script
from settle import settled
from sine import TRIED, load_sines

from tetra_drake.errors import InputError
from tetra_drake.evolution.manifest import MANIFEST
from tetra_drake.evolution.run import load_run
from tetra_drake.files import read_text, write_whole
from tetra_drake.formatting import fixed, uncertain
from tetra_drake.laws.friction import Coulomb
from tetra_drake.scenario.load import SCENARIO, load_scenario
from tetra_drake.scenario.metrics import looks_for_turns
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.settings.units import INCH

HERE = Path(__file__).parent
FRONT = HERE.parent
"""Folder of the project's README."""
README = "README.md"
BEGIN, END = "<!--tables.py:", "<!--end-->"
"""What stands before the name of a table in a page, and after the table."""

APART = 0.3 * INCH
"""Largest difference (m) of distances on two engines that a page does not mention."""

OTHERS = {"undulation": "undulation-four", "rough-feedback": "rough"}
"""Runs with which others are compared on their pages."""

FAR = 5.0
"""Distance (in) from which a gait walks; of less, a difference in percent says little."""

Runs = Mapping[str, Analysis]
"""The analyses of recorded runs by name."""


def load_all(directory: Path = HERE) -> dict[str, Analysis]:
    """Existing recorded runs, in the order of EXPERIMENTS."""
    there = (name for name in EXPERIMENTS if (directory / name / MANIFEST).exists())
    return {name: load_analysis(directory / name) for name in there}


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
    reached: pandas.Series
    """Distances (m) by analyse.ENGINES, or angles (rad) if the objective is about turning; NaN if
    not simulated."""
    kept: float
    """Share of disturbed robots on which it does as well; NaN if it turns."""
    unit: float
    """Size (m, or rad) of the unit of shown distances or angles."""
    unit_name: str
    decimals: int = 2
    relative_speed: float = math.nan
    """Body lengths per second; NaN if unknown or if it turns."""
    known: tuple[float, float] = (math.nan, math.nan)
    """Range of all distances (m) that are known of this gait under its law of friction: on the
    engines, in starts moved by 1 nm, and on 90 % of disturbed robots. NaN if it turns."""

    def text(self, engine: str, digits: int = 2) -> str:
        """The distance, or the angle, on an engine."""
        reached = self.reached[engine]
        if math.isnan(reached):
            return "-"
        return fixed(reached / self.unit, min(digits, self.decimals)) + self.unit_name

    @property
    def first(self) -> str:
        """The distance on the first engine with the range of all that are known, or the angle."""
        value, low, high = np.array([self.reached["compiled"], *self.known]) / self.unit
        return uncertain(fixed(value, self.decimals), value, low, high) + self.unit_name


def best_of_all(runs: Runs) -> dict[str, Best]:
    """The best gaits of the runs, by name of the folder."""
    return {name: best_gait(name, run) for name, run in runs.items()}


def best_gait(name: str, run: Analysis) -> Best:
    """The best gait of a run."""
    trial, title, scenario = run.best_trial, EXPERIMENTS[name].title, scenario_of(name)
    gait, draws = run.best_gaits.loc[trial], run.disturbed.loc[trial]
    if looks_for_turns(scenario.objective):
        return Best(title, run.turns.loc[trial], math.nan, math.radians(1.0), "°", decimals=0)
    reached, changed = INCH * run.distances.loc[trial], INCH * gait["sensitivity_in"]
    # MuJoCo has Coulomb friction; under another law its distance is not one of this gait.
    alike = reached if isinstance(scenario.friction, Coulomb) else reached.drop("MuJoCo")
    compiled, units = reached["compiled"], scenario.units
    known = [*alike, compiled - changed, compiled + changed, *draws[list(DRAWN)]]
    kept, name_of_unit = float(draws["kept"]), f" {units.length_name}"
    ends = np.nanmin(known), np.nanmax(known)
    return Best(title, reached, kept, units.length, name_of_unit, 2, gait[SPEED], ends)


def gallery_table(runs: Runs) -> str:
    """Table of all runs with what their best gaits reach."""
    files = {"README": README, "PICTURE": PICTURE, "HERE": HERE, "aspect": aspect}
    return rendered("gallery.md", bests=best_of_all(runs), **files)


def differences(runs: Runs) -> pandas.DataFrame:
    """Differences of the best gaits' distances from the compiled engine's.

    Columns: run, trial, coulomb (True under Coulomb friction), diagram (in), mujoco (as a share;
    NaN for gaits that go less than FAR, or if not simulated), nanometre (in, in starts moved by
    1 nm). Runs with a policy are left out: a rover that rolls has chaotic impacts.
    """
    tables = {}
    for name, run in runs.items():
        if scenario_of(name).policy is None:
            table = run.distances
            share = (table["MuJoCo"] / table["compiled"] - 1.0).abs()
            table["mujoco"] = share.where(table["compiled"].abs() >= FAR)
            table["diagram"] = (table["diagram"] - table["compiled"]).abs()
            table["nanometre"] = run.best_gaits["sensitivity_in"]
            tables[name] = table.assign(coulomb=isinstance(scenario_of(name).friction, Coulomb))
    every = pandas.concat(tables, names=["run", "trial"]).reset_index()
    return every[["run", "trial", "coulomb", "diagram", "mujoco", "nanometre"]]


def trust_table(runs: Runs) -> str:
    """Table of the differences between engines by law of friction, and their causes."""
    return rendered("trust.md", gaits=differences(runs))


def results_table(runs: Runs) -> str:
    """Table of the thesis's results and ours, for README.md."""
    names, tables = {"thesis": "thesis", "thesis-listing": "listing"}, load_tables()
    best = [best_gait(name, runs[name]) for name in names]
    trials = [tables[reading] for reading in names.values()]
    return rendered("results.md", names=[*names], best=best, trials=trials)


def trials_table(name: str, runs: Runs) -> str:
    """List of the fittest gaits of the trials of a run, on two engines and on disturbed robots.
    Below it, the trials with another distance on the diagram, and the farthest sine."""
    run, units = runs[name], scenario_of(name).units
    rows, most = run.distances * INCH / units.length, APART / units.length
    rows["kept"] = 100.0 * run.disturbed["kept"]
    apart = rows[~((rows["compiled"] - rows["diagram"]).abs() <= most)]
    sine = {"sine": load_sines().get(name), "tried": TRIED}
    return rendered("trials.md", rows=rows, apart=apart, most=most, units=units, **sine)


def partings_table(name: str, other: str) -> str:
    """Table of where the trials of a run part from the same trials of another run."""
    found = partings(load_run(HERE / name), load_run(HERE / other))
    return rendered("partings.md", rows=found, name=name, other=other)


def pages(runs: Runs) -> list[Path]:
    """All pages with tables."""
    return [FRONT / README, HERE / README, *(HERE / name / README for name in runs)]


def made_again(page: Path, runs: Runs) -> str:
    """Text of a page with new tables. Raises InputError if the page cannot be read or a table has
    no end, KeyError for an unknown table."""
    name = page.parent.name
    tables = {
        "results": lambda: results_table(runs),
        "gallery": lambda: gallery_table(runs),
        "trust": lambda: trust_table(runs),
        "trials": lambda: trials_table(name, runs),
        "settled": lambda: settled(HERE / OTHERS[name], HERE / name),
        "partings": lambda: partings_table(name, "thesis"),
    }
    text, *parts = read_text(page, "page").split(BEGIN)
    for part in parts:
        table, _, rest = part.partition("-->")
        _, has_end, after = rest.partition(END)
        if not has_end:
            raise InputError(page, table, f"has no {END} before the next table or the page's end")
        text += f"{BEGIN}{table}-->\n\n{tables[table]().rstrip()}\n\n{END}{after}"
    return text


@script
def main(arguments: Sequence[str]) -> None:
    """Runs the script: writes the tables of the given Markdown files, or of all pages."""
    runs = load_all()
    for page in [Path(name).resolve() for name in arguments] or pages(runs):
        write_whole(page, made_again(page, runs))
