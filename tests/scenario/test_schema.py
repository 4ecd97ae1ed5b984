"""The JSON Schemas: they accept what loads, and refuse most of what does not."""

import copy
import json
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from helpers.format_page import EXAMPLE
from jsonschema import Draft202012Validator

from tetra_drake.errors import InputError
from tetra_drake.scenario.keys import schema_text
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.shipped import SCENARIOS, STRUCTURES
from tetra_drake.scenario.structure_files import read_structure
from tetra_drake.scenario.yaml_text import dump_yaml, parse_yaml
from tetra_drake.settings.refusals import TAG

STRUCTURE_FILES, SCENARIO_FILES = (sorted(each.glob("*.yaml")) for each in (STRUCTURES, SCENARIOS))
STRUCTURE_TEXTS = [EXAMPLE, *(file.read_text("utf-8") for file in STRUCTURE_FILES)]
SCENARIO_TEXTS = [file.read_text("utf-8") for file in SCENARIO_FILES]


def validator(*, structure: bool) -> Draft202012Validator:
    schema = json.loads(schema_text(structure=structure))
    kind = "structure" if structure else "scenario"
    assert schema["$id"] == f"urn:tetra-drake:{kind}:format-1.schema.json"
    Draft202012Validator.check_schema(schema)
    return Draft202012Validator(schema)


def without_tags(tree: Any) -> Any:
    if isinstance(tree, dict):
        return {name: without_tags(value) for name, value in tree.items() if name != TAG}
    return [without_tags(item) for item in tree] if isinstance(tree, list) else tree


def places(tree: Any) -> Iterator[tuple[Any, Any]]:
    """Each mapping and list in a tree, with each of its keys or indices."""
    entries = tree.items() if isinstance(tree, dict) else enumerate(tree)
    for key, value in entries:
        if key != TAG:
            yield tree, key
            if isinstance(value, dict | list):
                yield from places(value)


VALUES = [
    None,
    True,
    -1,
    0,
    7,
    2.5,
    "n3",
    "3 kg",
    "-2 m",
    "5 N",
    "5 N/m",
    "1 lbf*s/in",
    [],
    [1],
    {},
]


def damage(tree: Any, draw: random.Random) -> None:
    """Changes one place of a tree: another value, a key or an item more or less."""
    place, key = draw.choice([*places(tree)])
    what = draw.choice(["value", "value", "remove", "rename", "repeat"])
    if what == "remove":
        del place[key]
    elif what == "value":
        place[key] = draw.choice(VALUES)
    elif isinstance(place, list):
        place.append(place[key])
    elif what == "rename":
        place[f"{key}s"] = place.pop(key)
    else:
        place["spare"] = place[key]


@pytest.mark.parametrize("structure", [True, False])
def test_what_a_schema_refuses_does_not_load_and_most_of_the_rest_loads(structure, tmp_path: Path):
    check, file = validator(structure=structure), tmp_path / "mine.yaml"
    texts, load = SCENARIO_TEXTS, load_scenario
    if structure:
        texts, load = STRUCTURE_TEXTS, read_structure
    trees = [parse_yaml(text, "mine.yaml") for text in texts]
    for tree in trees:
        assert [*check.iter_errors(without_tags(tree))] == []

    draw, refused, seen = random.Random(1), 0, 0
    for count in range(250):
        tree = copy.deepcopy(trees[count % len(trees)])
        damage(tree, draw)
        is_seen = not check.is_valid(without_tags(tree))
        file.write_text(dump_yaml(tree))
        try:
            load(file)
        except InputError:
            refused, seen = refused + 1, seen + is_seen
        else:
            assert not is_seen, tree
    assert refused > 100
    assert seen >= 0.6 * refused
