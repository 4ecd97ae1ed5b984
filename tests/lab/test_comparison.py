"""Runs side by side: how much they pay for what they find."""

import json
import math

import pandas
import pytest
from helpers.synthetic_run import PER_DISTANCE, tiny_scenario, write_run

from tetra_drake.cli import main
from tetra_drake.lab.comparison import (
    compare,
    compare_scenarios,
    comparison_text,
    improvement_over,
)
from tetra_drake.scenario.experiment_sections import Disturbances
from tetra_drake.settings.units import INCH


def trial(*fitnesses):
    """One evaluation per iteration."""
    return [[(fitness, 0)] for fitness in fitnesses]


@pytest.fixture
def run(tmp_path):
    """run(name, trial, ...): the directory of a recorded run, on a scenario with `changes`."""

    def run(name, *trials, changes=None, unfinished=()):
        scenario = tiny_scenario().with_changes(changes or {})
        return write_run(tmp_path / name, trials, scenario=scenario, unfinished=unfinished)

    return run


def curve(compared, label):
    rows = compared.curves[compared.curves["run"] == label]
    assert (rows["low"] <= rows["mean"]).all() and (rows["mean"] <= rows["high"]).all()
    return rows[["cost", "mean"]].to_numpy().tolist()


def test_the_best_so_far_over_trials_that_fail_and_end_at_different_times(run):
    path = run("a", trial(None, 4.0, 2.0, 8.0), trial(1.0, None), trial(2.0, 6.0, 7.0))
    found = compare([path])
    # Best so far: -, 4, 4, 8; 1, 1 and so on; 2, 6, 7 and so on.
    expected = [[1, -math.inf], [2, 11.0 / 3.0], [3, 4.0], [4, 16.0 / 3.0]]
    assert curve(found, "a") == expected
    # At the end, the figure and the text show the same numbers.
    last = found.curves.iloc[-1][["mean", "low", "high"]].tolist()
    row = found.runs.loc["a"]
    assert last == pytest.approx(row[["fitness_mean", "fitness_low", "fitness_high"]].tolist())
    assert found.trials["fitness"].tolist() == [8.0, 1.0, 7.0]
    assert found.trials["cost"].tolist() == [4, 2, 3]
    assert (row["trials"], row["going_on"], row["cost"], row["wall_time"]) == (3, 0, 3.0, 0.5)
    assert (row["fitness"], row["fitness_mean"]) == pytest.approx((7.0, 16.0 / 3.0))
    assert row["distance"] == pytest.approx(7.0 / PER_DISTANCE * INCH)


def test_the_probability_of_improvement_counts_pairs_of_trials(run):
    """Of the pairs (3, 1), (3, 3), (2, 1), (2, 3), two are won, one is even, one is lost."""
    paths = [run("a", trial(3.0), trial(2.0)), run("b", trial(1.0), trial(3.0))]
    found = compare(paths, labels=["ours", "theirs"])
    assert list(found.runs.index) == ["ours", "theirs"]
    ours, theirs = found.improvement.loc["ours", "theirs"], found.improvement.loc["theirs", "ours"]
    assert (ours["probability"], theirs["probability"]) == (0.625, 0.375)
    # Drawn anew, theirs are (1, 1) in a quarter of the cases; (2, 2) meets (3, 3) in a sixteenth.
    assert (ours["low"], ours["high"], theirs["low"], theirs["high"]) == (0.0, 1.0, 0.0, 1.0)
    assert "0.62 (0.00 to 1.00)" in comparison_text(found)


def ends(**fitnesses):
    """Table of trials, by run."""
    rows = [(run, fitness) for run, numbers in fitnesses.items() for fitness in numbers]
    return pandas.DataFrame(rows, columns=["run", "fitness"])


def test_the_interval_of_a_mean_over_scenarios_draws_within_each():
    """Trials of one scenario never meet those of another: 1 and 2 exceed 0, 11 and 12 exceed 10."""
    low, high = ends(a=[1.0, 2.0], b=[0.0, -math.inf]), ends(a=[11.0, 12.0], b=[10.0, 10.0])
    found = improvement_over([low, high])
    assert found.loc["a", "b"].tolist() == [1.0, 1.0, 1.0]
    assert found.loc["b", "a"].tolist() == [0.0, 0.0, 0.0]
    single = improvement_over([ends(a=[1.0, 2.0], c=[0.0])]).loc["a", "c"]
    assert single["probability"] == 1.0 and single[["low", "high"]].isna().all()
    # A scenario with equal trials halves the width: from 0..1 to 1/4..3/4.
    even, wide = ends(a=[1.0, 1.0], b=[1.0, 1.0]), ends(a=[0.0, 2.0], b=[1.0, 1.0])
    assert improvement_over([wide]).loc["a", "b"].tolist() == [0.5, 0.0, 1.0]
    assert improvement_over([wide, even]).loc["a", "b"].tolist() == [0.5, 0.25, 0.75]


def test_runs_are_compared_within_their_scenarios(run, refused):
    other = {"name": "other", "objective": {"speed": "2 s/in"}}
    paths = [run("a", trial(3.0)), run("b", trial(1.0))]
    paths += [run("c", trial(1.0), changes=other), run("d", trial(1.0), changes=other)]
    found = compare_scenarios(paths, labels=["x", "y", "x", "y"])
    shares = [c.improvement.loc[("x", "y"), "probability"] for c in found.values()]
    assert len(found) == 2 and shares == [1.0, 0.5]
    assert improvement_over(c.trials for c in found.values()).loc[("x", "y"), "probability"] == 0.75
    with refused("compare", "scenarios", "tiny, other", "two of one scenario"):
        compare_scenarios(paths[1:3])


def test_the_curve_of_a_run_that_goes_on_ends_with_its_first_trial(run):
    trials = [trial(1.0, 2.0, 5.0), trial(3.0), trial(2.0, 4.0)]
    found = compare([run("a", *trials, unfinished=(0, 2))])
    assert curve(found, "a") == [[1, 2.0], [2, 3.0]]
    assert found.runs.loc["a", "going_on"] == 2
    assert any("2 of 3" in note for note in found.notes)


def test_runs_are_compared_where_the_shortest_ends_and_in_their_ends(run):
    long = run("long", trial(1.0, 2.0, 3.0, 9.0), trial(0.0, 4.0, 5.0, 7.0))
    found = compare([long, run("short", trial(3.0, 2.0), trial(5.0))])
    assert found.common == 2
    assert found.runs.loc["long", ["at_common", "fitness"]].tolist() == [3.0, 8.0]
    assert found.runs.loc["short", ["at_common", "fitness"]].tolist() == [4.0, 4.0]
    # Of two trials drawn anew, both are the same in half of the cases.
    assert found.runs.loc["long", ["fitness_low", "fitness_high"]].tolist() == [7.0, 9.0]


def test_a_distance_is_reached_when_the_fittest_gait_walks_it(run):
    # In inches: 1, 2, 3; 2.5; 0, 0, 0.5, 2; never 2 or more; only failures.
    trials = [trial(2.0, 4.0, 6.0), trial(5.0), trial(None, 0.0, 1.0, 4.0)]
    trials += [trial(3.0, 3.5), trial(None, None)]
    found = compare([run("a", *trials)], reach=2.0 * INCH)
    assert found.trials["reached"].tolist() == [2.0, 1.0, 4.0, math.inf, math.inf]
    row = found.runs.loc["a"]
    assert row[["reached_low", "reached", "reached_high"]].tolist() == [2.0, 4.0, math.inf]
    assert (row["trials"], row["share"]) == (5, 0.6)
    # Means are over those with a fitness: 6, 5, 4 and 3.5 without the greatest and the least.
    assert (row["fitness_mean"], row["fitness"]) == (4.5, 4.5)
    assert any("1 of 5" in note for note in found.notes)
    assert "4 (2 to never)" in comparison_text(found)


def test_costs_are_simulations_of_which_an_evaluation_has_one_in_each_draw(run):
    disturbed = {"disturbances": Disturbances(draws=3, start=0.1)}
    paths = [run("calm", trial(1.0, 2.0)), run("rough", trial(3.0, 4.0), changes=disturbed)]
    found = compare(paths, reach=2.0 * INCH)
    assert found.common == 2
    assert [cost for cost, *_ in curve(found, "rough")] == [3, 6]
    assert found.trials["reached"].tolist() == [math.inf, 6.0]
    assert math.isnan(found.runs.loc["rough", "at_common"])  # no gait is done
    assert any("disturbances.draws" in note for note in found.notes)


def test_only_search_may_differ_without_a_note(run):
    base = run("a", trial(1.0))
    searches = run("b", trial(1.0), trial(2.0), changes={"evolution.evaluations": 99})
    assert compare([base, searches]).notes == []
    (note,) = compare([base, run("c", trial(1.0), changes={"robot.cables.slack": True})]).notes
    assert "robot.cables.slack" in note


def test_different_objectives_and_runs_given_twice_are_refused(run, refused):
    base = run("a", trial(1.0))
    other = run("b", trial(1.0), changes={"objective": {"speed": "1 s/m"}})
    with refused(other, "objective", "a"):
        compare([base, other])
    with refused(base, "", "twice"):
        compare([base, base])
    failed = run("d", trial(None))
    with refused(failed, "", "fitness"):
        compare([failed])


def test_the_command_has_a_distance_to_reach_and_writes_what_it_found(run, tmp_path):
    paths, out = [run("a", trial(1.0, 30.0)), run("b", trial(2.0))], tmp_path / "out"
    assert main(["compare", *map(str, paths), "--reach", "14.34 in", "--out", str(out)]) == 0
    summary = json.loads((out / "summary.json").read_text())
    assert [row["reached"] for row in summary["runs"]] == [2.0, None]
    assert pandas.read_csv(out / "trials.csv")["fitness"].tolist() == [30.0, 2.0]
