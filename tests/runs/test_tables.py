"""The tables of analyses of which everything is known, and their places in a page."""

import json

import pytest
import tables
from analyse import ANALYSIS, MUJOCO, TIGHT

from tetra_drake.evolution.manifest import MANIFEST
from tetra_drake.scenario.units import INCH, POUND_FORCE

BEST = {"coulomb": {0: 12.0}, "thesis": {0: 20.0, 1: 5.0}}
"""Distance (in) of the best gait of each trial."""

CHANGES = {"spacing": (2, 0.25), "start": (0, None)}
"""Failures and rank correlation of what is changed."""


def best_gait(trial, distance):
    numbers = {"cost_of_transport": 4.0, "tension": 2.0 * POUND_FORCE, "clearance": 0.5 * INCH}
    counts = {"trial": trial, "evaluation": 3, "evaluations": 5}
    return counts | {"fitness": 2.0 * distance} | numbers


def disturbed(trial, distance):
    """Half of the draws are kept; the mean is 4 in."""
    quantiles = {"5 %": 1.0 * INCH, "50 %": 2.0 * INCH, "95 %": 3.0 * INCH}
    means = dict.fromkeys(("mean", "mean_low", "mean_high"), 4.0 * INCH)
    kept = {"kept": 0.5, "kept_low": 0.4, "kept_high": 0.61}
    return {"gait": trial, "undisturbed": distance * INCH, "failed": 0} | quantiles | means | kept


def changed(what):
    failed, correlation = CHANGES[what]
    distances = {"median": 0.6 * INCH, "worst": -INCH, "failed": failed}
    ranks = {"correlation": correlation, "correlation_size": correlation}
    return {"what": what} | distances | ranks


@pytest.fixture
def runs(tmp_path):
    """The analyses of two runs, in which later trials change more on other engines."""
    for name, best in BEST.items():
        again = [
            {"trial": trial, "setting": setting}
            | {"distance_in": distance + change * (1 + trial * 0.5)}
            for trial, distance in best.items()
            for setting, change in ((TIGHT, 0.25), (MUJOCO, -3.0))
        ]
        content = {
            "versions": {},
            "best_gaits": [best_gait(*gait) for gait in best.items()],
            "resimulations": again,
            "robustness": {
                "gaits": [disturbed(*gait) for gait in best.items()],
                "changes": [changed(what) for what in CHANGES],
            },
        }
        (tmp_path / name).mkdir()
        (tmp_path / name / MANIFEST).touch()
        (tmp_path / name / ANALYSIS).write_text(json.dumps(content))
    return tables.load_all(tmp_path)


def rows(table):
    """The cells of a table's rows, without headings."""
    lines = [line for line in table.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


def test_the_gallery_shows_the_best_gait_of_each_run(runs):
    thesis, coulomb = rows(tables.gallery_table(runs))
    assert "`thesis`" in thesis[1] and "`coulomb`" in coulomb[1]
    assert thesis[2:] == ["20.00", "20.25", "50 %"]
    assert coulomb[2:] == ["12.00", "12.25", "50 %"]


def test_a_runs_trials_are_shown_on_all_engines_and_disturbed(runs):
    table = tables.trials_table(runs["thesis"])
    best, second = rows(table)
    distances = ["20.00", "20.25", "17.00", "4.00"]
    metrics = ["4.00", "2.00", "0.50"]
    assert best == ["0", "5", "40.00", *distances, "50 % (40 to 61)", *metrics]
    assert second[:6] == ["1", "5", "10.00", "5.00", "5.38", "0.50"]
    assert table.endswith("in trial 1."), "where the engines differ"
    assert tables.trials_table(runs["coulomb"]).endswith("|")


def test_what_hurts_the_gaits_is_shown(runs):
    spacing, start = rows(tables.changes_table(runs["thesis"]))
    assert spacing == ["spacing", "0.60 (-1.00, 2 failed)", "+0.25 (0.25)"]
    assert start == ["start", "0.60 (-1.00)", "-"]


BEGIN, END = "<!-- table {}: made by runs/tables.py -->\n", "<!-- end -->\n"
FIRST, SECOND = BEGIN.format("one"), BEGIN.format("two")
PAGE = f"# Title\n\n{FIRST}old\n\nolder\n{END}\ntext\n{SECOND}{END}"


def test_tables_replace_what_stands_between_their_markers():
    expected = f"# Title\n\n{FIRST}\n| 1 |\n\n{END}\ntext\n{SECOND}\n| 2 |\n\n{END}"
    make = {"one": "| 1 |", "two": "| 2 |"}.__getitem__
    assert tables.filled(PAGE, make) == expected
    assert tables.filled(expected, make) == expected
    for page in (PAGE.rsplit(END, 1)[0], PAGE.replace(END, "", 1)):
        with pytest.raises(ValueError, match="table"):
            tables.filled(page, str)
