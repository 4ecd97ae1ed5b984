"""JSON Schemas of scenario files and structure files, and the page of all keys made from them.

`python -m tetra_drake.scenario.keys` writes all three. Kinds of plug-ins that are installed are
among the others.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable

from tetra_drake.formatting import listed, render
from tetra_drake.scenario.metrics import METRICS, Metrics
from tetra_drake.scenario.robot_structure import StructureFile
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.scenario.shipped import SCENARIOS, STRUCTURES
from tetra_drake.scenario.yaml_text import FORMAT
from tetra_drake.settings.refusals import Tree, keys_in, members_of
from tetra_drake.settings.section import attribute_docstrings, parts_in
from tetra_drake.settings.units import plainest

PAGE = SCENARIOS / "KEYS.md"

_WORDS = {"string": "text", "boolean": "true or false"}
_LIMITS = {
    "exclusiveMinimum": "> {}",
    "minimum": "≥ {}",
    "exclusiveMaximum": "< {}",
    "maximum": "≤ {}",
}


def schema_text(*, structure: bool = False) -> str:
    """JSON Schema of scenario files, or of structure files, for editors and other tools.

    A quantity is a text with a pattern; its key `unit`, an addition to JSON Schema, has its SI
    unit. The `title` of a section that has kinds is the kind's YAML tag, such as !Coulomb.
    The schema is of draft 2020-12 of JSON Schema.
    """
    what = "structure" if structure else "scenario"
    schema: Tree = {"$id": f"urn:tetra-drake:{what}:format-{FORMAT}.schema.json"}
    schema |= (StructureFile if structure else Scenario).model_json_schema()
    schema["properties"].pop("file", None)  # a scenario's key, which names the structure's file
    sections = [id(section) for section in (schema, *schema.get("$defs", {}).values())]
    for node in parts_in({} if structure else schema):
        if isinstance(node, dict):
            node.pop("required", None)  # a base may have the keys
            own = {} if id(node) in sections else node.get("properties", {})
            for value in (node.get("additionalProperties") or {}, *own.values()):
                if "null" not in (kinds := value.get("type", "null")):  # null removes a name
                    value["type"] = [*([kinds] if isinstance(kinds, str) else kinds), "null"]
    return json.dumps(schema, indent=1, ensure_ascii=False) + "\n"


def keys_page() -> str:
    """Page of all keys of scenario files in Markdown, with unit, limits, default and meaning."""
    schema, sections, others = Scenario.model_json_schema(), [], []
    for key, node in schema["properties"].items():
        items, told = node.get("items"), dict[str, tuple[str, str, str]]()
        kinds = [one for one in members_of(items or node, schema) if "$ref" in one]
        inner = f"{key}[0]" if items else key
        for kind in kinds:
            rows = [row for row in keys_in(kind, schema, inner) if "description" in row[1]]
            sections.append((inner, kind, _list_of_keys(rows, told, kind.get("title", ""))))
        others += [] if kinds else [(key, node)]
    return render(
        "scenario/KEYS.md.jinja",
        sections=sections,
        others=_list_of_keys(others, {}, ""),
        about=Metrics.__doc__,
        metrics=METRICS,
        texts=attribute_docstrings(Metrics),
    )


def _list_of_keys(
    rows: Iterable[tuple[str, Tree]], told: dict[str, tuple[str, str, str]], kind: str
) -> str:
    """Keys of a kind of a section as a list. `told` has the kind and the key that told a name with
    the same text first, and its default there. The text is not told again, nor an equal default."""
    lines, again, whole = [], dict[str, list[str]](), list[str]()
    for key, node in rows:
        if any(key.startswith(f"{mapping}.") for mapping in whole):
            continue
        default = json.dumps(node["default"]).replace('"', "") if "default" in node else ""
        if default in ("null", "[]", "{}"):
            default = "optional"
        elif default:
            default = f"default {default}" if "unit" in node else f"default `{default}`"
        says_type = default and node.get("type") == "boolean"
        value, text = _value(node), " ".join(node["description"].split())
        name = key.rpartition(".")[2]
        other, first, usual = told.setdefault(f"{name} {value} {text}", (kind, key, default))
        if (other, first) == (kind, key):
            about = filter(None, ["" if says_type else value, default])
            lines.append(f"- `{key}` ({'; '.join(about)}): {text}")
            continue
        differs = f" ({default})" if default != usual else ""
        source = other if first == key else first.rpartition(".")[0]
        again.setdefault(source, []).append(f"`{key}`{differs}")
        whole += [key] if first == key and value == "mapping" else []
    lines += [f"- {listed(keys)}: as for `{source}`" for source, keys in again.items()]
    return "\n".join(lines)


def _value(node: Tree) -> str:
    """Text about the values that a part of the JSON Schema allows, with unit and limits."""
    if "anyOf" in node:
        return " or ".join(_value(part) for part in node["anyOf"] if part != {"type": "null"})
    if "properties" in node:
        return "by reading" if "rates" in node["properties"] else "by metric"
    if "$ref" in node:
        return "mapping"
    if "additionalProperties" in node:
        return _value(node["additionalProperties"])
    unit = node.get("unit", "")
    words = unit or node.get("format") or _WORDS.get(str(node.get("type")), str(node.get("type")))
    if "items" in node:
        item = _value(node["items"])
        item = f"({item})" if re.search(r"[,×<>≤≥]| or | to ", item) else item
        if "minItems" in node and node["minItems"] == node.get("maxItems"):
            return f"{node['minItems']} × {item}"
        words = f"list of {item}"
    if "enum" in node or "const" in node:
        words = ", ".join(f"`{member}`" for member in node.get("enum", [node.get("const")]))
    limits = [text.format(plainest(node[n], unit)) for n, text in _LIMITS.items() if n in node]
    if {"minimum", "maximum"} <= node.keys():
        limits = [f"{plainest(node['minimum'], unit)} to {plainest(node['maximum'], unit)}"]
    return ", ".join(filter(None, ["" if limits and words == "number" else words, *limits]))


if __name__ == "__main__":
    PAGE.write_text(keys_page(), encoding="utf-8")
    for folder in (SCENARIOS, STRUCTURES):
        text = schema_text(structure=folder == STRUCTURES)
        (folder / "schema.json").write_text(text, encoding="utf-8")
