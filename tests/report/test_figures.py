"""`tetra-drake figures` on runs, finished or not, and on result folders."""

import pytest
from helpers.synthetic_run import tiny_scenario, write_run

from tetra_drake.report.run_page import write_figures
from tetra_drake.robot.gait_file import load_gait
from tetra_drake.scenario.optimizer_kinds import QualityDiversity

OF_ONE_GAIT = {"gait_diagram", "time_lapse", "path_of_the_centre", "relative_distances"}
OF_ONE_GAIT |= {"one_step", "signals_and_tensions", "ground_forces"}
OF_A_RUN = OF_ONE_GAIT | {"fitness_of_trials", "initial_distances", "initial_fitness"}
OF_A_RUN |= {"before_and_after"}


def contents(folder):
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def figures_in(folder):
    return {path.stem for path in folder.glob("*.svg")}


def test_a_run_gets_figures_report_and_replay_unless_they_go_elsewhere(run, tmp_path):
    before, out = contents(run), tmp_path / "new" / "folder"
    assert write_figures(run, out) == [out]
    assert contents(run) == before
    assert figures_in(out) == OF_A_RUN
    assert write_figures(run) == [run / "figures", run / "replay.html", run / "report.html"]
    after = contents(run)
    assert {name: after[name] for name in before} == before
    assert figures_in(run / "figures") == OF_A_RUN


def test_a_simulation_gets_the_figures_of_one_gait(folder):
    assert write_figures(folder) == [folder / "figures"]
    assert figures_in(folder / "figures") == OF_ONE_GAIT


UNFINISHED = [([[[(1.0, 0)]], [], [[(None, 0)]]], {"initial_distances"})]  # at work
# No initial gait has a fitness.
FAILED = {"initial_fitness", "initial_distances"}
UNFINISHED += [([[[(None, 0)], [(1.0, 0), (None, None)]]], FAILED)]


@pytest.mark.parametrize(("trials", "missing"), UNFINISHED)
def test_an_unfinished_run_is_drawn_as_far_as_it_has_come(tmp_path, trials, missing):
    run = write_run(tmp_path / "run", trials, unfinished=range(len(trials)))
    (run / "trial_00" / "in_progress.jsonl").write_text('{"index": 1, "torn')
    write_figures(run)
    assert figures_in(run / "figures") == OF_A_RUN - missing


def test_a_map_is_drawn_and_its_chosen_gaits_are_files_linked_from_the_report(tmp_path):
    scenario = tiny_scenario().with_changes({"optimizer": QualityDiversity(cells=[2, 2])})
    places = {4.0: (0.9, 0.55), 3.0: (0.1, 0.55), 2.0: (0.9, 0.45), 1.0: (0.9, 0.55)}
    metrics = {f: {"travelling_index": x, "lifted": y} for f, (x, y) in places.items()}
    trials = [[[(fitness, place) for place, fitness in enumerate(places)]]]
    run = write_run(tmp_path / "run", trials, scenario=scenario, metrics=metrics)
    write_figures(run)
    assert "map_of_gaits" in figures_in(run / "figures")
    # The fittest, which walks on replay.html already, is that of a corner; 3.0 is that of two.
    corners = [f"{end}_travelling_index_low_lifted" for end in ("low", "high")]
    files = {f"{name}.{kind}" for name in corners for kind in ("html", "json")}
    written = contents(run / "elites")
    assert written.keys() == files | {"fittest_of_the_map.json", "elites.csv"}
    page = (run / "report.html").read_text()
    assert all(f'href="elites/{name}"' in page for name in written)
    assert load_gait(run / "elites" / "fittest_of_the_map.json", scenario)
    assert len(written["elites.csv"].splitlines()) == 1 + 3
