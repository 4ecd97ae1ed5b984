"""`tetra-drake figures`, as a person meets it."""

import json
import os
from pathlib import Path

import pytest
from helpers.synthetic_run import tiny_scenario, write_run

from tetra_drake.cli import main
from tetra_drake.engines.simulate import simulate
from tetra_drake.results.folder import save_result_folder
from tetra_drake.robot.gait import seeded_gait

TRIALS = [[[(2.0, 0), (1.0, 1)], [(3.0, 1), (0.5, None)]]]
OF_ONE_GAIT = {f"{number:02d}" for number in (14, 15, 19, 20, 21)}
OF_A_RUN = OF_ONE_GAIT | {"16", "17", "18", "22", "23"}


@pytest.fixture
def quick_drawing(monkeypatch):
    """Figures are drawn, but only their names are written."""

    def save(figure, folder, name):
        Path(folder).mkdir(parents=True, exist_ok=True)
        (Path(folder) / f"{name}.svg").write_text("<svg/>")

    monkeypatch.setattr("tetra_drake.figures.book.save_figure", save)


@pytest.fixture
def run(tmp_path) -> Path:
    return write_run(tmp_path / "run", TRIALS)


def contents(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def figures_in(folder: Path) -> set[str]:
    return {path.name.split("_")[1] for path in folder.glob("figure_*.svg")}


def test_a_run_gets_its_figures_report_and_replay(run, quick_drawing, capsys):
    before = contents(run)
    assert main(["figures", str(run)]) == 0
    assert capsys.readouterr().out == f"wrote figures/, replay.html, report.html to {run}/\n"
    after = contents(run)
    assert {name: after[name] for name in before} == before
    assert {"report.html", "replay.html", "figures/table_08_two_best.csv"} <= after.keys()
    assert figures_in(run / "figures") == OF_A_RUN


def test_elsewhere_there_are_figures_only_and_the_run_stays_as_it_is(
    run, quick_drawing, tmp_path, capsys
):
    before = contents(run)
    out = tmp_path / "new" / "folder"
    assert main(["figures", str(run), "--out", str(out)]) == 0
    assert capsys.readouterr().out == f"wrote 10 figures to {out}/\n"
    assert contents(run) == before
    assert figures_in(out) == OF_A_RUN
    assert {path.name for path in out.iterdir() if path.suffix != ".svg"} == {
        "table_08_two_best.csv"
    }


def test_a_simulation_gets_the_figures_of_one_gait(quick_drawing, tmp_path, capsys):
    scenario = tiny_scenario()
    gait = seeded_gait(scenario)
    result = simulate(scenario=scenario, gait=gait, record=True)
    folder = tmp_path / "out"
    save_result_folder(folder, scenario=scenario, gait=gait, result=result)
    assert main(["figures", str(folder)]) == 0
    assert capsys.readouterr().out == f"wrote 5 figures to {folder}/figures/\n"
    assert figures_in(folder / "figures") == OF_ONE_GAIT


def test_a_run_that_is_at_work_is_drawn_as_far_as_it_has_come(quick_drawing, tmp_path):
    run = write_run(tmp_path / "run", [[[(1.0, 0)]], [], [[(None, 0)]]], unfinished=(0, 1, 2))
    (run / "trial_00" / "in_progress.jsonl").write_text('{"index": 1, "torn')
    assert main(["figures", str(run)]) == 0
    assert figures_in(run / "figures") == OF_A_RUN
    assert not (run / "figures" / "table_08_two_best.csv").exists()


def test_without_an_initial_gait_that_walks_there_is_nothing_to_say_of_it(quick_drawing, tmp_path):
    run = write_run(tmp_path / "run", [[[(None, 0), (None, 1)], [(1.0, 0), (None, None)]]])
    assert main(["figures", str(run)]) == 0
    assert figures_in(run / "figures") == OF_A_RUN - {"16", "17"}


def break_line(run: Path) -> None:
    path = run / "trial_00" / "evaluations.jsonl"
    lines = path.read_text().splitlines()
    path.write_text("\n".join([lines[0], "{nonsense", *lines[2:]]) + "\n")


def break_manifest(run: Path) -> None:
    (run / "manifest.json").write_text('{"schema": 1')


def change_scenario(run: Path) -> None:
    path = run / "scenario.yaml"
    path.write_text(path.read_text().replace("population: 50", "population: 51"))


def fail_everywhere(run: Path) -> None:
    for name in ("evaluations.jsonl", "iterations.jsonl"):
        path = run / "trial_00" / name
        entries = [json.loads(line) for line in path.read_text().splitlines()]
        for entry in entries:
            entry.update({k: None for k in entry if k.endswith(("fitness", "_in"))})
        path.write_text("".join(json.dumps(entry) + "\n" for entry in entries))


def remove_trials(run: Path) -> None:
    for path in (run / "trial_00").iterdir():
        path.unlink()


@pytest.mark.parametrize(
    ("spoil", "problem"),
    [
        (break_line, "evaluations.jsonl: line 2: is damaged"),
        (break_manifest, "manifest.json: cannot be read"),
        (change_scenario, "scenario.yaml: evolution.population: is not as in manifest.json"),
        (fail_everywhere, "no gait of this run has a fitness yet"),
        (remove_trials, "no gait of this run has a fitness yet"),
    ],
)
@pytest.mark.parametrize("out", [[], ["--out", "elsewhere"]], ids=["in place", "elsewhere"])
def test_a_damaged_or_empty_run_is_refused(run, spoil, problem, out, capsys, monkeypatch):
    monkeypatch.chdir(run.parent)
    spoil(run)
    before = contents(run.parent)
    assert_refused(["figures", "run", *out], capsys, problem)
    assert contents(run.parent) == before


@pytest.mark.parametrize("source", ["nowhere", "empty", "file"])
def test_what_is_neither_run_nor_simulation_is_refused(tmp_path, source, capsys):
    (tmp_path / "empty").mkdir()
    (tmp_path / "file").touch()
    path = tmp_path / source
    assert_refused(["figures", str(path)], capsys, f"{path}: holds neither manifest.json")
    assert not list((tmp_path / "empty").iterdir())


def test_a_simulation_without_its_trajectory_is_refused(tmp_path, capsys):
    (tmp_path / "result.json").write_text("{}")
    assert_refused(["figures", str(tmp_path)], capsys, "holds no scenario.yaml")
    assert os.listdir(tmp_path) == ["result.json"]


def test_an_out_that_is_a_file_is_refused_before_anything_is_simulated(
    run, tmp_path, capsys, monkeypatch
):
    monkeypatch.setattr("tetra_drake.evolution.study.simulate", None)
    (tmp_path / "file").touch()
    for out in ("file", "file/folder"):
        arguments = ["figures", str(run), "--out", str(tmp_path / out)]
        assert_refused(arguments, capsys, "expected a folder to write to")


def assert_refused(arguments, capsys, problem):
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert len(captured.err.splitlines()) == 1
    assert captured.err.startswith("tetra-drake: ")
    assert problem in captured.err
