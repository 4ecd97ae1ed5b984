"""Tolerances: how well the numbers of a robot and its surroundings are known.

A number has a tolerance in its text, such as `838.9 N/m ± 2 %`, or in the section `tolerances`.
Draws of a prediction take other numbers within the tolerances. A fit weighs its parameters by them.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal, NamedTuple, Protocol

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field

from tetra_drake.scenario.common_sections import different_keys, separate
from tetra_drake.settings.quantities import Keyed, Quantity
from tetra_drake.settings.refusals import Tree, hint, joined, refuse
from tetra_drake.settings.section import Section, tree_value, value_at
from tetra_drake.settings.units import NUMBER, PATTERN, PLUS_MINUS, quantity_to_si

_SHORT = rf"\s*{PLUS_MINUS}?\s*(.+?)((?:\s+(?:normal|uniform|each))*)\s*"
"""Regular expression of a tolerance as one text, such as "± 2 % uniform each"."""
_WITH_TOLERANCE = re.compile(rf"({PATTERN}){PLUS_MINUS}(.+)")
_LENGTH = re.compile(r"(robot\.|)struts\.([^.]+)\.length")
_PER_CABLE = re.compile(r"((?:robot\.|)cables\.[^.]+)\.(stiffness|damping|free_length|tension)")


def _as_mapping(given: Any) -> Any:
    """Mapping with the settings of a tolerance that is given as one text or number."""
    if isinstance(given, int | float) and not isinstance(given, bool):
        return {"size": f"{float(given)!r}"}
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
        unit = number.unit if isinstance(number, Quantity) else ""
        expected = "a share, such as 2 %" + (f", or a quantity in {unit}" if unit else ", or 0.05")
        match = re.fullmatch(rf"({NUMBER})\s*(%?)", self.size)
        is_share = match is not None and bool(match[2])
        if match is None and not unit:
            raise ValueError(f"found '{self.size}', expected {expected}")
        size = quantity_to_si(self.size, unit) if match is None else float(match[1])
        if unit and match and size and not is_share:
            raise ValueError(f"found {self.size} without a unit, expected {expected}")
        if size < 0.0:
            raise ValueError(f"found {self.size}, expected 0 or more")
        if is_share:
            if size and not number:
                raise ValueError(f"found {self.size} of 0, expected a quantity in {unit or '1'}")
            size *= abs(number) / 100.0
        if number and size >= abs(number) and (is_share or not is_signed):
            what = number if unit else f"{number:g}"
            raise ValueError(f"found {self.size} of {what}, expected less than the number")
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


class HasTolerances(Protocol):
    """Section with the field `tolerances`."""

    @property
    def tolerances(self) -> Mapping[str, Tolerance]: ...

    def model_dump(self) -> Tree: ...


class Variate(NamedTuple):
    """An independent error with mean 0 and variance 1, and the numbers that it moves."""

    tolerance: str
    """Key of its tolerance."""
    law: str
    deviations: Mapping[str, float]
    """Change of each number, in SI, for an error of 1, by dotted key."""

    def errors(self, shares: np.ndarray) -> np.ndarray:
        """Errors whose cumulative probabilities are `shares`."""
        from scipy.stats import norm

        if self.law == "uniform":
            return math.sqrt(3.0) * (2.0 * shares - 1.0)
        return np.asarray(norm.ppf(shares))


def variates_of(tree: Tree, tolerances: Mapping[str, Tolerance]) -> list[Variate]:
    """The independent errors that tolerances of the numbers in a tree give; none for exact numbers.
    Raises InputError, naming the key, for a tolerance that fits no number."""
    found = []
    for key, tolerance in tolerances.items():
        try:
            parts = [part for one in separate(key) for part in _parts(tree, one, tolerance)]
        except ValueError as error:
            refuse(f"tolerances.{key}", getattr(error, "problem", str(error)))
        if not tolerance.each:
            common = {one: size for part, own in parts if not own for one, size in part.items()}
            parts = [(common, False), *((part, own) for part, own in parts if own)]
        moving = [part for part, _ in parts if any(part.values())]
        found += [Variate(key, tolerance.law, part) for part in moving]
    return found


def _parts(tree: Tree, key: str, tolerance: Tolerance) -> list[tuple[dict[str, float], bool]]:
    """Changes of numbers by one standard deviation, by key, for each member of a key: a strut, a
    cable or a number. With each is True if it always has an error of its own."""
    if match := _LENGTH.fullmatch(key):
        return [(part, False) for part in _of_struts(tree, match[1], match[2], tolerance)]
    value = value_at(tree, key)
    match = _PER_CABLE.fullmatch(key)
    if match and tolerance.each and isinstance(value, float):
        share = tolerance.deviation(value) / value if value else 0.0
        pairs = range(len(value_at(tree, f"{match[1]}.pairs")))
        return [({f"{match[1]}.factors.{match[2]}[{i}]": share}, False) for i in pairs]
    numbers = dict(_numbers(value, key))
    if not numbers:
        known = dict(_numbers(tree, ""))
        raise ValueError(f"'{key}' is no number of the robot or scenario; {hint(key, known)}")
    if len({getattr(number, "unit", "") for number, _ in numbers.values()}) > 1:
        raise ValueError("found numbers with several units, expected a key of numbers of one unit")
    return [
        ({name: tolerance.deviation(number, is_signed=in_list)}, in_list)
        for name, (number, in_list) in numbers.items()
    ]


def _numbers(value: Any, key: str, in_list: bool = False) -> Iterator[tuple[str, Any]]:
    """Keys of the numbers in a value, each with the number and whether it is an item of a list."""
    if isinstance(value, float):
        yield key, (value, in_list or key.endswith("]"))
    for name, item in value.items() if isinstance(value, dict) else ():
        yield from _numbers(item, joined(key, name), in_list)
    for place, item in enumerate(value) if isinstance(value, list) else ():
        yield from _numbers(item, f"{key}[{place}]", True)


def _of_struts(
    tree: Tree, robot: str, group: str, tolerance: Tolerance
) -> Iterator[dict[str, float]]:
    """Changes of the coordinates of both ends of each strut of a group that lengthen the strut by
    one standard deviation. `robot` is what stands before keys of the robot in the tree."""
    bars = value_at(tree, f"{robot}struts") or {}
    if group not in bars:
        raise ValueError(f"'{group}' is no group of struts; {hint(group, bars)}")
    ends = [node for bar in bars.values() for pair in bar["pairs"] for node in pair]
    for pair in bars[group]["pairs"]:
        if shared := [node for node in pair if ends.count(node) > 1]:
            expected = "expected struts that share no node, or tolerances of nodes"
            raise ValueError(f"found '{shared[0]}' on several struts, {expected}")
        start, end = (np.array(value_at(tree, f"{robot}nodes.{node}")) for node in pair)
        length = float(np.linalg.norm(end - start))
        half = 0.5 * tolerance.deviation(Quantity(length, "m")) * (end - start) / length
        signed = {pair[0]: -half, pair[1]: half}
        yield {
            f"{robot}nodes.{node}[{axis}]": change
            for node, shift in signed.items()
            for axis, change in enumerate(shift.tolist())
        }


def split_tolerances(tree: Any) -> Any:
    """Content of a section of a file in which tolerances that stand in texts, such as `509 mm ± 1
    mm`, are in the section `tolerances`."""
    found: dict[str, str] = {}

    def without(value: Any, key: str) -> Any:
        if isinstance(value, dict):
            return {name: without(item, joined(key, str(name))) for name, item in value.items()}
        if isinstance(value, list):
            return [without(item, f"{key}[{place}]") for place, item in enumerate(value)]
        match = _WITH_TOLERANCE.fullmatch(value) if type(value) is str else None
        if match is None:
            return value
        found[key] = match[match.re.groups]
        return match[1].strip()

    if not isinstance(tree, dict):
        return tree
    kept = {name: tree[name] for name in ("tolerances", "robot") if name in tree}
    tree = without({name: item for name, item in tree.items() if name not in kept}, "") | kept
    return (
        tree | {"tolerances": (tree_value(tree.get("tolerances")) or {}) | found} if found else tree
    )


def check_tolerances(section: HasTolerances) -> Any:
    """Refuses tolerances that do not fit the numbers of a section, and returns the section."""
    if section.tolerances:
        variates_of(section.model_dump(), section.tolerances)
    return section
