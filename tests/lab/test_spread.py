"""Ranges of a gait's metrics for moved starts, and where they are shown."""

import dataclasses
import re

from helpers.synthetic_run import tiny_scenario, write_run

import tetra_drake as td
from tetra_drake.evolution.entries import SPREADS
from tetra_drake.evolution.run import load_run
from tetra_drake.lab.spread import record_spread
from tetra_drake.report.result_folder import save_result_folder
from tetra_drake.report.summary import result_text


def test_a_spread_repeats_and_holds_the_unmoved_start_and_grows_with_chaos(scenario):
    short = scenario.with_changes({"engine": "!Compiled", "simulation.duration": "4 s"})
    gait = td.seeded_gait(short, 80)
    ranges = td.spread(short, gait)
    assert ranges == td.spread(short, gait, workers=1) != td.spread(short, gait, seed=1)
    low, high = ranges["distance"]
    assert low <= td.simulate(short, gait).metrics.distance <= high
    # The law of the thesis enlarges 100 nm, friction without steps hardly does.
    smooth = td.spread(short.with_changes({"friction": "!Coulomb"}), gait)["distance"]
    assert 1e-9 < smooth[1] - smooth[0] < 1e-5 and high - low > 2.0 * (smooth[1] - smooth[0])


def test_a_run_and_a_result_keep_their_ranges_and_show_them(tmp_path):
    tiny = tiny_scenario().with_changes({"engine": "!Compiled"})
    folder = write_run(tmp_path / "run", [[[(1.0, 0)], [(2.0, 0)]]], scenario=tiny)
    record_spread(folder)
    record_spread(folder)  # it is there
    assert len((folder / SPREADS).read_text().splitlines()) == 1
    run = load_run(folder)
    assert run.spread_of(run.fittest()) == td.spread(tiny, run.best_gait())
    assert run.spread_of(run.initial_best(0)) == {}
    slow = write_run(tmp_path / "slow", [[[(1.0, 0)]]])  # on the diagram, after one gait
    record_spread(slow)
    assert not (slow / SPREADS).exists()

    result = td.simulate(tiny, run.best_gait(), record=True)
    wide = dataclasses.replace(result, spread={"distance": [-1.0, 1.0]})
    save_result_folder(tmp_path / "out", wide)
    loaded = td.load_result(tmp_path / "out")
    assert loaded.spread == wide.spread and "(-39 to 39" in loaded.title
    assert re.search(r"distance \(in\) .* \(-39 to 39\)", result_text(loaded))
    assert "brackets" not in result_text(result)
