"""Values of every type and tagged kinds: checked, built, written and merged."""

from typing import Annotated, Any, Literal

import numpy as np
import pytest
from pydantic import Field, ValidationError

from tetra_drake.scenario.sections import (
    Kinds,
    Section,
    merge,
    quantity,
    tree_of,
    tree_of_changes,
)
from tetra_drake.scenario.yaml_text import dump_yaml, parse_yaml


class Flat(Section):
    """A kind without fields."""


class Incline(Section):
    slope: float = quantity("rad", ge=0, le=4)
    surface: Literal["rough", "smooth"] = "rough"


Pair = Annotated[list[float], Field(min_length=2, max_length=2)]


class Cells(Section):
    cells: list[Annotated[float, Field(gt=0)]] = quantity("m")
    grid: list[Pair] = Field(default=[])


class Probe(Section):
    at: list[float] = quantity("m", min_length=3, max_length=3)
    active: bool = True


class Settings(Section):
    count: int = Field(ge=2)
    name: str = ""
    size: float = quantity("m", default=1.0, words={"automatic": 2.5})
    terrain: Annotated[Flat | Incline | Cells, Kinds()] = Flat()
    weights: dict[str, float] = Field(default={"distance": 1.0})
    limits: dict[str, float] = quantity("N", default={})
    probes: list[Probe] = Field(default=[])
    ramps: list[Annotated[Incline | Flat, Kinds()]] = Field(default=[])
    probe: Probe | None = None
    inner: Incline


def load(text: str) -> Settings:
    base = parse_yaml("{count: 2, inner: {slope: 0 rad}}", "file")
    return Settings.from_tree(merge(base, parse_yaml(f"{{{text} }}", "file")), "file")


def shown(settings: Settings) -> str:
    return dump_yaml(tree_of(settings))


GOOD: list[tuple[str, str, Any]] = [
    ("terrain: !Flat {}", "terrain", Flat()),
    ("terrain: !Incline {slope: 180 deg}", "terrain", Incline(slope=np.pi, surface="rough")),
    (
        "terrain: !Cells {cells: [1 m, 50 cm], grid: [[1, 2], [3e-1, 4]]}",
        "terrain",
        Cells(cells=[1.0, 0.5], grid=[[1.0, 2.0], [0.3, 4.0]]),
    ),
    ("weights: {twist: -10, drift: 1e-3}", "weights", {"twist": -10.0, "drift": 1e-3}),
    ("limits: {a: 1 kN}", "limits", {"a": 1000.0}),
    ("probes: [{at: [0 m, 1 m, 2 m]}]", "probes", [Probe(at=[0.0, 1.0, 2.0])]),
    ("ramps: [!Flat , !Incline {slope: 1 rad}]", "ramps", [Flat(), Incline(slope=1.0)]),
    ("ramps: [{slope: 1 rad}]", "ramps", [Incline(slope=1.0)]),  # without a tag, the first kind
    ("terrain: {}", "terrain", Flat()),
    ("probe: {at: [0 m, 0 m, 0 m], active: false}", "probe", Probe(at=[0.0] * 3, active=False)),
    ("probe:", "probe", None),
    ("inner: {slope: 4 rad}", "inner", Incline(slope=4.0)),
    ("size: automatic", "size", 2.5),
    ("", "terrain", Flat()),
]


@pytest.mark.parametrize(("text", "name", "value"), GOOD, ids=[row[0] or "-" for row in GOOD])
def test_values_of_every_type_load_and_dump_back(text, name, value):
    settings = load(text)
    assert repr(getattr(settings, name)) == repr(value)  # so that 1 is not 1.0
    assert Settings.from_tree(parse_yaml(shown(settings), ""), "dump") == settings


def test_defaults_are_neither_shared_nor_dumped():
    settings = load("")
    settings.weights["twist"] = 1.0
    assert load("").weights == {"distance": 1.0}
    assert parse_yaml(shown(load("")), "file") == {"count": 2, "inner": {"slope": "0.0 rad"}}


def test_values_cannot_be_changed_in_place():
    with pytest.raises(ValidationError):
        load("").count = 3


def test_kinds_are_dumped_with_their_tags_and_all_their_values():
    settings = load("ramps: [!Flat , !Incline {slope: 1 rad}], terrain: !Incline {slope: 1 rad}")
    assert [line for line in shown(settings).splitlines() if "!" in line] == [
        "terrain: !Incline",
        "- !Flat {}",
        "- !Incline",
    ]


BAD = [
    ("terrain: !Flat 5", "", "!Flat"),
    ("terrain: !Flat {a: 1, a: 2}", "", "'a'"),
    ("cont: 3", "cont", "'count'"),
    ("1: 2", "1", "unknown key"),
    ("inner: 5", "inner", "5"),
    ("inner: !Inner {}", "inner", "!Inner"),
    ("inner: {slope: 5 rad}", "inner.slope", "'5 rad', expected at most 4 rad"),
    ("inner: {slope: 3 degz}", "inner.slope", "'3 degz'"),
    ("inner: {surface: wet}", "inner.surface", "'wet'"),
    ("count: 4.5", "count", "4.5"),
    ("count: true", "count", "true"),
    ("probe: {at: [0 m, 0 m, 0 m], active: 1}", "probe.active", "1"),
    ("size: manual", "size", "'manual'"),
    ("size: 1e999 m", "size", "'1e999 m'"),
    ("size: .nan", "size", "nan"),
    ("weights: {twist: 1" + "0" * 400 + "}", "weights.twist", "1000"),
    ("terrain: !Inclin {slope: 1 rad}", "terrain", "'!Incline'"),
    ("terrain: {slope: 1 rad}", "terrain", "a mapping"),
    ("terrain: {slop: 1 rad}", "terrain.slop", "none"),
    ("ramps: [{slop: 1 rad}]", "ramps[0].slop", "'slope'"),
    ("terrain:", "terrain", "nothing"),
    ("terrain: !Incline {}", "terrain.slope", "missing"),
    ("terrain: !Cells {cells: [1 m, 1 m, 1 m, one]}", "terrain.cells[3]", "'one'"),
    ("terrain: !Cells {cells: 1 m}", "terrain.cells", "'1 m'"),
    ("terrain: !Cells {cells: [], grid: [[1, 2], [1]]}", "terrain.grid[1]", "2 items"),
    ("terrain: !Cells {cells: [], grid: [[1, a]]}", "terrain.grid[0][1]", "'a'"),
    ("weights: {twist: ten}", "weights.twist", "'ten'"),
    ("weights: [1]", "weights", "a list"),
    ("weights: {1: 1}", "weights[1]", "string"),
    ("limits: {a: 1}", "limits.a", "1 without a unit"),
    ("probes: [{at: [0 m, 0 m, 0 m]}, {active: true}]", "probes[1].at", "missing"),
    ("ramps: [!Cells {}]", "ramps[0]", "!Cells"),
    ("probe: {at: [0 m]}", "probe.at", "3 items"),
]


@pytest.mark.parametrize(("text", "key", "found"), BAD, ids=[row[0][:40] for row in BAD])
def test_errors_name_the_key_and_what_was_found(text, key, found, refused):
    with refused("file", key, found):
        load(text)


@pytest.mark.parametrize(
    ("base", "changes", "result"),
    [
        ("a: {b: 1, c: 2}", "a: {c: 3}", "a: {b: 1, c: 3}"),
        ("a: [1, 2]", "a: [3]", "a: [3]"),
        ("a: !X {b: 1}", "a: !X {c: 2}", "a: !X {b: 1, c: 2}"),
        ("a: !X {b: 1}", "a: !Y {c: 2}", "a: !Y {c: 2}"),
        ("a: {b: 1}", "a: null", "a: null"),
        ("a: 1", "b: !X", "a: 1, b: !X"),
    ],
)
def test_a_file_is_merged_with_its_base(base, changes, result):
    trees = [parse_yaml(f"{{{text} }}", "file") for text in (base, changes, result)]
    assert merge(trees[0], trees[1]) == trees[2]


@pytest.mark.parametrize(
    ("changes", "name", "value"),
    [
        ({"terrain": Flat()}, "terrain", Flat()),
        ({"terrain": "!Flat"}, "terrain", Flat()),
        ({"terrain": Cells(cells=[1.0])}, "terrain", Cells(cells=[1.0])),
        ({"terrain.slope": "0.2 rad"}, "terrain", Incline(slope=0.2)),
        ({"terrain": {"slope": "180 deg"}}, "terrain", Incline(slope=np.pi)),
        ({"ramps": (Flat(), Incline(slope=1))}, "ramps", [Flat(), Incline(slope=1.0)]),
        ({"probe": Probe(at=np.array([1, 2, 3]))}, "probe", Probe(at=[1.0, 2.0, 3.0])),
        ({"count": np.int64(3)}, "count", 3),
        ({"limits.b": "2 N"}, "limits", {"a": 1.0, "b": 2.0}),
    ],
)
def test_values_may_be_changed_from_python(changes, name, value):
    inclined = load("terrain: !Incline {slope: 1 rad}, limits: {a: 1 N}")
    given = tree_of_changes(changes, "changes")
    changed = Settings.from_tree(merge(tree_of(inclined), given), "changes")
    assert getattr(changed, name) == value
    assert inclined.terrain == Incline(slope=1.0)
