"""Tolerances: how well the numbers of a robot and its surroundings are known.

A number has a tolerance in its text, such as `838.9 N/m ± 2 %`, or in the section `tolerances`.
Draws of a prediction take other numbers within the tolerances. A fit weighs its parameters by them.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field

from tetra_drake.scenario.common_sections import different_keys, separate
from tetra_drake.settings.quantities import Keyed, Quantity
from tetra_drake.settings.refusals import Tree, hint, joined, refuse
from tetra_drake.settings.section import Section, tree_value, value_at
from tetra_drake.settings.units import PATTERN, PLUS_MINUS, plain, quantity_to_si

_SHORT = rf"\s*{PLUS_MINUS}?\s*(.+?)((?:\s+(?:normal|uniform|each))*)\s*"
"""Regular expression of a tolerance as one text, such as "± 2 % uniform each"."""
_WITH_TOLERANCE = re.compile(rf"({PATTERN}){PLUS_MINUS}(.+)")
_LENGTH = re.compile(r"(robot\.|)struts\.([^.]+)\.length")
_PER_CABLE = re.compile(r"((?:robot\.|)cables\.[^.]+)\.(stiffness|damping|free_length|tension)")


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
    """Standard deviation of a normal law, or half the width of a uniform one: a share of the
    number, such as `2 %`, or a quantity, such as `1 mm`. 0 for an exact number."""
    law: Literal["normal", "uniform"] = "normal"
    """Law of the error."""
    each: bool = False
    """True if each cable, strut or number has an error of its own, as from machining. Otherwise all
    numbers of the key have one error in common, as a number of a supplier. Coordinates always have
    errors of their own."""
    source: str = "assumed"
    """Where the tolerance is from, such as a paper or a data sheet."""

    def deviation(self, number: float, *, is_signed: bool = False) -> float:
        """Standard deviation of the error of a number (a Quantity, or a float without unit), in SI.
        Only a number that `is_signed`, such as a coordinate, may be smaller than its tolerance.
        Raises ValueError if the size does not fit the number."""
        unit = getattr(number, "unit", "")
        text = self.size.removesuffix("%")
        is_share = text != self.size
        try:
            size = quantity_to_si(text, unit) if unit and not is_share else float(text)
        except ValueError as error:
            found = error if unit and not is_share else f"found '{self.size}', expected a number"
            raise ValueError(f"{found}, or a share, such as 2 %") from error
        if not 0.0 <= size < math.inf:
            raise ValueError(f"found {self.size}, expected 0 or more")
        is_some, size = size > 0.0, size * abs(number) / 100.0 if is_share else size
        if is_some and size >= abs(number) and (is_share or (number and not is_signed)):
            found = f"found {self.size} of {number if unit else float(number)}"
            raise ValueError(f"{found}, expected a tolerance smaller than the number")
        return size / math.sqrt(3.0) if self.law == "uniform" else size


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


class Variate(NamedTuple):
    """An independent error with mean 0 and variance 1, and the numbers that it moves."""

    tolerance: str
    """Key of its tolerance."""
    law: str
    deviations: Mapping[str, float]
    """Change of each number, in SI, for an error of 1, by dotted key."""

    def errors(self, shares: np.ndarray) -> np.ndarray:
        """Errors whose cumulative probabilities are `shares`."""
        from scipy.special import ndtri

        if self.law == "uniform":
            return math.sqrt(3.0) * (2.0 * shares - 1.0)
        return np.asarray(ndtri(shares))


def variates_of(tree: Tree, tolerances: Mapping[str, Tolerance]) -> list[Variate]:
    """The independent errors that tolerances of the numbers in a tree give; none for exact numbers.
    Raises InputError, naming the key, for a tolerance that fits no number."""
    found = []
    for key, tolerance in tolerances.items():
        try:
            parts = [part for one in separate(key) for part in _parts(tree, one, tolerance)]
        except ValueError as error:
            refuse(f"tolerances.{key}", str(error))
        if not tolerance.each:
            own = [part for part in parts if len(part) == 1 and str(*part).endswith("]")]
            common = [part for part in parts if part not in own]
            parts = [dict(itertools.chain(*(part.items() for part in common))), *own]
        found += [Variate(key, tolerance.law, part) for part in parts if any(part.values())]
    return found


def _parts(tree: Tree, key: str, tolerance: Tolerance) -> list[dict[str, float]]:
    """Changes of numbers by one standard deviation, by key, for each member of a key: a strut, a
    cable or a number. Raises ValueError for a key or a size that fits no number."""
    if match := _LENGTH.fullmatch(key):
        return _of_struts(tree, match[1], match[2], tolerance)
    value = value_at(tree, key)
    match = _PER_CABLE.fullmatch(key)
    if match and tolerance.each and value:
        share, pairs = tolerance.deviation(value) / value, value_at(tree, f"{match[1]}.pairs")
        return [{f"{match[1]}.factors.{match[2]}[{i}]": share} for i in range(len(pairs))]
    numbers = dict(_numbers(value, key))
    if not numbers:
        hinted = hint(key, dict(_numbers(tree, "")))
        raise ValueError(f"'{key}' is no number of the robot or scenario; {hinted}")
    if len({getattr(number, "unit", "") for number in numbers.values()}) > 1:
        raise ValueError("found numbers with several units, expected a key of numbers of one unit")
    return [
        {name: tolerance.deviation(number, is_signed=name.endswith("]"))}
        for name, number in numbers.items()
    ]


def _numbers(value: Any, key: str) -> Iterator[tuple[str, float]]:
    """Keys and numbers in a value, whose key is `key`."""
    if isinstance(value, float):
        yield key, value
    for name, item in value.items() if isinstance(value, dict) else ():
        yield from _numbers(item, joined(key, name))
    for place, item in enumerate(value) if isinstance(value, list) else ():
        yield from _numbers(item, f"{key}[{place}]")


def _of_struts(tree: Tree, robot: str, group: str, tolerance: Tolerance) -> list[dict[str, float]]:
    """Changes of the coordinates of both ends of each strut of a group that lengthen the strut by
    one standard deviation; nothing moves along an axis of an anchor. `robot` stands before the keys
    of the robot in the tree."""
    bars, held = (value_at(tree, f"{robot}{key}") or {} for key in ("struts", "anchors"))
    ends = [node for bar in bars.values() for pair in bar["pairs"] for node in pair]
    parts = []
    for pair in bars[group]["pairs"] if group in bars else ():
        if max(map(ends.count, pair)) > 1:
            raise ValueError(f"found struts that share {' or '.join(pair)}, expected the key nodes")
        start, end = (np.array(value_at(tree, f"{robot}nodes.{node}")) for node in pair)
        length = float(np.linalg.norm(end - start))
        free = [[axis not in held.get(node, "") for axis in "xyz"] for node in pair]
        shifts = np.outer([-1.0, 1.0], (end - start) / length) * free
        longer = float((shifts**2).sum())
        if longer < 1e-4:  # the ends can move across the strut only, to within half a degree
            raise ValueError(f"found anchors of {' and '.join(pair)}, expected the key nodes")
        shifts *= tolerance.deviation(Quantity(length, "m")) / longer
        both = zip(pair, shifts.tolist(), strict=True)
        parts.append({f"{robot}nodes.{n}[{axis}]": x[axis] for n, x in both for axis in range(3)})
    if not parts:
        raise ValueError(f"'{group}' is no group of struts; {hint(group, bars)}")
    return parts


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
        variates_of(section.model_dump(), section.tolerances)
    return section
