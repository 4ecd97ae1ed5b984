"""The page of all keys."""

import json
import re

from tetra_drake.cli import main
from tetra_drake.errors import InputError
from tetra_drake.scenario.keys import PAGE, keys_page, schema_text
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.metrics import METRICS
from tetra_drake.scenario.shipped import SCENARIOS, STRUCTURES
from tetra_drake.settings.refusals import TAG, members_of


def test_the_page_and_the_schemas_are_as_the_kinds_say(capsys):
    advice = "write them: python -m tetra_drake.scenario.keys"
    assert PAGE.read_text(encoding="utf-8") == keys_page(), advice
    for folder, options in ((SCENARIOS, []), (STRUCTURES, ["--structure"])):
        assert main(["schema", *options]) == 0
        schema = folder / "schema.json"
        assert schema.read_text(encoding="utf-8") == capsys.readouterr().out, advice
        for file in folder.glob("*.yaml"):
            assert file.read_text("utf-8").startswith("# yaml-language-server: $schema=schema.json")


def test_an_editor_knows_units_defaults_tags_and_keys_that_files_alone_have():
    schema = json.loads(schema_text())
    assert "base" in schema["properties"]
    spacing = schema["$defs"]["Tetrahedra"]["properties"]["spacing"]
    accepted = [t for t in ("3 in", "balanced", "3", "in") if re.match(spacing["pattern"], t)]
    assert (accepted, spacing["unit"], spacing["minimum"]) == (["3 in", "balanced"], "m", 0)
    assert schema["$defs"]["Mujoco"]["properties"]["step"]["default"] == "6.25e-05 s"
    tags: list[str] = []
    for key, node in schema["properties"].items():
        for kind in (kind["title"] for kind in members_of(node, schema) if "title" in kind):
            tags += [f"{kind} mapping", *([] if needs_keys(key, kind) else [f"{kind} scalar:null"])]
    settings = json.loads((SCENARIOS / "vscode.json").read_text(encoding="utf-8"))
    assert settings == {"yaml.customTags": list(dict.fromkeys(tags))}


def needs_keys(section: str, kind: str) -> bool:
    """True if a kind cannot be written as its tag alone."""
    try:
        load_scenario("prism").with_changes({section: kind})
    except InputError as error:
        return "is missing" in error.problem
    return False


def test_each_key_and_each_metric_is_explained():
    rows = dict(re.findall(r"^- `([^`]+)` \(.*?\): (.*)$", keys_page(), re.M))
    for key in load_scenario("robust").values():
        if TAG not in key and not key.startswith(("objective", "disturbances.spreads")):
            assert key in rows, key
    assert METRICS.keys() <= rows.keys()
    assert [key for key, text in rows.items() if not text] == []
