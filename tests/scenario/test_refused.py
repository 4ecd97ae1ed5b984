"""Scenarios, structures and their changes that are refused, with the key and what was found."""

import functools
import shutil
from pathlib import Path

import pytest
import yaml
from helpers.anchored import HUNG, SWINGING, scenario_of
from helpers.files import DATA, SMALL, structure_of

from tetra_drake.errors import InputError
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.structure_files import read_structure

ROWS = yaml.safe_load(Path(__file__).with_name("refused.yaml").read_text("utf-8"))
ANCHORED = {"hung": HUNG, "held": SWINGING | {"anchors": {"a": "z", "b": "z"}}}


def rows(what):
    """A case for each row: what is changed, how, the key and the words."""
    cases = [(base, *row) for base, several in ROWS[what].items() for row in several]
    return pytest.mark.parametrize(("base", "changes", "key", "words"), [
        pytest.param(base, changes, key, words, id=f"{base}: {key}")
        for base, changes, key, *words in cases
    ])  # fmt: skip


@functools.cache
def scenario_named(name):
    return scenario_of(ANCHORED[name]) if name in ANCHORED else load_scenario(name)


@pytest.fixture
def folder(tmp_path):
    """A folder with a scenario, guyed.yaml, and a structure, own.yaml."""
    shutil.copy(DATA / "scenarios/guyed.yaml", tmp_path)
    (tmp_path / "own.yaml").write_text(SMALL)
    return tmp_path


@rows("structures")
def test_of_a_structure(base, changes, key, words, refused):
    with refused("my.yaml", key, *words):
        structure_of(base, changes)


@rows("scenarios")
def test_of_changes(base, changes, key, words, refused):
    scenario = scenario_named(base)
    with refused(f"scenario {scenario.name}", key, *words):
        scenario.with_changes(changes)


@rows("files")
def test_of_a_file(base, changes, key, words, folder, refused):
    file = folder / "mine.yaml"
    file.write_text(changes if base == "alone" else f"base: {base}\n{changes}\n")
    with refused(file, key, *words):
        load_scenario(file)


def test_depths_without_end(folder, refused):
    bomb = "- &b0 [1]\n" + "\n".join(f"- &b{i} [{f'*b{i - 1}, ' * 9}]" for i in range(1, 13))
    for text, fact in (("[" * 1000, "YAML"), (bomb, "aliases")):  # a list of 9^12 numbers
        (folder / "deep.yaml").write_text(text)
        with refused(folder / "deep.yaml", "", fact):
            load_scenario(folder / "deep.yaml")


@rows("structure files")
def test_of_the_file_of_a_structure(base, changes, key, words, folder, refused):
    own, mine = folder / "own.yaml", folder / "mine.yaml"
    own.write_text(SMALL.replace(*changes))
    text = "robot: !Structure {file: own.yaml, cables: {side: {stiffness: 1 N/m}}}"
    mine.write_text(f"base: {base}\nobjective: {{speed: 1 s/m}}\n{text}\n")
    with refused(own, key, *words):
        load_scenario(mine)


@pytest.mark.parametrize("found", ["2", "'1'", "1.0", "true", "null"])
@pytest.mark.parametrize("read", [load_scenario, read_structure])
def test_another_format_is_the_first_thing_refused(found, read, folder, refused):
    (folder / "new.yaml").write_text(f"format: {found}\nbase: prism\nnodes: {{}}\nshapes: {{}}\n")
    with refused(folder / "new.yaml", "format", "expected 1"):
        read(folder / "new.yaml")


def test_a_fault_names_the_file_that_has_it(folder, refused):
    low, top = folder / "low.yaml", folder / "top.yaml"
    low.write_text("base: thesis\nsimulation: {duration: 3 kg}\n")
    top.write_text("base: low.yaml\nsimulation: {steady_from: 5 s}\n")
    with refused(low, "simulation.duration", "'3 kg'"):
        load_scenario(top)
    low.write_text("base: thesis\nsimulation: {duration: 4 s}\n")
    with refused(top, "simulation.steady_from", "4.0 s", "null"):  # of both together
        load_scenario(top)
    top.write_text(f"base: ../{folder.name}/top.yaml")
    with refused(f"{folder}/../{folder.name}/top.yaml", "base", "itself"):
        load_scenario(top)


def test_what_is_no_text_file_and_no_structure(folder, refused):
    (folder / "binary.yaml").write_bytes(b"\x89PNG\r\n\x1a\n\x00\xff")
    (folder / "large.yaml").write_text("#" * (2**20 + 1))
    for name in ("missing.yaml", "binary.yaml", "large.yaml", "/dev/zero", "nul\0", "a" * 300):
        with refused(folder / name, "", ""):
            load_scenario(folder / name)


def test_nothing_is_shown_of_a_file_that_is_something_else(folder):
    """Texts that YAML takes for a text, a mapping, a list, tags and more, in all three places."""
    names = ["base: any", "base: thesis\nrobot: !Structure {file: any}"]
    names.append("base: thesis\nterrain: !HeightField {file: any, cell: 1 m}")
    for content in [*ROWS["private"], "root:$6$secret" + 120 * "x"]:  # NumPy does not quote it
        (folder / "any").write_text(content)
        for text in names:
            (folder / "mine.yaml").write_text(text)
            with pytest.raises(InputError) as caught:
                load_scenario(folder / "mine.yaml")
            assert "secret" not in str(caught.value)
            assert str(folder / "any") in str(caught.value)
