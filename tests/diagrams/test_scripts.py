"""The scripts in diagrams/ as they are run, and the tutorials, each with its picture beside it."""

import runpy
import shutil
from pathlib import Path

import entrainment
import evolution
import pytest
import robot
import settling_node
import single_oscillator
import sliding_tetrahedron
import tetrahedron_on_incline
from helpers.shorter import shortened
from tables import aspect

from tetra_drake import systems

SCRIPTS = [
    (single_oscillator, {"weights": [1.0, 2.0], "ratios": [3.0]}, 3),
    pytest.param(entrainment, {}, 2, marks=pytest.mark.slow),
    (settling_node, {}, 2),
    (sliding_tetrahedron, {"speed": 0.5, "slope": 0.05, "law": "!Coulomb"}, 1),
    (tetrahedron_on_incline, {}, 1),
    (robot, {"duration": 0.1}, 2),
]


def slide_briefly(scenario, *, duration, speed=0.0, of=tetrahedron_on_incline.simulate):
    """A tenth of a motion on the incline."""
    return of(scenario, speed=speed, duration=0.1 * duration)


@pytest.mark.skipif(shutil.which("dot") is None, reason="Graphviz is not installed")
@pytest.mark.parametrize(("script", "options", "files"), SCRIPTS)
def test_a_script_writes_its_pictures(script, options, files, tmp_path, monkeypatch):
    monkeypatch.setattr(tetrahedron_on_incline, "simulate", slide_briefly)
    script.main(out=tmp_path, **options)
    written = {path.name for path in tmp_path.iterdir() if path.stat().st_size > 1000}
    assert len(written) == files
    folders = Path(robot.__file__).parent, Path(systems.__file__).parent
    kept = {path.name for folder in folders for path in folder.glob("*.svg")}
    assert written - {"robot.html"} <= kept


def test_the_loop_on_one_screen_ends_with_a_replay(tmp_path, monkeypatch, capsys):
    brief = {"simulation.duration": "0.05 s", "optimizer.population": 5}
    monkeypatch.setattr(evolution, "SCENARIO", evolution.SCENARIO.with_changes(brief))
    monkeypatch.setattr(evolution, "OUT", tmp_path)
    evolution.main(6)
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == ["5", "7"]
    assert (tmp_path / "evolution.html").is_file()
    code = Path(evolution.__file__).read_text(encoding="utf-8")
    assert len(code.splitlines()) <= 50


CHECKOUT = Path(__file__).parents[2]
TUTORIALS = CHECKOUT / "diagrams" / "tutorials"
NAMES = sorted(file.stem for file in TUTORIALS.glob("*.py"))


def skip_without_its_packages(name: str) -> None:
    if name == "17_learning":
        pytest.importorskip("stable_baselines3")


SLOW = ("05", "06", "07", "09", "10", "11", "15", "16", "17", "18", "22", "23", "24")


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * name.startswith(SLOW)) for name in NAMES]
)
def test_a_tutorial_runs_and_draws_its_picture(name, tmp_path, monkeypatch):
    skip_without_its_packages(name)
    folder = tmp_path / "diagrams" / "tutorials"
    shutil.copytree(TUTORIALS, folder, ignore=shutil.ignore_patterns("*.png"))
    (tmp_path / "runs").symlink_to(CHECKOUT / "runs")
    monkeypatch.chdir(tmp_path)
    script = folder / f"{name}.py"
    script.write_text(shortened(script.read_text("utf-8")), "utf-8")
    runpy.run_path(str(script), run_name="__main__")
    drawn, kept = (aspect(place / f"{name}.png") for place in (tmp_path, TUTORIALS))
    assert drawn == kept
