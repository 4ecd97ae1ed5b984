"""The experiment's tables, of runs of which everything is known."""

import json

import pytest

from tetra_drake.evolution.json_lines import read_lines
from tetra_drake.evolution.record import REEVALUATIONS, trial_folder
from tetra_drake.experiment.analysis import ANALYSIS
from tetra_drake.experiment.recorded import load_experiment
from tetra_drake.experiment.tables import TABLES


def table(name, runs):
    """The cells of a table by the first cell of their row."""
    lines = TABLES[name](load_experiment(runs)).splitlines()
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    assert len({len(row) for row in rows}) == 1
    return {row[0]: row[1:] for row in rows}


def row(cells, start):
    (found,) = [values for name, values in cells.items() if name.startswith(start)]
    return found


def test_the_comparison_sets_each_run_beside_the_thesis(runs):
    cells = table("comparison", runs)
    assert row(cells, "best initial distance")[:3] == ["about 6.6", "4.00", "4.00"]
    assert row(cells, "initial gaits that go backward")[:3] == [
        "nearly half",
        "50 % of 4",
        "50 % of 2",
    ]
    assert row(cells, "best evolved distance")[:3] == ["14.34", "20.00", "6.00"]
    assert row(cells, "the same gait on the Drake diagram")[:3] == ["–", "20.00", "6.00"]
    assert row(cells, "mean fitness, best trial")[1:3] == ["2.00 → 24.00", "2.00 → 10.00"]
    assert row(cells, "mean fitness, average trial")[1:3] == ["2.00 → 14.50", "2.00 → 10.00"]
    assert row(cells, "rise of the best distance, average")[:3] == ["32 %", "212 %", "50 %"]
    assert row(cells, "rise of the best distance, trial")[:3] == ["51 %", "400 %", "50 %"]
    assert row(cells, "time off the ground of T1, T2, T3")[1:3] == ["25, 50, 0"] * 2
    assert row(cells, "frequency of a single")[:3] == ["about 0.7", "0.53", "0.53"]
    assert row(cells, "frequency of each signal")[1:3] == ["0.80, -"] * 2
    assert row(cells, "seconds per iteration")[:3] == ["22", "1", "1"]
    assert row(cells, "difference of the two best genomes: fitness")[:3] == [
        "0.0006",
        "32.0000",
        "4.0000",
    ]


def test_the_comparison_says_where_a_run_is_worse_than_the_thesis(runs):
    cells = table("comparison", runs)
    assert row(cells, "best evolved distance")[-1] == (
        "Farther in `thesis` (39 %); less far, which is worse, in `thesis-listing` (58 %)."
    )
    assert row(cells, "rise of the best distance, trial")[-1].startswith(
        "Larger in `thesis`; smaller, which is worse, in `thesis-listing`."
    )
    assert row(cells, "seconds per iteration")[-1].startswith(
        "Median, of two simulations; "
        "22 times faster in `thesis` and 22 times faster in `thesis-listing`"
    )
    assert row(cells, "initial gaits that go backward")[-1] == (
        "Not within 40 to 50 %: `thesis` and `thesis-listing`."
    )


def test_the_comparison_says_which_trials_have_not_ended(runs):
    assert row(table("comparison", runs), "trials") == ["10", "2", "0 of 1 ended", ""]


def test_the_runs_table_gives_the_command_that_makes_a_run_again(runs):
    cells = table("runs", runs)
    assert cells["makes it again"][0] == (
        "`tetra-drake evolve --scenario runs/thesis/scenario.yaml --seed 7 --out again`"
    )
    assert cells["mutation of the time constants"] == ["intended", "listing"]
    assert (cells["evaluations"], cells["of which failed"]) == (["10", "5"], ["2", "2"])


def test_the_best_gaits_are_listed_by_run_and_trial(runs):
    cells = table("best-gaits", runs)
    assert list(cells)[2:] == [
        "`thesis`, trial 0",
        "`thesis`, trial 1",
        "`thesis-listing`, trial 0",
    ]
    distance, _, hertz, *lifted = cells["`thesis`, trial 1"]
    assert (distance, hertz, lifted) == ("5.00", "0.80", ["25", "50", "0"])


def test_resimulations_stand_beside_what_is_recorded(runs):
    cells = table("resimulation", runs)
    assert next(iter(cells.values())) == ["as recorded", "default", "finer", "coarser"]
    assert cells["`thesis`, trial 1"] == ["5.00", "5.00", "5.01", "4.50"]
    assert cells["*`thesis`: median difference*"] == ["0.00", "", "0.01", "0.50"]


def test_robustness_is_the_median_change_and_its_range(runs):
    cells = table("robustness", runs)
    assert next(iter(cells.values())) == ["`thesis`, ± 2 %", "`thesis`, ± 5 %"]
    assert cells["initial spacing"] == ["0.60 (-1.00 to +0.20)", "-"]
    assert cells["friction"] == ["-", "-, 2 failed"]


def test_robustness_is_told_of_each_gait(runs):
    cells = table("robust-gaits", runs)
    assert next(iter(cells.values()))[1:3] == ["± 2 %: change, in", "± 2 %: loses over 10 %"]
    assert cells["`thesis`, trial 0"][:3] == ["20.00", "0.60 (-1.00 to +0.20)", "0 %"]
    assert cells["`thesis`, trial 1"][:3] == ["5.00", "0.60 (-1.00 to +0.20)", "50 %"]
    assert cells["`thesis`, trial 0"][3:] == ["-, 1 failed", "100 %"]


def test_the_two_mutations_stand_side_by_side(runs):
    cells = table("tau-mutation", runs)
    assert cells["0"][0::4] == ["20.00", "6.00"]
    assert cells["0"][3::4] == ["1", "1, goes on"]
    assert cells["1"][4:] == ["-"] * 4
    assert cells["**mean**"][0::4] == ["12.50", "6.00"]
    assert all(0.2 <= float(tau) <= 0.5 for tau in cells["0"][1:3])


def test_the_engines_agree_as_the_reevaluations_say(runs):
    folder = trial_folder(runs / "thesis", 0)
    first, second, failed, best, _ = read_lines(folder / "evaluations.jsonl")
    for entry, off in ((first, 0.05), (second, -0.15), (best, 1.0)):
        entry["metrics"]["distance_in"] += off
    entries = [first, second, failed, best]
    (folder / REEVALUATIONS).write_text("".join(json.dumps(e) + "\n" for e in entries))
    cells = table("engines", runs)
    assert cells["`thesis`, initial gaits"] == ["2", "1", "0.100", "0.14", "50 %", "100.0 %"]
    assert cells["`thesis`, best gaits"][:3] == ["1", "0", "1.000"]


@pytest.mark.parametrize("name", TABLES)
def test_a_table_is_the_same_again(runs, name):
    tables = [TABLES[name](load_experiment(runs)) for _ in range(2)]
    assert tables[0] == tables[1]
    assert "nan" not in tables[0]


def test_there_is_no_agreement_of_gaits_that_were_evaluated_once_only(runs):
    assert TABLES["engines"](load_experiment(runs)) == "No gait was evaluated on both engines."


def test_an_analysis_of_other_gaits_is_refused(runs, refused):
    path = runs / "thesis" / ANALYSIS
    content = json.loads(path.read_text())
    content["best_gaits"][1]["evaluation"] = 0
    path.write_text(json.dumps(content))
    with refused(path, "best_gaits", "tetra-drake analyse"):
        load_experiment(runs)


def test_a_folder_without_runs_of_the_experiment_is_refused(tmp_path, refused):
    with refused(tmp_path, "", "expected thesis, thesis-listing, thesis-drake"):
        load_experiment(tmp_path)
