"""`tetra-drake figures` on runs, finished or not, and on result folders."""

from __future__ import annotations

from pathlib import Path

import pytest
from helpers.synthetic_run import Child, write_run
from matplotlib.figure import Figure

from tetra_drake.errors import InputError
from tetra_drake.report.run_page import write_figures

OF_ONE_GAIT = {
    "time_lapse",
    "relative_distances",
    "one_step",
    "signals_and_tensions",
    "ground_forces",
}
OF_A_RUN = OF_ONE_GAIT | {
    "fitness_of_trials",
    "initial_distances",
    "initial_fitness",
    "before_and_after",
}


@pytest.fixture(autouse=True)
def quick_drawing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures are drawn, but only their names are written."""

    def save(figure: Figure, folder: Path, name: str) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / f"{name}.svg").write_text("<svg/>")

    monkeypatch.setattr("tetra_drake.figures.book.save_figure", save)


def contents(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def figures_in(folder: Path) -> set[str]:
    return {path.stem for path in folder.glob("*.svg")}


def test_a_run_gets_figures_report_and_replay(run: Path) -> None:
    before = contents(run)
    written = write_figures(run)
    assert written == [run / "figures", run / "replay.html", run / "report.html"]
    after = contents(run)
    assert {name: after[name] for name in before} == before
    assert {"report.html", "replay.html", "figures/two_best.csv"} <= after.keys()
    assert figures_in(run / "figures") == OF_A_RUN


def test_elsewhere_there_are_figures_only_and_the_run_stays_as_it_is(
    run: Path, tmp_path: Path
) -> None:
    before, out = contents(run), tmp_path / "new" / "folder"
    assert write_figures(run, out) == [out]
    assert contents(run) == before
    assert figures_in(out) == OF_A_RUN


def test_a_simulation_gets_the_figures_of_one_gait(folder: Path) -> None:
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
def test_an_unfinished_run_is_drawn_as_far_as_it_has_come(
    tmp_path: Path, trials: list[list[list[Child]]], missing: set[str]
) -> None:
    run = write_run(tmp_path / "run", trials, unfinished=range(len(trials)))
    (run / "trial_00" / "in_progress.jsonl").write_text('{"index": 1, "torn')
    write_figures(run)
    assert figures_in(run / "figures") == OF_A_RUN - missing
    assert not (run / "figures" / "two_best.csv").exists()


def break_line(run: Path) -> Path:
    path = run / "trial_00" / "evaluations.jsonl"
    lines = path.read_text().splitlines()
    path.write_text("\n".join([lines[0], "{nonsense", *lines[2:]]) + "\n")
    return path


def break_manifest(run: Path) -> Path:
    (run / "manifest.json").write_text('{"schema": 1')
    return run / "manifest.json"


def change_scenario(run: Path) -> Path:
    path = run / "scenario.yaml"
    path.write_text(path.read_text().replace("population: 50", "population: 51"))
    return path


def remove_trials(run: Path) -> Path:
    for path in run.glob("trial_*/*"):
        path.unlink()
    return run


@pytest.mark.parametrize("spoil", [break_line, break_manifest, change_scenario, remove_trials])
@pytest.mark.parametrize("out", [None, "elsewhere"])
def test_a_damaged_or_empty_run_is_refused(
    run: Path, tmp_path: Path, spoil: object, out: str | None
) -> None:
    source = spoil(run)  # type: ignore[operator]
    before = contents(tmp_path)
    with pytest.raises(InputError) as caught:
        write_figures(run, tmp_path / out if out else None)
    assert caught.value.source == str(source)
    assert contents(tmp_path) == before


def test_other_sources_and_outs_are_refused_before_anything_is_simulated(
    run: Path, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tetra_drake.figures.study.simulate", None)
    (tmp_path / "empty").mkdir()
    (tmp_path / "file").touch()
    (folder / "trajectory.nc").unlink()
    for source in (tmp_path / "missing", tmp_path / "empty", tmp_path / "file", folder):
        with pytest.raises(InputError) as caught:
            write_figures(source)
        assert caught.value.source == str(source)
    for out in (tmp_path / "file", tmp_path / "file" / "folder"):
        with pytest.raises(InputError) as caught:
            write_figures(run, out)
        assert caught.value.source == str(out)
    assert not list((tmp_path / "empty").iterdir())
