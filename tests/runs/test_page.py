"""Pages are made from their records, by a renderer that misses no number."""

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


def planned(folder):
    (folder / planning.RECORDS).symlink_to(planning.HERE / planning.RECORDS)
    planning_page.write_page(folder, planning.all_episodes())
    return (folder / "README.md").read_text("utf-8")


def of_oscillators():
    return oscillators.page(oscillators.numbers(read(oscillators.HERE / oscillators.RECORDS)))


PAGES = {
    "bench/README.md": lambda _: bench.page(read(bench.HERE / bench.RECORDS)),
    "bench/scores.csv": lambda _: bench.intervals(read(bench.HERE / bench.RECORDS)),
    "damage/README.md": lambda _: damage.page(
        *map(damage.read, (damage.WALKS, damage.PLANS, damage.CANDIDATES))
    ),
    "measured/intervals.csv": lambda _: measured.table(measured.measured_rows()["known"]),
    "measured/README.md": lambda _: measured.page(
        read_json(measured.HERE / measured.NUMBERS, ""), measured.measured_rows()
    ),
    "oscillators/README.md": lambda _: of_oscillators(),
    "paper/paper.md": lambda _: paper.paper(),
    "planning/README.md": planned,
    "published/README.md": lambda _: page.rendered(
        "published.md", starts=read_json(published.OUT / "numbers.json", "")
    ),
    "thesis/THESIS.md": lambda _: thesis_page.page(
        recorded_run("thesis"), read_json(thesis_page.NUMBERS, "")
    ),
}


@pytest.mark.parametrize("name", PAGES)
def test_a_page_shows_its_records(name, tmp_path):
    assert PAGES[name](tmp_path) == (thesis_page.HERE / name).read_text("utf-8")


def test_a_number_that_is_not_given_is_refused(tmp_path, monkeypatch, refused):
    monkeypatch.setattr(page, "TEMPLATES", tmp_path)
    monkeypatch.setattr(page, "_environment", page._environment.__wrapped__)
    (tmp_path / "one.md.jinja").write_text("{{ x }}")
    with refused(tmp_path / "one.md.jinja", "", "'x' is undefined"):
        page.rendered("one.md")
