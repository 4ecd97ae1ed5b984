"""The tables of runs of which everything is known, and their places in a page."""

import json

import pytest
import tables
from analyse import ANALYSIS, MUJOCO, TIGHT
from helpers.synthetic_run import tiny_scenario, write_run

from tetra_drake.evolution.entries import REEVALUATIONS, trial_folder
from tetra_drake.evolution.json_lines import read_lines
from tetra_drake.scenario.units import INCH, POUND_FORCE

INITIAL = [(8.0, 0), (-4.0, 1), (None, 2)]
"""The initial population of a trial: its best walks 4 in, one of the two that walk backward."""

TRIALS = {
    "thesis": [[INITIAL, [(40.0, 1), (0.0, None)]], [INITIAL, [(10.0, 0), (9.0, 2)]]],
    "thesis-listing": [[INITIAL, [(12.0, 1), (None, None)]]],
    "thesis-drake": [[INITIAL]],
}
TRIALS["coulomb"] = [[INITIAL, [(24.0, 1)]]]
BEST = {"thesis": {0: (3, 20.0), 1: (3, 5.0)}, "thesis-listing": {0: (3, 6.0)}}
BEST["coulomb"] = {0: (3, 12.0)}
BEST["thesis-drake"] = {0: (0, 4.0)}
"""Evaluation and distance (in) of the best gait of each trial."""


def write_analysis(path, best):
    """An analysis in which every gait changes alike, and keeps half of the draws."""
    walk = {"frequencies_hz": {"T1-T2": 0.8, "T2-T3": None}}
    settings = ((TIGHT, 0.25), (MUJOCO, -3.0), ("reset integrator", 0.0), ("Coulomb", -2.0))
    quantiles = {"5 %": 1.0 * INCH, "50 %": 2.0 * INCH, "95 %": 3.0 * INCH}
    content = {
        "schema": 3,
        "versions": {},
        "best_gaits": [
            {"trial": trial, "evaluation": index} | walk for trial, (index, _) in best.items()
        ],
        "resimulations": [
            {"trial": trial, "setting": name, "failure": None}
            | {"distance_in": distance + change * (1 + trial * 0.5)}
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


WALK = {"cost_of_transport": 4.0, "tension": 2.0 * POUND_FORCE, "clearance": 0.5 * INCH}
"""Of the gait that walks 20 in."""


@pytest.fixture
def folder(tmp_path):
    for name, iterations in TRIALS.items():
        metrics = {40.0: WALK | {"lifted_shares": [0.25, 0.5, 1.0]}}
        scenario = tiny_scenario(name=name)
        run = write_run(tmp_path / name, iterations, scenario=scenario, metrics=metrics)
        write_analysis(run / ANALYSIS, BEST[name])
    return tmp_path


def cells(name, folder):
    """The cells of a table by the first cell of their row."""
    runs = tables.load_all(folder)
    own = name in tables.RUN_TABLES
    table = tables.RUN_TABLES[name](runs["thesis"]) if own else tables.TABLES[name](runs)
    lines = [line for line in table.splitlines() if line.startswith("|")]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    assert len({len(row) for row in rows}) == 1
    return {row[0]: row[1:] for row in rows}


def test_the_comparison_shows_each_run_beside_the_thesis(folder):
    rows = cells("comparison", folder)
    for row, expected in {
        tables.COMPARISON[3][0]: ["about 6.6 (one)", *["4.00 (4.00)"] * 3],
        "initial gaits that go backward": ["nearly half", "50 % of 4", "50 % of 2", "50 % of 2"],
        "best evolved distance, in": ["14.34", "20.00", "6.00", "4.00"],
        "the same gait on the Drake diagram, tight settings, in": ["–", "20.25", "6.25", "4.25"],
        "mean fitness, best trial, in": ["–", "2.00 → 24.00", "2.00 → 10.00", "2.00 → 2.00"],
        "rise of the best distance, average trial": ["32 %", "212 %", "50 %", "0 %"],
        "frequency of a single oscillator, τ_A = 0.3 s, Hz": ["about 0.7", *["0.53"] * 3],
        "frequency of each signal, best gait, Hz": ["no number", *["0.80, -"] * 3],
        "seconds per iteration": ["22", "1", "1", "1"],
    }.items():
        assert rows[row] == expected
    off_ground = next(cells for row, cells in rows.items() if row.startswith("time off the ground"))
    assert off_ground == ["no number", "25, 50, 100", "-", "-"]


def test_the_summary_shows_the_experiment_under_both_laws_of_friction(folder):
    rows = cells("summary", folder)
    assert rows["best evolved gait"][:2] == ["14.34", "20.00"]
    assert rows["the same gait on the Drake diagram"][1:] == [
        f"{tables.load_all(folder)[name].again(0, tables.TIGHT):.2f}"
        for name in ("thesis", "coulomb")
    ]


def test_a_runs_trials_are_shown_on_all_engines_and_disturbed(folder):
    rows = cells("trials", folder)
    kept = ["4.00", "50 % (40 to 61)"]
    assert rows["0"] == ["5", "40.00", "20.00", "20.25", "17.00", *kept, "4.00", "2.00", "0.50"]
    assert rows["1"][:5] == ["5", "10.00", "5.00", "5.38", "0.50"]
    assert cells("changes", folder)["spacing"] == ["0.60 (-1.00, 2 failed)", "+0.25 (0.25)"]
    assert cells("changes", folder)["start"] == ["0.60 (-1.00)", "-"]


def test_trials_in_which_the_engines_differ_are_named(folder):
    runs = tables.load_all(folder)
    assert tables.trials_table(runs["thesis"]).endswith("in trial 1.")
    assert tables.trials_table(runs["coulomb"]).endswith("|")


def test_the_gallery_shows_the_best_gait_of_each_run(folder):
    rows = [
        line.split("|")[2:6] for line in tables.gallery_table(tables.load_all(folder)).split("\n")
    ]
    assert [row[0].split("`")[1] for row in rows[2:]] == list(TRIALS)
    assert [cell.strip() for cell in rows[2][1:]] == ["20.00", "20.25", "50 %"]


def test_the_effort_of_each_run_is_shown(folder):
    (folder / tables.TIMES).write_text(json.dumps({"thesis": 60, "coulomb": 3600}))
    rows = cells("effort", folder)
    assert rows["`thesis`"] == ["SteadyState", "2", "10", "2", "0:01:00"]
    assert rows["`coulomb`"][-1] == "1:00:00"


def test_either_laws_gaits_are_shown_under_the_other(folder):
    rows = cells("laws", folder)
    assert rows["`thesis`: median share"] == ["100 %", "65 %", "48 %"]
    assert rows["`thesis`: least to most"][0] == "5.00 to 20.00"
    assert rows["`coulomb`: median share"] == ["120 %", "100 %", "90 %"]


def test_the_engines_agree_as_far_as_the_gaits_evaluated_on_both_do(folder):
    drake = trial_folder(folder / "thesis-drake", 0) / "evaluations.jsonl"
    *_, best, _ = read_lines(trial_folder(folder / "thesis", 0) / "evaluations.jsonl")
    first, second, failed = read_lines(drake)
    for entry, off in ((first, 0.05), (second, -0.15), (best, 1.0)):
        entry["metrics"]["distance"] += off * INCH
    drake.write_text("".join(json.dumps(entry) + "\n" for entry in (first, second, failed)))
    again = trial_folder(folder / "thesis", 0) / REEVALUATIONS
    again.write_text(json.dumps(best) + "\n")
    rows = cells("engines", folder)
    initial = rows["initial gaits of `thesis` and `thesis-drake`"]
    assert initial == ["2", "0.100", "0.14", "50 %"]
    assert rows["`thesis`, best gaits"][:2] == ["1", "1.000"]


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
