"""The JSON Schemas: they accept what loads, and refuse most of what does not."""

import copy
import json
import random
from pathlib import Path
from typing import Any

import pytest
from helpers.files import CRANE
from jsonschema import Draft202012Validator

from tetra_drake.errors import InputError
from tetra_drake.scenario.keys import schema_text
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.shipped import SCENARIOS, STRUCTURES
from tetra_drake.scenario.structure_files import read_structure
from tetra_drake.scenario.yaml_text import dump_yaml, parse_yaml
from tetra_drake.settings.refusals import TAG
from tetra_drake.settings.section import parts_in

STRUCTURE_TEXTS, SCENARIO_TEXTS = (
    [file.read_text("utf-8") for file in sorted(each.glob("*.yaml"))]
    for each in (STRUCTURES, SCENARIOS)
)
LOADED: dict[str, Any] = {
    "structure": ([CRANE, *STRUCTURE_TEXTS], read_structure),
    "scenario": (SCENARIO_TEXTS, load_scenario),
}


def without_tags(tree: Any) -> Any:
    if isinstance(tree, dict):
        return {name: without_tags(value) for name, value in tree.items() if name != TAG}
    return [without_tags(item) for item in tree] if isinstance(tree, list) else tree


VALUES = [None, True, -1, 0, 7, 2.5, [], [1], {}]
VALUES += ["n3", "3 kg", "-2 m", "5 N", "5 N/m", "1 lbf*s/in"]


def damage(tree: Any, draw: random.Random) -> None:
    """Changes one place of a tree: another value, a key or an item more or less."""
    parts = (part for part in parts_in(tree) if isinstance(part, dict | list))
    places = [
        (part, key)
        for part in parts
        for key in (part if isinstance(part, dict) else range(len(part)))
    ]
    place, key = draw.choice([(part, key) for part, key in places if key != TAG])
    what = draw.choice(["value", "value", "remove", "repeat"])
    if what == "remove":
        del place[key]
    elif what == "value":
        place[key] = draw.choice(VALUES)
    elif isinstance(place, list):
        place.append(place[key])
    else:
        place["spare"] = place[key]


@pytest.mark.parametrize("draws", [50, pytest.param(250, marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", LOADED)
def test_a_schema_refuses_most_of_what_does_not_load(kind: str, draws: int, tmp_path: Path) -> None:
    texts, load = LOADED[kind]
    schema = json.loads(schema_text(structure=kind == "structure"))
    assert schema["$id"] == f"urn:tetra-drake:{kind}:format-1.schema.json"
    Draft202012Validator.check_schema(schema)
    check, file = Draft202012Validator(schema), tmp_path / "mine.yaml"
    trees = [parse_yaml(text, "mine.yaml") for text in texts]
    for tree in trees:
        assert [*check.iter_errors(without_tags(tree))] == []

    draw, refused, seen = random.Random(1), 0, 0
    for count in range(draws):
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
    assert refused > 0.4 * draws
    assert seen >= 0.6 * refused
