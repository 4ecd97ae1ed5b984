"""The tables of runs of which everything is known, and their places in a page."""

import json

import pytest
import tables
from analyse import ANALYSIS
from helpers.synthetic_run import tiny_scenario, write_run

from tetra_drake.evolution.json_lines import read_lines
from tetra_drake.evolution.record import REEVALUATIONS, trial_folder
from tetra_drake.scenario.units import INCH

INITIAL = [(8.0, 0), (-4.0, 1), (None, 2)]
"""The initial population of a trial: its best walks 4 in, one of the two that walk backward."""

TRIALS = {
    "thesis": [[INITIAL, [(40.0, 1), (0.0, None)]], [INITIAL, [(10.0, 0), (9.0, 2)]]],
    "thesis-listing": [[INITIAL, [(12.0, 1), (None, None)]]],
    "thesis-drake": [[INITIAL]],
}
BEST = {"thesis": {0: (3, 20.0), 1: (3, 5.0)}, "thesis-listing": {0: (3, 6.0)}}
BEST["thesis-drake"] = {0: (0, 4.0)}
"""Evaluation and distance (in) of the best gait of each trial."""


def write_analysis(path, best):
    """An analysis in which every gait changes alike, and keeps half of the draws."""
    walk = {"off_ground": {"T1": 0.25, "T2": 0.5}, "frequencies_hz": {"T1-T2": 0.8, "T2-T3": None}}
    settings = (("default", 0.0), ("finer", 0.01), ("coarser", -0.5))
    quantiles = {"5 %": 1.0 * INCH, "50 %": 2.0 * INCH, "95 %": 3.0 * INCH}
    content = {
        "schema": 2,
        "oscillator": {"tau_a_s": 0.3, "frequency_hz": 0.53},
        "best_gaits": [
            {"trial": trial, "evaluation": index, "distance_in": distance} | walk
            for trial, (index, distance) in best.items()
        ],
        "resimulations": [
            {"trial": trial, "distance_in": distance + change, "setting": name, "failure": None}
            for trial, (_, distance) in best.items()
            for name, change in settings
        ],
        "robustness": {
            "gaits": [
                {"gait": trial, "undisturbed": distance * INCH, "failed": 0, **quantiles}
                | {name: 4.0 * INCH for name in ("mean", "mean_low", "mean_high")}
                | {"kept": 0.5, "kept_low": 0.4, "kept_high": 0.61}
                for trial, (_, distance) in best.items()
            ],
            "over_gaits": [
                {"of": name, "median": 0.5, "low": 0.25, "high": 1.0}
                for name in ("undisturbed", "mean", "kept")
            ],
            "changes": [
                {"what": what, "median": 0.6 * INCH, "worst": -INCH, "failed": failed}
                | {"correlation": correlation, "correlation_size": correlation}
                for what, failed, correlation in (("spacing", 2, 0.25), ("start", 0, None))
            ],
        },
    }
    path.write_text(json.dumps(content))


@pytest.fixture
def folder(tmp_path):
    for name, iterations in TRIALS.items():
        run = write_run(tmp_path / name, iterations, scenario=tiny_scenario(name=name))
        write_analysis(run / ANALYSIS, BEST[name])
    return tmp_path


def cells(name, folder):
    """The cells of a table by the first cell of their row."""
    lines = tables.TABLES[name](tables.load_all(folder)).splitlines()
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    assert len({len(row) for row in rows}) == 1
    return {row[0]: row[1:] for row in rows}


def test_the_comparison_shows_each_run_beside_the_thesis(folder):
    rows = cells("comparison", folder)
    for row, expected in {
        "best initial distance, in": ["about 6.6", "4.00", "4.00", "4.00"],
        "initial gaits that go backward": ["nearly half", "50 % of 4", "50 % of 2", "50 % of 2"],
        "best evolved distance, in": ["14.34", "20.00", "6.00", "4.00"],
        "the same gait on the Drake diagram, in": ["–", "20.00", "6.00", "4.00"],
        "mean fitness, best trial, in": ["–", "2.00 → 24.00", "2.00 → 10.00", "2.00 → 2.00"],
        "rise of the best distance, average trial": ["32 %", "212 %", "50 %", "0 %"],
        "frequency of each signal, best gait, Hz": ["no number", *["0.80, -"] * 3],
        "seconds per iteration": ["22", "1", "1", "1"],
    }.items():
        assert rows[row] == expected


def test_gaits_are_shown_per_trial_and_their_robustness_with_intervals(folder):
    distance, _, hertz, *lifted = cells("best-gaits", folder)["`thesis`, trial 1"]
    assert (distance, hertz, lifted) == ("5.00", "0.80", ["25", "50"])
    again = cells("resimulation", folder)
    assert again["`thesis`, trial 1"] == ["5.00", "5.00", "5.01", "4.50"]
    assert again["*`thesis`: median difference*"] == ["0.00", "", "0.01", "0.50"]
    rows = cells("robustness", folder)
    assert rows["spacing"] == ["0.60 (-1.00, 2 failed)", "+0.25 (0.25)"]
    assert rows["start"] == ["0.60 (-1.00)", "-"]
    gaits = cells("robust-gaits", folder)
    mean, kept = "4.00 (4.00 to 4.00)", "50 % (40 to 61)"
    assert gaits["`thesis`, trial 1"] == ["5.00", "1.00", "2.00", "3.00", mean, kept]
    assert gaits["*`thesis`: median of the gaits*"][-1] == "50 % (25 to 100)"
    assert "*`thesis-drake`: median of the gaits*" not in gaits
    rows = cells("tau-mutation", folder)
    assert (rows["0"][0::4], rows["0"][3::4]) == (["20.00", "6.00"], ["1", "1"])
    assert rows["1"][4:] == ["-"] * 4
    assert rows["**mean**"][0::4] == ["12.50", "6.00"]


def test_the_engines_agree_as_far_as_the_reevaluations_do(folder):
    trial = trial_folder(folder / "thesis", 0)
    first, second, failed, best, _ = read_lines(trial / "evaluations.jsonl")
    for entry, off in ((first, 0.05), (second, -0.15), (best, 1.0)):
        entry["metrics"]["distance"] += off * INCH
    lines = [json.dumps(entry) + "\n" for entry in (first, second, failed, best)]
    (trial / REEVALUATIONS).write_text("".join(lines))
    rows = cells("engines", folder)
    assert rows["`thesis`, initial gaits"] == ["2", "1", "0.100", "0.14", "50 %", "100.0 %"]
    assert rows["`thesis`, best gaits"][:3] == ["1", "0", "1.000"]


def test_an_analysis_of_other_gaits_is_refused(folder, refused):
    write_analysis(folder / "thesis" / ANALYSIS, {0: (3, 20.0), 1: (0, 5.0)})
    with refused(folder / "thesis" / ANALYSIS, "best_gaits", "analyse.py"):
        tables.load_all(folder)


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
