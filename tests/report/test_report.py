"""The report of a run: it is sound, says what the record says, and needs nothing else."""

import base64
import dataclasses
import re
import shlex
from pathlib import Path
from xml.etree import ElementTree

import pytest
from analyse import load_analysis
from helpers.synthetic_run import tiny_scenario, write_run

from tetra_drake.cli import make_parser
from tetra_drake.evolution.manifest import Method
from tetra_drake.evolution.run import load_run
from tetra_drake.report.run_page import (
    RECORDED_GAIT,
    render_report,
    simulate_shown_gaits,
    write_report,
)
from tetra_drake.settings.units import INCH

from .conftest import COSTS, TRIALS

CHECKOUT = Path(__file__).parents[2]
EVIL = """<script>alert(1)</script> & "quoted" 'name'"""


def tree_of(source):
    """The tree of a page, which is sound XML but for the empty tags of HTML."""
    _, _, html = source.partition("\n")
    return ElementTree.fromstring(re.sub(r"<((?:meta|link|img|br)\b[^>]*)>", r"<\1/>", html))


def texts(page, tag):
    return ["".join(part.itertext()) for part in page.iter(tag)]


def table(page):
    """The cells of all rows."""
    return [["".join(cell.itertext()) for cell in row] for row in page.iter("tr")]


def row_of(page, heading):
    """The cells of the last row that begins so."""
    return {cells[0]: cells[1:] for cells in table(page)}.get(heading)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A run with its report; its gaits were made up, so they do not move as recorded."""
    directory = tmp_path_factory.mktemp("runs") / "run"
    metrics = {fitness: {"cost_of_transport": cost} for fitness, cost in COSTS.items()}
    metrics[4.0] |= {"lifted_shares": [0.25, 0.0, 0.5]}
    scenario = tiny_scenario(name=EVIL).with_changes({"require": {"lead": "0.5 in"}})
    write_run(directory, TRIALS, scenario=scenario, metrics=metrics)
    names = [path.name for path in write_report(directory)]
    assert names == ["figures", "replay.html", "report.html"]
    return directory


@pytest.fixture(scope="module")
def source(run):
    return (run / "report.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def page(source):
    return tree_of(source)


@pytest.fixture(scope="module")
def study(run):
    return simulate_shown_gaits(load_run(run))


def render(study, **changes):
    """The page without figures, of a study with changes of its run."""
    run = dataclasses.replace(study.run, **changes)
    return tree_of(render_report(dataclasses.replace(study, run=run), {}, folder=Path()))


def test_figures_are_files_and_in_the_page(run, page):
    drawn = [path.read_bytes() for path in (run / "figures").glob("*.svg")]
    assert len(drawn) >= 9
    images = [picture.get("src").split(",", 1) for picture in page.iter("img")]
    assert {base64.b64decode(svg) for _, svg in images} == set(drawn)


def test_it_needs_no_network_and_links_relatively(run, source, page):
    links = [part.get("src") or part.get("href", "data:") for part in page.iter()]
    files = {link for link in links if not link.startswith("data:")}
    assert {"replay.html", "figures/", "trial_01/best_gait.json"} <= files
    assert not [link for link in files if re.match(r"[a-z]+:|/", link)]
    # This run was never evolved, which is when the best gait's file is written.
    missing = {link for link in files if not (run / link).exists()}
    assert missing == {"trial_01/best_gait.json"}
    without_pictures = re.sub(r'"data:(image[^"]*|,)"', "", source)
    for elsewhere in ("data:", "http", "url(", "@import"):
        assert elsewhere not in without_pictures


def test_names_are_escaped(source, page):
    assert EVIL not in source
    assert not [*page.iter("script")]
    assert all(texts(page, tag)[0].startswith(EVIL) for tag in ("h1", "title"))


def test_each_trial_and_each_setting_that_differs_from_the_thesis_has_a_row(page):
    assert ["trial", "initial distance (in)", "best", "evaluations", "failed"] in table(page)
    assert ["0", "1.00", "1.50", "5", "1"] in table(page)
    assert ["1", "0.750", "2.00", "5", ""] in table(page)
    settings = texts(page, "li")
    assert {"robot.tetrahedra 3", "simulation.steady_from 0.1 s"} <= set(settings)
    assert not any("damping" in text for text in settings)
    assert row_of(page, "simulated time") == ["0.3 s"]
    assert row_of(page, "required") == ["lead: 0.5 in"]


def test_metrics_of_the_best_gait_stand_beside_the_initial_ones(page):
    assert row_of(page, "distance (in)")[:2] == ["0.750", "2.00"]
    assert row_of(page, "cost of transport")[:2] == ["0.100", "0.900"]
    assert row_of(page, "heading change (deg)") is None  # which no gait has


def test_the_commands_to_reproduce_it_are_commands(page):
    commands = [shlex.split(line) for line in texts(page, "pre")[0].strip().splitlines()]
    for program, *arguments in commands:
        assert program == "tetra-drake"
        make_parser().parse_args(arguments)
    assert [command[1] for command in commands] == ["evolve", "simulate", "figures"]
    assert commands[0][commands[0].index("--seed") + 1] == "7"


def test_what_was_given_from_python_is_named_and_no_command_claims_to_repeat_it(study):
    method = Method(objective="mine.far", optimizer='mine.Search {"step": 0.25}')
    page = render(study, manifest=dataclasses.replace(study.run.manifest, method=method))
    text = " ".join([*texts(page, "td"), *texts(page, "p")])
    for name in (method.objective, method.optimizer):
        assert name in text
    assert "evolve" not in texts(page, "pre")[0]
    assert "SteadyState" not in text and "steady-state" not in text


def test_an_unfinished_run_and_what_the_diagram_made_of_its_best(tmp_path):
    study = simulate_shown_gaits(load_run(write_run(tmp_path / "run", TRIALS, unfinished=(0,))))
    page = render(study, reevaluations=study.run.evaluations.assign(distance=1.23 * INCH))
    assert any("--resume" in text for text in texts(page, "p"))
    (place,) = (row.index("in Drake") for row in table(page) if "in Drake" in row)
    trials = [row for row in table(page) if "not finished" in row or row[0] == "1"]
    assert [row[place] for row in trials if len(row) > place] == ["1.23", "1.23"]


def test_the_recorded_gait_is_up_to_date():
    best = load_analysis(CHECKOUT / "runs/thesis").best_trial
    recorded = CHECKOUT / f"runs/thesis/trial_{best:02}/best_gait.json"
    assert RECORDED_GAIT.read_bytes() == recorded.read_bytes()
