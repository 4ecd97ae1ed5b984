"""The pages: their snippets run, their commands can be parsed, their links lead somewhere."""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers.brief import BRIEF

import tetra_drake as td
from tetra_drake.cli import main, make_parser
from tetra_drake.lab.bridges.conversion import converted
from tetra_drake.lab.fit.measurements import load_fit_file
from tetra_drake.scenario.structure_files import read_structure
from tetra_drake.systems import MatsuokaCpg

CHECKOUT = Path(__file__).parents[1]
README = (CHECKOUT / "README.md").read_text(encoding="utf-8")
FOLDERS = "diagrams", "tetra_drake", "tests/data", ".github"
MANUAL = [page for folder in FOLDERS for page in sorted((CHECKOUT / folder).rglob("*.md"))]
"""Pages beside the README; those of `runs` are made by scripts."""


def text_of(page: str) -> str:
    """A page of the package, by its place there, without .md."""
    return (CHECKOUT / "tetra_drake" / f"{page}.md").read_text(encoding="utf-8")


def snippets(language: str, page: str = README) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)


@pytest.fixture
def work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def commands(page: str) -> list[list[str]]:
    """The arguments of each command `tetra-drake` in the snippets of a page."""
    lines = re.findall(r"tetra-drake (.*)", "\n".join(snippets("sh", page)))
    return [shlex.split(line) for line in lines]


def test_the_commands_of_all_pages_are_commands_with_their_options() -> None:
    pages = [CHECKOUT / "README.md", *MANUAL]
    written = [arguments for page in pages for arguments in commands(page.read_text("utf-8"))]
    assert len(written) >= 15
    for arguments in written:
        make_parser().parse_args(arguments)  # ends the process if it cannot be parsed


def test_the_plugin_of_the_page_is_the_example() -> None:
    folder = CHECKOUT / "tests/data/plugin"
    (law,) = snippets("python", text_of("scenario/plugins"))
    assert law in (folder / "tetra_example/__init__.py").read_text(encoding="utf-8")
    (entries,) = snippets("toml", text_of("scenario/plugins"))
    declared = (folder / "pyproject.toml").read_text(encoding="utf-8").splitlines()
    assert {*entries.splitlines()} <= {*declared}


def test_the_files_of_other_kinds_are_read(work: Path) -> None:
    [tower] = snippets("yaml", text_of("lab/files"))
    [_, fit] = snippets("yaml", text_of("scenario/tolerances"))
    (work / "tower.yaml").write_text(tower)
    (work / "fit.yaml").write_text(fit)
    structure = converted(Path("tower.yaml"), unit="dm")
    assert structure.nodes["f"] == pytest.approx([0.5, 0.0, 1.0])
    assert len(structure.struts["rod"].pairs) == 3
    capture, rest = load_fit_file("fit.yaml").measurements
    assert (capture.log, capture.command) == ("log.csv", "command.csv")
    assert rest.positions == {"n3 z": 0.171}


@pytest.mark.slow
def test_the_commands_run(work: Path) -> None:
    (work / "short.yaml").write_text(td.load_scenario("quick").with_changes(BRIEF).to_yaml())
    for arguments in commands(README):
        # Shorter simulations of the same kind; the rest is as it stands.
        short = ["--scenario", "short.yaml"] if arguments[0] in ("simulate", "evolve") else []
        assert main([*arguments, *short]) == 0, arguments
    for page in ("out/replay.html", "runs/demo/replay.html", "runs/demo/report.html"):
        assert (work / page).is_file()


@pytest.fixture
def change_all(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """change_all({"simulation.duration": "1 s"}) changes all scenarios that a snippet loads."""
    load = td.load_scenario

    def change(changes: dict[str, Any]) -> None:
        monkeypatch.setattr(
            td, "load_scenario", lambda n: load(n).with_changes(changes), raising=False
        )

    return change


SECOND = {"simulation.duration": "1.0 s", "simulation.steady_from": "0.1 s"}


def ran(snippet: str) -> dict[str, Any]:
    """The names of a snippet that has run."""
    names = dict[str, Any]()
    exec(compile(snippet, "a page", "exec"), names)
    return names


def test_the_python_runs(work: Path, change_all, monkeypatch: pytest.MonkeyPatch) -> None:
    change_all(SECOND)
    monkeypatch.setattr("tetra_drake.report.run_page.write_report", lambda directory: None)
    page = (CHECKOUT / "diagrams/tasks.md").read_text(encoding="utf-8")
    ran(*snippets("python", page))
    assert len(td.load_run("runs/python").evaluations) == 60


def test_a_search_builds_a_diagram_per_candidate(change_all) -> None:
    change_all({"simulation.duration": "0.05 s", "optimizer.population": 5})
    names = ran(*snippets("python"))
    cpg = names["diagram"].GetSubsystemByName("cpg")
    assert isinstance(cpg, MatsuokaCpg)
    assert len(names["found"]) == 2 and np.isfinite([one.fitness for one in names["found"]]).all()


def test_the_front_page_is_short() -> None:
    assert len(README.split()) <= 800
    assert len(README.split("## Install and run")[0].split()) <= 300


@pytest.mark.parametrize(("library", "number"), [("optuna", 1), ("nevergrad", 2), ("scipy", 3)])
def test_libraries_find_gaits(library: str, number: int, change_all) -> None:
    pytest.importorskip(library)
    change_all({"simulation.duration": "2.5 s"})
    texts = snippets("python", text_of("evolution/libraries"))
    names = ran(texts[0] + texts[number])
    gait, first = names["best"], td.seeded_gait(names["scenario"], 1)
    best, other = td.simulate_many(names["scenario"], [gait, first])
    assert best.fitness > other.fitness


def test_the_steering_runs_as_a_function_and_by_the_port(change_all) -> None:
    change_all(SECOND)
    names = ran(snippets("python", text_of("scenario/signals"))[0])
    assert names["result"].duration == names["simulator"].get_context().get_time() == 1.0
    steering = names["diagram"].GetSubsystemByName("steering")
    context = steering.GetMyContextFromRoot(names["simulator"].get_context())
    # u0 (1 + 0.8) for extensor and flexor on the left, u0 (1 - 0.8) on the right.
    tonic = steering.get_output_port().Eval(context)
    assert tonic[:4] == pytest.approx([0.9, 0.9, 0.1, 0.1], rel=1e-12)


def test_winches_wind_a_structure(change_all) -> None:
    change_all({"robot.gravity": "0 m/s^2", "terrain": "!Nothing"})
    names = ran(snippets("python", text_of("scenario/signals"))[1])
    lengths = names["result"].trajectory.length
    assert np.abs(lengths[-1] - lengths[0]).max() > 0.01


def test_the_scenarios_and_the_gait_of_the_pages_load(work: Path) -> None:
    loaded = 0
    for page in MANUAL:
        for file in snippets("yaml", page.read_text(encoding="utf-8")):
            if "base:" in file:
                (name,) = re.findall(r"^name: (.*)$", file, re.M)
                (work / f"{name}.yaml").write_text(re.sub(r"file: crane.yaml", "file: prism", file))
                assert td.load_scenario(f"{name}.yaml").name == name
                loaded += 1
            elif "struts:" in file and page.stem == "structures":
                (work / "structure.yaml").write_text(file)
                assert read_structure("structure.yaml").body_count == 3
    assert loaded >= 10
    assert td.load_scenario("snake.yaml").oscillators == 12  # three groups at four junctions
    (gait,) = snippets("json", text_of("scenario/signals"))
    (work / "gait.json").write_text(gait)
    small = td.load_scenario("feedback").with_changes({"robot.tetrahedra": 3})
    expected = {"gain load": 0.0} | json.loads(gait)["parameters"]
    assert td.load_gait("gait.json", small).parameters == expected


def test_the_springs_of_a_catalogue_are_as_the_page_says(work: Path) -> None:
    page = text_of("scenario/structures")
    (coils,) = (file for file in snippets("yaml", page) if "max_tension" in file)
    rows = re.findall(r"^\| (?:linear|with initial tension) \|(.*)", page, re.M)
    for row, given in zip(rows, [r" *initial_tension: 0.22 N(,|\n)", "nothing"], strict=True):
        (work / "coils.yaml").write_text(re.sub(given, "", coils))
        study = td.study_equilibrium("coils.yaml")
        tension, length = (study.cables[name].to_numpy()[[0, -1]] for name in ("tension", "length"))
        told = [float(number) for number in re.findall(r"[\d.]+", row)]
        height = 1e3 * study.nodes["z"].max()
        found = [height, *np.transpose([tension, 1e3 * length]).ravel(), *study.frequencies[:3]]
        assert found == pytest.approx(told, rel=5e-3)
        densities = tension / length
        assert densities[1] / densities[0] == pytest.approx(np.sqrt(3.0), rel=5e-3)  # of any prism


def test_the_roads_name_what_the_files_have() -> None:
    page = " ".join(text_of("README").split())
    named = re.findall(r"\]\(([\w/]+\.py)\):((?:,? `\w+`)+)", page)
    assert len(named) > 30
    for file, names in named:
        source = (CHECKOUT / "tetra_drake" / file).read_text(encoding="utf-8")
        for name in re.findall(r"\w+", names):
            assert re.search(rf"\b{name}\b", source), f"{file}: {name}"


LINK = re.compile(r'(?:\]\(|src="|href=")([^)"]+)')
PAGES = [*CHECKOUT.glob("*.md"), *CHECKOUT.glob("runs/**/*.md"), *MANUAL]
LINKED = [page for page in PAGES if LINK.search(page.read_text("utf-8"))]


def anchors(page: Path) -> set[str]:
    """The names by which links reach the headings of a page."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", text.lower()).replace(" ", "-") for text in headings}


@pytest.mark.parametrize("page", LINKED, ids=lambda page: str(page.relative_to(CHECKOUT)))
def test_links_lead_somewhere(page: Path) -> None:
    for link in LINK.findall(page.read_text(encoding="utf-8")):
        if link.startswith("https://"):
            continue
        path, _, anchor = link.partition("#")
        target = page.parent / path if path else page
        assert target.exists(), link
        assert not anchor or anchor in anchors(target), link
