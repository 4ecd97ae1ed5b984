"""What is printed of one simulation."""

import dataclasses
import math
import re

from helpers.synthetic_run import tiny_scenario, write_run

from tetra_drake.evolution.run import load_run
from tetra_drake.report.summary import result_text, results
from tetra_drake.settings.units import INCH


def numbers(text):
    """By metric, the numbers in a text; metrics in their order."""
    cells = [re.split(r" {2,}", line) for line in text.splitlines()]
    return {name: value for name, value, *_ in (line for line in cells if len(line) > 1)}


def test_metrics_have_rows_in_the_units_of_people_and_unmet_requirements_lines(tiny, result):
    # Zero or missing ones have none, unless the scenario is about them.
    nothing = dict.fromkeys(("distance", "twist", "lead", "lifted", "clearance"), 0.0)
    changes = nothing | {"tension": math.nan, "heading_change": math.pi, "speed": INCH}
    metrics = dataclasses.replace(result.metrics, **changes)
    result = dataclasses.replace(result, metrics=metrics, fitness=1.5)
    require = {"require": {"clearance": "0 in", "speed": "4000 in/s", "twist": "4000 in"}}
    text = result_text(dataclasses.replace(result, scenario=tiny.with_changes(require)))
    (line,) = (line for line in text.splitlines() if "requirement not met" in line)
    assert line.split()[0] == "speed" and "4000 in/s" in line
    shown = numbers(text)
    expected = {"speed (in/s)": "1.00", "fitness": "1.50", "heading change (deg)": "180"}
    expected |= {"distance (in)": "0", "twist (in)": "0", "clearance (in)": "0"}
    assert shown | expected == shown
    assert next(iter(shown)) == "distance (in)"
    assert not shown.keys() & {"lead (in)", "lifted (%)", "tension (lbf)"}
    turning = tiny.with_changes({"objective": {"heading_change": "1 /rad"}})
    shown = numbers(result_text(dataclasses.replace(result, scenario=turning)))
    assert next(iter(shown)) == "heading change (deg)"


def test_a_run_is_summed_up_by_the_metric_of_its_objective(tmp_path):
    # By trials, in inches: from 2 to 3, from 5 to 6, from 5.5 to 4; the fittest walks 6 in.
    trials = [[[(a, 0)], [(b, 0)]] for a, b in ((4.0, 6.0), (10.0, 12.0), (11.0, 8.0))]
    trials[1][1].append((None, 1))
    walked = dict(results(load_run(write_run(tmp_path / "far", trials))))
    assert walked["distance"].startswith("6.00 in, trial 1, evaluation 1")
    assert walked["best initial gait"].startswith("5.50 in, trial 2, evaluation 0")
    of_trials = re.findall(r"([\d.]+) in", walked["best of each trial"])
    assert of_trials == ["5.50", "4.25", "5.75"]
    assert walked["evaluations"].startswith("7 ") and "1" in walked["evaluations"]

    turning = tiny_scenario().with_changes({"objective": {"heading_change": "1 /rad"}})
    angles = {fitness: {"heading_change": math.radians(fitness)} for fitness in (4.0, 6.0)}
    run = write_run(tmp_path / "turn", trials[:1], scenario=turning, metrics=angles)
    turned = dict(results(load_run(run)))
    assert turned["heading change"].startswith("6.00 deg")
    assert "distance" not in turned and "best of each trial" not in turned
