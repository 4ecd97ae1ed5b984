"""Values of every type and tagged kinds: checked, built, written and merged.

(The annotations below are read as types, so they are not postponed.)
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from tetra_drake.scenario.fields import (
    Check,
    dump_yaml,
    merge,
    parse_yaml,
    quantity,
    setting,
    tree_of,
    tree_of_changes,
)


@dataclass
class Flat:
    """A kind without fields."""


@dataclass
class Incline:
    slope: float = quantity("rad", at_least=0, at_most=4)
    surface: str = setting(choices=("rough", "smooth"), default="rough")


@dataclass
class Cells:
    cells: list[float] = quantity("m", above=0)
    grid: list[list[float]] = setting(default=[], length=2)


@dataclass
class Probe:
    at: list[float] = quantity("m", length=3)
    active: bool = setting(default=True)


@dataclass(kw_only=True)
class Settings:
    count: int = setting(at_least=2)
    name: str = setting(default="")
    size: float = quantity("m", default=1.0, choices=("automatic",))
    terrain: Flat | Incline | Cells = setting(default=Flat())
    weights: dict[str, float] = setting(default={"distance": 1.0})
    limits: dict[str, float] = quantity("N", default={})
    probes: list[Probe] = setting(default=[])
    ramps: list[Incline | Flat] = setting(default=[])
    probe: Probe | None = setting(default=None)
    inner: Incline


def load(text: str) -> Settings:
    base = parse_yaml("{count: 2, inner: {slope: 0 rad}}", "file")
    tree = Check("file").value(Settings, merge(base, parse_yaml(f"{{{text} }}", "file")))
    return Check("file", complete=True).value(Settings, tree)


def shown(settings: Settings) -> str:
    return dump_yaml(tree_of(settings, "{!r} {}".format, sparse=True))


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
    ("size: automatic", "size", "automatic"),
    ("", "terrain", Flat()),
]


@pytest.mark.parametrize(("text", "name", "value"), GOOD, ids=[row[0] or "-" for row in GOOD])
def test_values_of_every_type_load_and_dump_back(text, name, value):
    settings = load(text)
    assert repr(getattr(settings, name)) == repr(value)  # so that 1 is not 1.0
    assert Check("dump", complete=True).value(Settings, parse_yaml(shown(settings), "")) == settings


def test_defaults_and_missing_fields_are_not_shared_or_dumped():
    settings = load("")
    settings.weights["twist"] = 1.0
    assert load("").weights == {"distance": 1.0}
    assert parse_yaml(shown(load("")), "file") == {"count": 2, "inner": {"slope": "0.0 rad"}}


def test_the_first_kind_is_dumped_without_a_tag():
    settings = load("ramps: [!Flat , !Incline {slope: 1 rad}], terrain: !Incline {slope: 1 rad}")
    assert [line for line in shown(settings).splitlines() if "!" in line] == [
        "terrain: !Incline",
        "- !Flat {}",
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
    ("terrain: !Cells {cells: [], grid: [[1, 2], [1]]}", "terrain.grid[1]", "1 items"),
    ("terrain: !Cells {cells: [], grid: [[1, a]]}", "terrain.grid[0][1]", "'a'"),
    ("weights: {twist: ten}", "weights.twist", "'ten'"),
    ("weights: [1]", "weights", "a list"),
    ("weights: {1: 1}", "weights", "a mapping"),
    ("limits: {a: 1}", "limits.a", "1 without a unit"),
    ("probes: [{at: [0 m, 0 m, 0 m]}, {active: true}]", "probes[1].at", "missing"),
    ("ramps: [!Cells {}]", "ramps[0]", "!Cells"),
    ("probe: {at: [0 m]}", "probe.at", "1 items"),
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
        ({"terrain": Cells(cells=[1.0])}, "terrain", Cells(cells=[1.0])),
        ({"terrain.slope": "0.2 rad"}, "terrain", Incline(slope=0.2)),
        ({"terrain": {"_tag": "!Incline", "slope": "180 deg"}}, "terrain", Incline(slope=np.pi)),
        ({"ramps": (Flat(), Incline(slope=1))}, "ramps", [Flat(), Incline(slope=1.0)]),
        ({"probe": Probe(at=np.array([1, 2, 3]))}, "probe", Probe(at=[1.0, 2.0, 3.0])),
        ({"count": np.int64(3)}, "count", 3),
        ({"weights.twist": 2}, "weights", {"distance": 1.0, "twist": 2.0}),
    ],
)
def test_values_may_be_changed_from_python(changes, name, value):
    inclined = load("terrain: !Incline {slope: 1 rad}")
    base = tree_of(inclined)
    given = Check("changes").value(Settings, tree_of_changes(changes, base, "changes"))
    changed = Check("changes", complete=True).value(Settings, merge(base, given))
    assert getattr(changed, name) == value
    assert inclined.terrain == Incline(slope=1.0)
