"""Values of every type and tagged kinds: checked, built, written and merged."""

from pathlib import Path
from typing import Annotated, Any, Literal

import pytest
import yaml
from pydantic import Field

from tetra_drake.scenario.changes import merged
from tetra_drake.scenario.yaml_text import dump_yaml, parse_yaml
from tetra_drake.settings.quantities import Angle, Keyed, Length, by_name
from tetra_drake.settings.section import Kinds, Section, written


class Flat(Section):
    """A kind without fields."""


class Incline(Section):
    slope: Angle = Field(le=4)
    surface: Literal["rough", "smooth"] = "rough"


class Cells(Section):
    cells: list[Annotated[Length, Field(gt=0)]]


class Probe(Section):
    at: list[Length] = Field(min_length=3, max_length=3)
    active: bool = True


class Settings(Section):
    count: int = Field(ge=2)
    terrain: Annotated[Flat | Incline | Cells, Kinds()] = Flat()
    limits: Annotated[dict[str, float], *by_name({"a": "N", "share": ""})] = Field(default={})
    ramps: list[Annotated[Incline | Flat, Kinds()]] = Field(default=[])
    probe: Probe | None = None
    groups: Keyed[str, Keyed[str, int]] = Field(default={})
    free: Keyed[str, Any] = Field(default={})
    inner: Incline


def load(text: str) -> Settings:
    base = parse_yaml("{count: 2, inner: {slope: 0 rad}}", "file")
    return Settings.from_tree(merged(base, parse_yaml(f"{{{text} }}", "file")), "file")


ROWS = yaml.safe_load(Path(__file__).with_name("section.yaml").read_text("utf-8"))


@pytest.mark.parametrize(("text", "name", "value"), ROWS["good"])
def test_values_of_every_type_load_and_dump_back(text, name, value):
    settings = load(text)
    tree = written(settings.model_dump())
    assert repr(tree[name]) == repr(value)  # so that 1 is not 1.0
    assert Settings.from_tree(parse_yaml(dump_yaml(tree), ""), "dump") == settings


def test_a_section_from_python_is_checked_and_does_not_change(refused):
    with refused("Settings", "cont", "'count'"):
        Settings(cont=3)
    with refused("Probe", "at[1]", "'1 s'"):
        Probe(at=[0, "1 s", 0])
    with refused("Settings", "count", "with_changes()"):
        load("").count = 3


@pytest.mark.parametrize(("text", "key", "found"), ROWS["bad"])
def test_errors_name_the_key_and_what_was_found(text, key, found, refused):
    with refused("file", key, found):
        load(text)


NUMBERS = {"010": 10, "0o10": 8, "-.43": -0.43, "+.5": 0.5, "1e-3": 0.001, "0x1F": 31}
TEXTS = ["1:30", "yes", "on", "off", "1_1", "1_000.5", "2001-01-01", "0b11", "="]


def test_numbers_and_texts_are_read_as_in_yaml_1_2():
    for text, number in NUMBERS.items():
        assert repr(parse_yaml(text, "file")) == repr(number)
    tabbed = ",\t".join(TEXTS)  # tabs may separate tokens, but not indent
    assert parse_yaml(f"[\t{tabbed}\n\t]\t# all", "file") == TEXTS


def test_what_is_written_is_read_alike_by_readers_of_yaml_1_1_and_1_2():
    texts = [*NUMBERS, *TEXTS, "<<", "null", "true", ""]
    tree = {text: [text, 1e-05, 1e16, 10, True, None] for text in texts}
    dumped = dump_yaml(tree)
    assert parse_yaml(dumped, "file") == yaml.safe_load(dumped) == tree
