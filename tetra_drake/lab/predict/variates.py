"""Independent errors of a robot's numbers, from their tolerances."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from tetra_drake.scenario.tolerances import Tolerance
from tetra_drake.settings.quantities import Quantity, separate
from tetra_drake.settings.refusals import Tree, hint, joined, refuse
from tetra_drake.settings.section import value_at
from tetra_drake.settings.units import quantity_to_si

_LENGTH = re.compile(r"(robot\.|)struts\.([^.]+)\.length")
_PER_CABLE = re.compile(r"((?:robot\.|)cables\.[^.]+)\.(stiffness|damping|free_length|tension)")


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
        share, pairs = deviation(tolerance, value) / value, value_at(tree, f"{match[1]}.pairs")
        return [{f"{match[1]}.factors.{match[2]}[{i}]": share} for i in range(len(pairs))]
    numbers = dict(_numbers(value, key))
    if not numbers:
        hinted = hint(key, dict(_numbers(tree, "")))
        raise ValueError(f"'{key}' is no number of the robot or scenario; {hinted}")
    if len({getattr(number, "unit", "") for number in numbers.values()}) > 1:
        raise ValueError("found numbers with several units, expected a key of numbers of one unit")
    return [
        {name: deviation(tolerance, number, is_signed=name.endswith("]"))}
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
        shifts *= deviation(tolerance, Quantity(length, "m")) / longer
        both = zip(pair, shifts.tolist(), strict=True)
        parts.append({f"{robot}nodes.{n}[{axis}]": x[axis] for n, x in both for axis in range(3)})
    if not parts:
        raise ValueError(f"'{group}' is no group of struts; {hint(group, bars)}")
    return parts


def deviation(tolerance: Tolerance, number: float, *, is_signed: bool = False) -> float:
    """Standard deviation of the error of a number (a Quantity, or a float without unit), in SI.
    Only a number that `is_signed`, such as a coordinate, may be smaller than its tolerance.
    Raises ValueError if the size does not fit the number."""
    unit = getattr(number, "unit", "")
    text = tolerance.size.removesuffix("%")
    is_share = text != tolerance.size
    try:
        size = quantity_to_si(text, unit) if unit and not is_share else float(text)
    except ValueError as error:
        found = error if unit and not is_share else f"found '{tolerance.size}', expected a number"
        raise ValueError(f"{found}, or a share, such as 2 %") from error
    if not 0.0 <= size < math.inf:
        raise ValueError(f"found {tolerance.size}, expected 0 or more")
    is_some, size = size > 0.0, size * abs(number) / 100.0 if is_share else size
    if is_some and size >= abs(number) and (is_share or (number and not is_signed)):
        found = f"found {tolerance.size} of {number if unit else float(number)}"
        raise ValueError(f"{found}, expected a tolerance smaller than the number")
    return size / math.sqrt(3.0) if tolerance.law == "uniform" else size
