"""Tables of the README in this folder, and of the READMEs of recorded runs; the page index.html.

    python runs/tables.py [FILE ...]

Each table is in a Markdown file between two lines:

    <!-- table NAME: made by runs/tables.py -->
    <!-- end -->

index.html shows all runs. Each picture opens the replay of a run, on any host of static files.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import jinja2
import numpy as np
from analyse import MUJOCO, SHOWN, TIGHT, Analysis, load_analysis
from PIL import Image
from record import DIAGRAM, EXPERIMENTS, PICTURE

from tetra_drake.errors import InputError
from tetra_drake.evolution.manifest import MANIFEST
from tetra_drake.files import read_text, write_whole
from tetra_drake.formatting import Table, fixed, listed, rounded
from tetra_drake.report.result_folder import REPLAY
from tetra_drake.scenario.load import SCENARIO, load_scenario
from tetra_drake.scenario.metrics import UNITS
from tetra_drake.scenario.units import INCH, Units

HERE = Path(__file__).parent
README, GALLERY = "README.md", "index.html"

APART = 0.3 * INCH
"""Largest difference (m) of distances on two engines that a page does not mention."""

HEIGHT = 96
"""Height of pictures in the gallery's table, in pixels."""

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
    """A picture of a run, HEIGHT high. Its width is given, as pages make wide pictures narrower."""
    if file.endswith(".svg"):
        text = read_text(HERE / name / file, "picture")
        wide, high = re.findall(r'(?:width|height)="([\d.]+)pt"', text)
    else:
        with Image.open(HERE / name / file) as picture:
            wide, high = picture.size
    width = round(HEIGHT * float(wide) / float(high))
    return f'<img src="{name}/{file}" width="{width}" alt="{about}">'


def units_of(name: str) -> Units:
    """Units of the scenario of a run."""
    return load_scenario(HERE / name / SCENARIO).units


def gallery_table(runs: Runs) -> str:
    """Table of all runs with the distances of their best gaits."""
    rows = []
    for name, run in runs.items():
        best, units = run.best_trial, units_of(name)
        picture = shown(name, PICTURE, f"{name} walking")
        diagram = shown(name, f"{DIAGRAM}.svg", f"gait diagram of {name}")
        title = f"[`{name}`]({name}/{README}): {EXPERIMENTS[name].title}"
        title += f"<br>{picture} {diagram} [replay]({name}/{REPLAY})"
        distances = [
            f"{fixed(inches * INCH / units.length)} {units.length_name}"
            for inches in (run.undisturbed(best), run.again(best, TIGHT))
        ]
        kept = f"{100.0 * run.disturbed.loc[best, 'kept']:.0f} %"
        rows.append([title, *distances, kept])
    headings = ["experiment", "distance", "on the diagram", "keeps"]
    return Table(headings, rows).markdown()


def gallery_page(runs: Runs) -> str:
    """The page index.html."""
    cards = []
    for name, run in runs.items():
        units = units_of(name)
        best = run.undisturbed(run.best_trial) * INCH / units.length
        cards.append((name, EXPERIMENTS[name].title, f"{fixed(best, 1)} {units.length_word}"))
    source = read_text(HERE / f"{GALLERY}.jinja", "template")
    template = jinja2.Template(source, autoescape=True, keep_trailing_newline=True)
    return template.render(cards=cards, replay=REPLAY, picture=PICTURE)


def trials_table(run: Analysis, units: Units) -> str:
    """Table of the fittest gait of each trial on all engines and on disturbed robots. Below it, the
    trials with different distances on the engines."""
    of_metrics = {name: units.of(UNITS[name]) for name in SHOWN}
    rows, apart = [], []
    for trial, gait in run.best_gaits.iterrows():
        compiled, tight = run.undisturbed(trial), run.again(trial, TIGHT)
        if not INCH * abs(compiled - tight) <= APART:
            apart.append(trial)
        judged = run.disturbed.loc[trial]
        inches = np.array([compiled, tight, run.again(trial, MUJOCO), judged["mean"] / INCH])
        distances = inches * INCH / units.length
        share, low, high = 100.0 * judged[["kept", "kept_low", "kept_high"]]
        kept = f"{share:.0f} ({low:.0f}–{high:.0f})"
        metrics = [gait[name] / size for name, (size, _) in of_metrics.items()]
        counts = [f"{trial}", f"{gait['evaluations']:.0f}", fixed(gait["fitness"])]
        rows.append([*counts, *map(fixed, distances), kept, *map(fixed, metrics)])
    headings = ["trial", "gaits", "fitness"]
    for engine in ("compiled", "diagram", "MuJoCo", "disturbed"):
        headings.append(f"{engine} ({units.length_name})")
    headings.append("keeps (%)")
    for name, (_, unit) in of_metrics.items():
        title = name.replace("_", " ")
        headings.append(f"{title} ({unit})" if unit else title)
    table = Table(headings, rows).markdown()
    if not apart:
        return table
    trials = "trial" if len(apart) == 1 else "trials"
    apart_by = f"{rounded(APART / units.length, 1)} {units.length_word}"
    return f"{table}\n\nThe engines differ by more than {apart_by} in {trials} {listed(apart)}."


def pages(runs: Runs) -> list[Path]:
    """All pages with tables."""
    return [HERE / README, *(HERE / name / README for name in runs)]


def made_again(page: Path, runs: Runs) -> str:
    """Text of a page with a new table: the gallery, or the trials of the page's run. Raises
    InputError if the page cannot be read."""

    def make_table(name: str) -> str:
        tables = {
            "gallery": lambda: gallery_table(runs),
            "trials": lambda: trials_table(runs[page.parent.name], units_of(page.parent.name)),
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
