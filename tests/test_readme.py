"""The pages: their snippets run, their commands can be parsed, their links lead somewhere."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from record import EXPERIMENTS

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


QUICK = """\
base: thesis
name: quick
simulation: {duration: 0.4 s, steady_from: 0.1 s}
evolution: {trials: 1, evaluations: 6}
optimizer: {population: 4, tournament: 2}
"""
"""Takes the place of the shipped scenario of this name."""


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
    (work / "short.yaml").write_text(QUICK)
    for arguments in commands(README):
        # Shorter simulations of the same kind; the rest is as it stands.
        short = ["--scenario", "short.yaml"] if arguments[0] in ("simulate", "evolve") else []
        assert main([*arguments, *short]) == 0, arguments
    for page in ("out/replay.html", "runs/demo/replay.html", "runs/demo/report.html"):
        assert (work / page).is_file()


@pytest.fixture
def shortened(monkeypatch: pytest.MonkeyPatch) -> None:
    """All scenarios end after a second."""
    load = td.load_scenario
    times = {"simulation.duration": "1.0 s", "simulation.steady_from": "0.1 s"}
    monkeypatch.setattr(td, "load_scenario", lambda n: load(n).with_changes(times), raising=False)


def test_the_python_runs(work: Path, shortened: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tetra_drake.report.run_page.write_report", lambda directory: None)
    page = (CHECKOUT / "diagrams/tasks.md").read_text(encoding="utf-8")
    (snippet,) = snippets("python", page)
    exec(compile(snippet, "tasks.md", "exec"), {})
    assert len(td.load_run("runs/python").evaluations) == 60


def test_a_search_builds_a_diagram_per_candidate(monkeypatch: pytest.MonkeyPatch) -> None:
    load = td.load_scenario
    brief = {"simulation.duration": "0.05 s", "optimizer.population": 5}
    monkeypatch.setattr(td, "load_scenario", lambda n: load(n).with_changes(brief), raising=False)
    (snippet,) = snippets("python")
    names = dict[str, Any]()
    exec(compile(snippet, "README.md", "exec"), names)
    cpg = names["diagram"].GetSubsystemByName("cpg")
    assert isinstance(cpg, MatsuokaCpg)
    assert len(names["found"]) == 2 and np.isfinite([one.fitness for one in names["found"]]).all()


def test_the_front_page_is_short() -> None:
    assert len(README.split()) <= 800
    assert len(README.split("## Install and run")[0].split()) <= 300


@pytest.mark.parametrize(("library", "number"), [("optuna", 1), ("nevergrad", 2), ("scipy", 3)])
def test_libraries_find_gaits(library: str, number: int, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip(library)
    short = td.load_scenario("coulomb").with_changes({"simulation.duration": "2.5 s"})
    monkeypatch.setattr(td, "load_scenario", lambda name: short, raising=False)
    texts, names = snippets("python", text_of("evolution/libraries")), dict[str, Any]()
    exec(compile(texts[0] + texts[number], "libraries.md", "exec"), names)
    gait, first = names["best"], td.seeded_gait(names["scenario"], 1)
    best, other = td.simulate_many(names["scenario"], [gait, first])
    assert best.fitness > other.fitness


def test_the_steering_runs_as_a_function_and_by_the_port(work: Path, shortened: None) -> None:
    (snippet, _) = snippets("python", text_of("scenario/signals"))
    names: dict[str, Any] = {}
    exec(compile(snippet, "signals.md", "exec"), names)
    assert names["result"].duration == names["simulator"].get_context().get_time() == 1.0
    steering = names["diagram"].GetSubsystemByName("steering")
    context = steering.GetMyContextFromRoot(names["simulator"].get_context())
    # u0 (1 + 0.8) for extensor and flexor on the left, u0 (1 - 0.8) on the right.
    tonic = steering.get_output_port().Eval(context)
    assert tonic[:4] == pytest.approx([0.9, 0.9, 0.1, 0.1], rel=1e-12)


def test_winches_wind_a_structure(work: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    floats = {"robot.gravity": "0 m/s^2", "terrain": "!Nothing"}
    floating = td.load_scenario("six_bar").with_changes(floats)
    monkeypatch.setattr(td, "load_scenario", lambda name: floating, raising=False)
    (_, snippet) = snippets("python", text_of("scenario/signals"))
    names: dict[str, Any] = {}
    exec(compile(snippet, "signals.md", "exec"), names)
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
    assert td.load_gait("gait.json", small).parameters == {
        "gain load": 0.0,
        **json.loads(gait)["parameters"],
    }


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


RUNS = (
    "runs",
    *(f"runs/{name}" for name in EXPERIMENTS if (CHECKOUT / "runs" / name).is_dir()),
    *("runs/bench", "runs/damage", "runs/measured", "runs/oscillators", "runs/planning"),
    *("runs/published", "runs/verification"),
)
"""Runs of one's own may lie beside the recorded ones."""
LINK = re.compile(r'(?:\]\(|src="|href=")([^)"]+)')
PAGES = [
    "README.md",
    "CHANGELOG.md",
    "runs/thesis/THESIS.md",
    *(f"{run}/README.md" for run in RUNS),
]
PAGES += [
    str(page.relative_to(CHECKOUT)) for page in MANUAL if LINK.search(page.read_text("utf-8"))
]


def anchors(page: Path) -> set[str]:
    """The names by which links reach the headings of a page."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", text.lower()).replace(" ", "-") for text in headings}


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_somewhere(page: str) -> None:
    file = CHECKOUT / page
    links = LINK.findall(file.read_text(encoding="utf-8"))
    assert links
    for link in links:
        if link.startswith("https://"):
            continue
        path, _, anchor = link.partition("#")
        target = file.parent / path if path else file
        assert target.exists(), link
        assert not anchor or anchor in anchors(target), link
