"""The README: its snippets run, its links lead somewhere."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

import tetra_drake as td
from tetra_drake.cli import main

CHECKOUT = Path(__file__).parents[1]
README = (CHECKOUT / "README.md").read_text(encoding="utf-8")

QUICK = """\
base: thesis
name: quick
simulation: {duration: 0.4 s, steady_from: 0.1 s}
evolution: {population: 4, tournament: 2, trials: 1, max_iterations: 1}
"""
"""Takes the place of the shipped scenario of this name."""


def snippets(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", README, re.MULTILINE | re.DOTALL)


@pytest.fixture
def work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_commands_run(work: Path) -> None:
    (work / "short.yaml").write_text(QUICK)
    lines = [line for snippet in snippets("sh") for line in snippet.splitlines()]
    commands = [line.rpartition("tetra-drake ")[2] for line in lines if "tetra-drake " in line]
    assert len(commands) == 4
    for command in commands:
        # Shorter simulations of the same kind; the rest is as it stands.
        arguments = shlex.split(re.sub(r"--scenario \w+", "--scenario short.yaml", command))
        if arguments[0] == "simulate":
            arguments += ["--scenario", "short.yaml"]
        assert main(arguments) == 0, command
    for page in ("out/replay.html", "runs/demo/replay.html", "runs/demo/report.html"):
        assert (work / page).is_file()


def test_the_python_runs(work: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (snippet,) = snippets("python")
    loaded = td.load_scenario
    monkeypatch.setattr(
        td,
        "load_scenario",
        lambda name: loaded(name).with_changes(
            {"simulation.duration": 1.0, "simulation.steady_from": 0.1}
        ),
        raising=False,
    )
    exec(compile(snippet, "README.md", "exec"), {})
    assert len(td.load_run("runs/python").evaluations) == 20


def test_the_scenario_loads(work: Path) -> None:
    (snippet,) = snippets("yaml")
    (work / "stiff.yaml").write_text(snippet)
    scenario = td.load_scenario("stiff.yaml")
    assert scenario.robot.tetrahedra == 7
    assert scenario.cables.outer_stiffness == 45.0
    assert scenario.robot.spacing != td.load_scenario("thesis").robot.spacing, "balanced"


FOLDERS = ("diagrams", "runs", "tetra_drake/engines", "tetra_drake/scenario")


@pytest.mark.parametrize("page", ["README.md", *(f"{folder}/README.md" for folder in FOLDERS)])
def test_links_lead_somewhere(page: str) -> None:
    file = CHECKOUT / page
    links = re.findall(r"\]\(([^)#]+)[^)]*\)", file.read_text(encoding="utf-8"))
    assert links
    for link in links:
        assert link.startswith("https://") or (file.parent / link).exists(), link


def test_the_page_fits() -> None:
    assert len(README.splitlines()) <= 130
