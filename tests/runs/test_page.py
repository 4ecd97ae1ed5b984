"""Pages are made from their records, by a renderer that misses no number."""

import functools
import shutil
import tempfile
from pathlib import Path

import bench
import damage
import measured
import oscillators
import page
import paper
import planning
import planning_page
import published
import pytest
import thesis_page
from helpers.recorded import recorded_run
from records import read

from tetra_drake.files import read_json


def planned():
    with tempfile.TemporaryDirectory() as folder:
        shutil.copy(planning.HERE / planning.RECORDS, folder)
        planning_page.write_page(Path(folder), planning.all_episodes())
        return (Path(folder) / "README.md").read_text("utf-8")


def of_oscillators():
    return oscillators.page(oscillators.numbers(read(oscillators.HERE / oscillators.RECORDS)))


rows = functools.cache(measured.measured_rows)
scores = functools.cache(lambda: read(bench.HERE / bench.RECORDS))
DAMAGE = damage.WALKS, damage.PLANS, damage.CANDIDATES
NUMBERS = measured.HERE / measured.NUMBERS, published.OUT / "numbers.json", thesis_page.NUMBERS
OF_ROBOTS, OF_ENGINES, OF_THESIS = (read_json(file, "") for file in NUMBERS)
PAGES = {
    "bench/README.md": lambda: bench.page(scores()),
    "bench/scores.csv": lambda: bench.intervals(scores()),
    "damage/README.md": lambda: damage.page(*map(damage.read, DAMAGE)),
    "measured/intervals.csv": lambda: measured.table(rows()["known"]),
    "measured/README.md": lambda: measured.page(OF_ROBOTS, rows()),
    "oscillators/README.md": of_oscillators,
    "paper/paper.md": paper.paper,
    "planning/README.md": planned,
    "published/README.md": lambda: page.rendered("published.md", starts=OF_ENGINES),
    "thesis/THESIS.md": lambda: thesis_page.page(recorded_run("thesis"), OF_THESIS),
}
"""What makes each page, by its place in runs/."""


@pytest.mark.parametrize("name", PAGES)
def test_a_page_shows_its_records(name):
    assert PAGES[name]() == (page.TEMPLATES.parent / name).read_text("utf-8")


def test_a_number_that_is_not_given_is_refused(tmp_path, monkeypatch, refused):
    monkeypatch.setattr(page, "TEMPLATES", tmp_path)
    monkeypatch.setattr(page, "_environment", page._environment.__wrapped__)
    (tmp_path / "one.md.jinja").write_text("{{ x }}")
    with refused(tmp_path / "one.md.jinja", "", "'x' is undefined"):
        page.rendered("one.md")
