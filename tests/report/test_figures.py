"""`tetra-drake figures` on runs, finished or not, and on result folders."""

import pytest
from helpers.synthetic_run import write_run

from tetra_drake.errors import InputError
from tetra_drake.report.run_page import write_figures

ONE_GAIT = "time_lapse relative_distances one_step signals_and_tensions ground_forces"
OF_ONE_GAIT = set(ONE_GAIT.split())
OF_A_RUN = OF_ONE_GAIT | {"fitness_of_trials", "initial_distances", "initial_fitness"}
OF_A_RUN |= {"before_and_after"}


@pytest.fixture(autouse=True)
def quick_drawing(monkeypatch):
    """Figures are drawn, but only their names are written."""

    def save(figure, folder, name):
        folder.mkdir(parents=True, exist_ok=True)
        (folder / f"{name}.svg").write_text("<svg/>")

    monkeypatch.setattr("tetra_drake.figures.book.save_figure", save)


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
    assert {"report.html", "replay.html", "figures/two_best.csv"} <= after.keys()
    assert figures_in(run / "figures") == OF_A_RUN


def test_a_simulation_gets_the_figures_of_one_gait(folder):
    assert write_figures(folder) == [folder / "figures"]
    assert figures_in(folder / "figures") == OF_ONE_GAIT


@pytest.mark.parametrize(
    ("trials", "missing"),
    [
        ([[[(1.0, 0)]], [], [[(None, 0)]]], set()),
        ([[[(None, 0)], [(1.0, 0), (None, None)]]], {"initial_fitness", "initial_distances"}),
    ],
    ids=["at work", "no initial gait has a fitness"],
)
def test_an_unfinished_run_is_drawn_as_far_as_it_has_come(tmp_path, trials, missing):
    run = write_run(tmp_path / "run", trials, unfinished=range(len(trials)))
    (run / "trial_00" / "in_progress.jsonl").write_text('{"index": 1, "torn')
    write_figures(run)
    assert figures_in(run / "figures") == OF_A_RUN - missing
    assert not (run / "figures" / "two_best.csv").exists()


@pytest.mark.parametrize("elsewhere", [False, True])
@pytest.mark.parametrize("files", ["manifest.json", "trial_*/*"], ids=["damaged", "empty"])
def test_a_damaged_or_empty_run_is_refused(run, tmp_path, files, elsewhere):
    for path in run.glob(files):
        path.write_text('{"schema": 1')
        if files == "trial_*/*":
            path.unlink()
    before = contents(tmp_path)
    with pytest.raises(InputError) as caught:
        write_figures(run, tmp_path / "elsewhere" if elsewhere else None)
    assert caught.value.source in (str(run), str(run / "manifest.json"))
    assert contents(tmp_path) == before


def test_other_sources_and_outs_are_refused_before_anything_is_simulated(
    run, tmp_path, monkeypatch, refused
):
    monkeypatch.setattr("tetra_drake.figures.study.simulate", None)
    (tmp_path / "empty").mkdir()
    (tmp_path / "file").touch()
    for source in (tmp_path / "missing", tmp_path / "empty", tmp_path / "file"):
        with refused(source, "", ""):
            write_figures(source)
    for out in (tmp_path / "file", tmp_path / "file" / "folder"):
        with refused(out, "", ""):
            write_figures(run, out)
    assert not list((tmp_path / "empty").iterdir())
