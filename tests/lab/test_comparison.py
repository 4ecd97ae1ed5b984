"""Runs side by side: how much they pay for what they find."""

import json
from pathlib import Path

import pandas
import pytest
import yaml
from helpers.synthetic_run import tiny_scenario, write_run
from pytest import approx

from tetra_drake.cli import main
from tetra_drake.lab.comparison import (
    compare,
    compare_scenarios,
    comparison_text,
    improvement_over,
)
from tetra_drake.settings.units import INCH

CASES = yaml.safe_load(Path(__file__).with_name("comparison.yaml").read_text("utf-8"))


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


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_tables_are_as_by_hand(case, run):
    paths = [
        run(name, *(trial(*fitnesses) for fitnesses in given["trials"]), **given.get("options", {}))
        for name, given in case["runs"].items()
    ]
    found = compare(paths, reach=2.0 * INCH)
    for name, given in case["runs"].items():
        row = given["row"]
        assert found.runs.loc[name, [*row]].tolist() == approx([*row.values()], nan_ok=True)
        if "curve" in given:
            assert curve(found, name) == [approx(point) for point in given["curve"]]
    for column, values in case.get("trials", {}).items():
        assert found.trials[column].tolist() == approx(values)
    assert found.common == case.get("common", found.common)
    assert all(word in " ".join(found.notes) for word in case.get("notes", []))
    assert case.get("text", "") in comparison_text(found)


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
    low, high = ends(a=[1.0, 2.0], b=[0.0, float("-inf")]), ends(a=[11.0, 12.0], b=[10.0, 10.0])
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
