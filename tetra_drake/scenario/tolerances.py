"""Tolerances: how well the numbers of a robot and its surroundings are known.

A number has a tolerance in its text, such as `838.9 N/m ± 2 %`, or in the section `tolerances`.
Draws of a prediction take other numbers within the tolerances. A fit weighs its parameters by them.
"""

from __future__ import annotations

import re
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field

from tetra_drake.on_demand import loaded
from tetra_drake.settings.quantities import Keyed, different_keys
from tetra_drake.settings.refusals import Tree, joined
from tetra_drake.settings.section import Section, tree_value
from tetra_drake.settings.units import PATTERN, PLUS_MINUS, plain

_SHORT = rf"\s*{PLUS_MINUS}?\s*(.+?)((?:\s+(?:normal|uniform|each))*)\s*"
"""Regular expression of a tolerance as one text, such as "± 2 % uniform each"."""
_WITH_TOLERANCE = re.compile(rf"({PATTERN}){PLUS_MINUS}(.+)")


def _as_mapping(given: Any) -> Any:
    """Mapping with the settings of a tolerance that is given as one text or number."""
    if isinstance(given, int | float) and not isinstance(given, bool):
        return {"size": str(given)}
    match = re.fullmatch(_SHORT, given) if isinstance(given, str) else None
    if match is None:
        return given
    words = match[2].split()
    laws = [word for word in words if word != "each"]
    return {"size": match[1], "each": "each" in words} | ({"law": laws[-1]} if laws else {})


class Tolerance(Section):
    """Tolerance of a number, or of several. A file may also give it as one text, such as `2 %`, `1
    mm uniform` or `2 % each`."""

    size: str
    """Standard deviation of a normal law, or half the width of a uniform one: a share, `2 %`, or a
    quantity, `1 mm`."""
    law: Literal["normal", "uniform"] = "normal"
    """Law of the error."""
    each: bool = False
    """True if each cable, strut or number has an error of its own, as coordinates always have."""
    source: str = "assumed"
    """Where the tolerance is from, such as a data sheet."""


def _also_short(schema: Tree) -> None:
    """Lets the JSON Schema of a tolerance accept a text or a number besides."""
    schema |= {
        "anyOf": [{"$ref": schema.pop("$ref")}, *({"type": kind} for kind in ("string", "number"))]
    }


Tolerances = Annotated[
    Keyed[
        str,
        Annotated[Tolerance, BeforeValidator(_as_mapping), Field(json_schema_extra=_also_short)],
    ],
    AfterValidator(different_keys),
]
"""Tolerances by dotted key. Keys joined by commas have one error in common."""


def split_tolerances(tree: Any) -> Any:
    """Content of a section of a file whose tolerances in texts, such as `509 mm ± 1 mm`, are moved
    into the section `tolerances`."""
    found: dict[str, str] = {}

    def without(value: Any, key: str) -> Any:
        if isinstance(value, dict):
            return {name: without(item, joined(key, str(name))) for name, item in value.items()}
        if isinstance(value, list):
            return [without(item, f"{key}[{place}]") for place, item in enumerate(value)]
        match = _WITH_TOLERANCE.fullmatch(plain(value)) if type(value) is str else None
        if match is None:
            return value
        found[key] = match[match.re.groups]
        return match[1].strip()

    if not isinstance(tree, dict):
        return tree
    kept = {name: tree[name] for name in ("tolerances", "robot") if name in tree}
    tree = without({name: item for name, item in tree.items() if name not in kept}, "") | kept
    given = tree_value(tree.get("tolerances") or {})
    is_mapping = isinstance(given, dict)  # anything else is refused later
    return tree | {"tolerances": given | found} if found and is_mapping else tree


def check_tolerances(section: Any) -> Any:
    """Refuses tolerances that do not fit the numbers of a section, and returns the section."""
    if section.tolerances:
        variates_of = loaded("tetra_drake.lab.predict.variates:variates_of")
        variates_of(section.model_dump(), section.tolerances)
    return section
