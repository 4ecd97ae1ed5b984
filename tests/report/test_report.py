"""The report of a run: it is sound, says what the record says, and needs nothing else."""

from __future__ import annotations

import dataclasses
import re
import shlex
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote

import pytest
from helpers.meshcat_page import read_page
from helpers.synthetic_run import tiny_scenario, write_run

from tetra_drake.cli import make_parser
from tetra_drake.evolution.method import Method, Part
from tetra_drake.evolution.summary import comparisons
from tetra_drake.evolution.tables import load_run
from tetra_drake.figures.evolution import two_best
from tetra_drake.figures.study import Study, study_run
from tetra_drake.report.run_page import render_report, write_report
from tetra_drake.scenario.schema import ReferenceScenario
from tetra_drake.scenario.units import INCH

from .conftest import TRIALS

EVIL = """<script>alert(1)</script> & "quoted" 'name'"""
VOID = {"meta", "img", "br"}
REFERENCE = ReferenceScenario("a paper", best_distance=14.34 * INCH, two_best_weights=[0.1] * 4)


class Page(HTMLParser):
    """Tags and texts of a page; its tags must be closed in order."""

    def __init__(self, source: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.texts: dict[str, list[str]] = {}
        self.feed(source)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        assert len(dict(attributes)) == len(attributes)
        self.tags.append((tag, dict(attributes)))
        self.texts.setdefault(tag, [])
        if tag not in VOID:
            self.open.append(tag)
            self.texts[tag].append("")

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        for tag in set(self.open):
            self.texts[tag][-1] += data

    def attributes(self, name: str) -> list[str]:
        return [str(values[name]) for _, values in self.tags if name in values]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with its report; its gaits were made up, so they do not move as recorded."""
    directory = tmp_path_factory.mktemp("runs") / "run"
    write_run(directory, TRIALS, scenario=tiny_scenario(name=EVIL))
    names = [path.name for path in write_report(directory)]
    assert names == ["figures", "replay.html", "report.html"]
    return directory


@pytest.fixture(scope="module")
def source(run: Path) -> str:
    return (run / "report.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def page(source: str) -> Page:
    return Page(source)


@pytest.fixture(scope="module")
def study(run: Path) -> Study:
    return study_run(load_run(run))


def with_manifest(study: Study, **changes: object) -> Study:
    manifest = dataclasses.replace(study.run.manifest, **changes)  # type: ignore[arg-type]
    return dataclasses.replace(study, run=dataclasses.replace(study.run, manifest=manifest))


def render(study: Study) -> Page:
    """The page without figures."""
    return Page(render_report(study, [], folder=Path("unused")))


def test_figures_are_files_and_in_the_page(run: Path, page: Page) -> None:
    files = {path.name for path in (run / "figures").iterdir()}
    stems = {name.removesuffix(".svg") for name in files if name.endswith(".svg")}
    assert {"fitness_of_trials", "before_and_after", "one_step", "ground_forces"} <= stems
    assert files == {f"{s}{kind}" for s in stems for kind in (".svg", ".png")} | {"two_best.csv"}
    drawn = {(run / "figures" / f"{stem}.svg").read_text().replace("\n", " ") for stem in stems}
    images = [str(values["src"]).split(",", 1) for tag, values in page.tags if tag == "img"]
    assert {kind for kind, _ in images} == {"data:image/svg+xml"}
    assert {" ".join(unquote(svg).split()) for _, svg in images} == {
        " ".join(svg.split()) for svg in drawn
    }
    assert all(page.texts["figcaption"])


def test_it_needs_no_network_and_links_relatively(run: Path, source: str, page: Page) -> None:
    links = [*page.attributes("src"), *page.attributes("href")]
    files = [link for link in links if not link.startswith("data:")]
    assert {"replay.html", "figures/", "trial_01/best_gait.json"} <= set(files)
    for link in files:
        assert not re.match(r"[a-z]+:|/", link)
        # This run was never evolved, which is when the best gait's file is written.
        assert (run / link).exists() or link == "trial_01/best_gait.json"
    without_pictures = re.sub(r'"data:image[^"]*"', "", source)
    for elsewhere in ("data:", "http", "url(", "@import"):
        assert elsewhere not in without_pictures
    assert len(source) < 3e6


def test_names_are_escaped(run: Path, source: str, page: Page) -> None:
    assert EVIL not in source
    assert "script" not in {tag for tag, _ in page.tags}
    for tag in ("h1", "title"):
        (text,) = page.texts[tag]
        assert text.startswith(EVIL)
    assert "<script>alert" not in (run / "replay.html").read_text(encoding="utf-8")
    assert "<script>alert" not in read_page(run / "replay.html")


def test_each_trial_has_a_row(page: Page) -> None:
    # Distances are half the fitnesses; the gait that failed counts in no mean.
    cells = page.texts["td"]
    for rise, row in (
        ("1.00 → 1.50", ["50.00", "0.50 → 2.50", "1", "5", "1"]),
        ("0.75 → 2.00", ["166.67", "1.00 → 2.67", "1", "5", "0"]),
    ):
        place = cells.index(rise) + 1
        assert cells[place : place + len(row)] == row


def test_the_best_gait_is_shown_with_its_parameters_and_as_recorded(
    study: Study, page: Page
) -> None:
    table = two_best(study.run, study.trial)
    assert table is not None
    cells, headings = page.texts["td"], page.texts["th"]
    for name, row in table.iterrows():
        assert str(name) in headings
        assert all(f"{value:.4f}" in cells for value in row)
    # As recorded; simulated again, this gait moves elsewhere, which a note says.
    assert "4.00" in cells
    assert "2.00 inches" in page.texts["h1"][0]
    assert (study.best.label, study.initial.label) == (
        "trial 1, evaluation 4",
        "trial 1, evaluation 0",
    )
    assert any("trial 1, evaluation 4: 2 in" in text for text in page.texts["p"])


def test_reference_numbers_stand_only_where_the_scenario_has_them(study: Study, page: Page) -> None:
    assert "a paper" not in " ".join(page.texts["body"])
    scenario = dataclasses.replace(study.run.manifest.scenario, reference=REFERENCE)
    beside = with_manifest(study, scenario=scenario)
    shown = render(beside)
    assert "a paper" in shown.texts["th"]
    for row in comparisons(beside.run):
        place = shown.texts["td"].index(row.ours)
        assert row.reference in shown.texts["td"][place : place + 2]
    assert shown.texts["td"].count("0.1000") >= 4


def test_settings_that_differ_from_the_thesis_are_listed(page: Page) -> None:
    facts = dict(zip(page.texts["th"], page.texts["td"][: len(page.texts["th"])], strict=False))
    assert facts["robot.tetrahedra"] == "3"
    assert facts["simulation.duration"] == "0.3 s"
    assert "cables.damping" not in facts


def test_the_commands_to_reproduce_it_are_commands(page: Page) -> None:
    commands = page.texts["pre"][0].strip().splitlines()
    for command in commands:
        program, *arguments = shlex.split(command)
        assert program == "tetra-drake"
        make_parser().parse_args(arguments)
    assert [shlex.split(command)[1] for command in commands] == ["evolve", "simulate", "figures"]
    assert "--seed 7" in commands[0]


def test_what_was_given_from_python_is_named_and_no_command_claims_to_repeat_it(
    study: Study,
) -> None:
    method = Method(
        evaluator=Part("compiled"),
        objective=Part("mine.far", {}, "0123456789abcdef" * 4),
        optimizer=Part("mine.Search", {"step": 0.25}, "fedcba9876543210" * 4),
    )
    page = render(with_manifest(study, method=method))
    text = " ".join(page.texts["td"])
    for word in ("mine.far", "0123456789abcdef", "mine.Search", '"step": 0.25'):
        assert word in text
    assert "evolve" not in page.texts["pre"][0]
    assert "SteadyState" not in text and "steady-state" not in text


def test_an_unfinished_run_and_what_the_diagram_made_of_its_best(tmp_path: Path) -> None:
    directory = write_run(tmp_path / "run", TRIALS, unfinished=(0,))
    study = study_run(load_run(directory))
    again = study.run.evaluations.assign(distance_in=1.23)
    page = render(
        dataclasses.replace(study, run=dataclasses.replace(study.run, reevaluations=again))
    )
    assert any("--resume" in text for text in page.texts["p"])
    assert page.texts["td"].count("1.23") == 2
