"""The report of a run: what stands in it, that it is sound, and that it needs nothing else."""

from __future__ import annotations

import dataclasses
import re
import shlex
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pytest
from helpers.meshcat_page import read_page
from helpers.synthetic_run import tiny_scenario, write_run

from tetra_drake.cli import make_parser
from tetra_drake.evolution.study import Study, study_run
from tetra_drake.evolution.summary import comparisons
from tetra_drake.evolution.tables import load_run
from tetra_drake.figures.evolution import table_8_two_best
from tetra_drake.report.run_page import render_report, write_report

EVIL = """<script>alert(1)</script> & "quoted" 'name'"""
FIGURES = (14, 15, 16, 17, 18, 19, 20, 21, 22, 23)
VOID = {"meta", "img", "br"}
TRIALS = [
    [[(2.0, 0), (-1.0, 1), (None, 2)], [(3.0, 1), (1.0, None)]],
    [[(1.5, 0), (0.5, 1), (1.0, 2)], [(2.5, 1), (4.0, 2)]],
]


class Page(HTMLParser):
    """What stands in a page; its tags must be closed in order."""

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


def make_run(directory: Path, **options: object) -> Path:
    return write_run(directory, TRIALS, scenario=tiny_scenario(name=EVIL), **options)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with its report; its gaits were made up, so they end elsewhere than recorded."""
    directory = make_run(tmp_path_factory.mktemp("runs") / "run")
    assert write_report(directory) == ["figures/", "replay.html", "report.html"]
    return directory


@pytest.fixture(scope="module")
def source(run: Path) -> str:
    return (run / "report.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def page(source: str) -> Page:
    return Page(source)


@pytest.fixture(scope="module")
def study(run: Path) -> Study:
    return study_run(run)


def render(study: Study) -> Page:
    """The page without figures."""
    return Page(render_report(study, [], folder=Path("unused")))


def test_all_figures_are_files_and_stand_in_the_page_once(run: Path, page: Page) -> None:
    files = sorted(path.name for path in (run / "figures").iterdir())
    numbers = [
        int(re.findall(r"figure_(\d+)_\w+\.svg", name)[0]) for name in files if "svg" in name
    ]
    assert numbers == list(FIGURES)
    stems = [name.removesuffix(".svg") for name in files if name.endswith(".svg")]
    expected = {f"{stem}{suffix}" for stem in stems for suffix in (".svg", ".png")}
    assert set(files) == expected | {"table_08_two_best.csv"}

    images = [values for tag, values in page.tags if tag == "img"]
    assert [int(str(i["alt"]).split(":")[0].removeprefix("Figure ")) for i in images] == numbers
    for image, stem in zip(images, stems, strict=True):
        kind, content = str(image["src"]).split(",", 1)
        assert kind == "data:image/svg+xml"
        drawn = (run / "figures" / f"{stem}.svg").read_text(encoding="utf-8")
        assert unquote(content).split() == drawn.split()
    captions = page.texts["figcaption"]
    assert len(captions) == len(numbers)
    assert all(f"Figure {n}." in text for n, text in zip(numbers, captions, strict=True))
    assert all("Thesis: " in text for text in captions)


def test_it_needs_no_network_and_links_relatively(run: Path, source: str, page: Page) -> None:
    links = [*page.attributes("src"), *page.attributes("href")]
    files = [link for link in links if not link.startswith("data:")]
    assert {"replay.html", "figures/", "trial_01/best_gait.json"} <= set(files)
    for link in files:
        assert not re.match(r"[a-z]+:|/", link)
        # This run was never evolved, which is when the best gait's file is written.
        assert (run / link).exists() or link == "trial_01/best_gait.json"
    without_pictures = re.sub(r'"data:image[^"]*"', "", source)
    assert "data:" not in without_pictures
    for elsewhere in ("http", "url(", "@import"):
        assert elsewhere not in without_pictures


def test_names_are_escaped(run: Path, source: str, page: Page) -> None:
    assert EVIL not in source
    assert "script" not in {tag for tag, _ in page.tags}
    assert page.texts["h1"][0].startswith(EVIL)
    assert page.texts["title"][0].startswith(EVIL)
    assert "<script>alert" not in (run / "replay.html").read_text(encoding="utf-8")
    assert "<script>alert" not in read_page(run / "replay.html")


def test_it_is_a_whole_page_of_moderate_size(source: str, page: Page) -> None:
    assert source.startswith("<!DOCTYPE html>\n<html lang=")
    assert [tag for tag, _ in page.tags[:3]] == ["html", "head", "meta"]
    for once in ("title", "h1", "style", "body"):
        assert len(page.texts[once]) == 1
    assert len(source) < 3e6


def test_results_are_those_that_evolve_prints(run: Path, page: Page) -> None:
    headings, cells = page.texts["th"], page.texts["td"]
    rows = comparisons(load_run(run)).statuses
    assert len(rows) == 5
    for row in rows:
        assert row.name in headings
        place = cells.index(row.ours)
        assert row.reference in cells[place : place + 2]


def test_each_trial_has_a_row(page: Page) -> None:
    # Distances are half the fitnesses; the gait that failed counts in no mean.
    first, second = "1.00 → 1.50", "0.75 → 2.00"
    cells = page.texts["td"]
    for rise, row in (
        (first, ["50.00 %", "0.50 → 2.50", "1", "5", "1", "all iterations done"]),
        (second, ["166.67 %", "1.00 → 2.67", "1", "5", "0", "all iterations done"]),
    ):
        place = cells.index(rise)
        assert cells[place + 1 : place + 1 + len(row)] == row


def test_table_8_and_the_best_gait_are_laid_out_in_fours(study: Study, page: Page) -> None:
    table = table_8_two_best(study.run, 1)
    assert table is not None
    cells = page.texts["td"]
    for name, difference in table["difference"].items():
        assert f"{difference:.4f}" in cells, name
    assert page.texts["th"].count("w1\N{EN DASH}4") == 2
    for weight in study.best.gait.weights:
        assert f"{weight:.4f}" in cells


def test_the_thesiss_table_8_stands_below_ours(tmp_path: Path) -> None:
    scenario = tiny_scenario()
    scenario.robot.tetrahedra = 5
    page = render(study_run(write_run(tmp_path / "run", TRIALS, scenario=scenario)))
    cells = page.texts["td"]
    ending = [cell[6:] for cell in cells if re.fullmatch(r"\d\.\d{4}\d\.\d{4}", cell)]
    assert len(ending) == 27
    # Row by row: fitness, w1, w5, w9 ..., tau_A; then w2, w6 ...
    assert ending[:4] == ["0.0006", "0.0594", "0.1184", "0.0874"]
    assert ending[8:10] == ["0.1063", "0.0000"]
    assert ending[-1] == "0.1322"


def test_it_says_that_gaits_did_not_go_as_recorded(study: Study, page: Page) -> None:
    (note,) = (text for text in page.texts["p"] if "simulated again" in text)
    assert "trial 1, evaluation 4 ends 2 in from where it did in the run" in note
    distance = study.best.result.metrics.distance_in
    assert abs(distance) < 0.1
    as_recorded = dataclasses.replace(study.best, recorded_distance_in=distance)
    quiet = render(dataclasses.replace(study, best=as_recorded, initial=as_recorded))
    assert not any("simulated again" in text for text in quiet.texts["p"])


def test_an_unfinished_run_says_so(tmp_path: Path) -> None:
    page = render(study_run(make_run(tmp_path / "run", unfinished=(0,))))
    assert any("not finished: 1 of 2 trials go on" in text for text in page.texts["p"])
    assert "not ended" in page.texts["td"]


def test_a_compiled_run_shows_what_the_diagram_made_of_its_best(study: Study, page: Page) -> None:
    heading = "best on the Drake diagram"
    assert heading not in page.texts["th"]
    again = study.run.evaluations.assign(distance_in=1.23)
    page = render(
        dataclasses.replace(study, run=dataclasses.replace(study.run, reevaluations=again))
    )
    assert heading in page.texts["th"]
    assert page.texts["td"].count("1.23") == 2


def test_the_commands_to_reproduce_it_are_commands(page: Page) -> None:
    commands = page.texts["pre"][0].strip().splitlines()
    assert len(commands) == 3
    for command in commands:
        program, *arguments = shlex.split(command)
        assert program == "tetra-drake"
        make_parser().parse_args(arguments)
    assert "--seed 7" in commands[0]


def test_table_8_is_a_csv_file_as_well(run: Path, study: Study) -> None:
    lines = (run / "figures" / "table_08_two_best.csv").read_text().splitlines()
    assert lines[0] == "parameter,best,second,difference,thesis"
    table = table_8_two_best(study.run, 1)
    assert table is not None
    for line, (name, row) in zip(lines[1:], table.iterrows(), strict=True):
        parameter, *numbers = line.split(",")
        assert parameter == name
        assert np.array(numbers[:3], dtype=float).tolist() == row.tolist()[:3]
