"""Units: conversion of texts to SI numbers, and of SI numbers to texts in units for people.

Each scenario has its own units, see Scenario.units. shown_in() replaces them.
"""

from __future__ import annotations

import contextlib
import functools
import math
import re
import unicodedata
from collections.abc import Iterator
from contextvars import ContextVar
from dataclasses import dataclass

from tetra_drake.errors import InputError

INCH = 0.0254  # m, exact
POUND_FORCE = 4.4482216152605  # N, exact


@dataclass(frozen=True)
class Units:
    """Units of length and force for printed numbers. Angles are shown in degrees, other numbers in
    SI."""

    length: float
    """Size of the unit of length in m."""
    length_name: str
    length_word: str
    """Name of the unit of length in a sentence, such as "inches"."""
    square: float
    """Side of a square on the floor of a replay, in m."""
    squares: int
    """Number of squares between two dark lines of the floor."""
    force: float = 1.0
    """Size of the unit of force in N."""
    force_name: str = "N"

    @property
    def decimals(self) -> int:
        """Digits after the decimal point of a distance in a sentence: 0 in mm, 1 in cm or inches, 3
        in m, so that about 1 mm is visible. Tables and figures have one more."""
        return round(math.log10(self.length / 0.001))

    def of(self, unit: str) -> tuple[float, str]:
        """Unit that replaces an SI unit, such as "lbf/in" for "N/m": its size in SI, and its name.

        A unit with other dimensions than length, force, angle and time is returned as it is, with
        the size 1. So is a unit that contains N, if the unit of force is N.
        """
        names = {"m": self.length_name, "N": self.force_name, "rad": "deg", "s": "s"}
        words = re.findall("[A-Za-z]+", unit)
        if not words or not names.keys() >= set(words) or (self.force == 1.0 and "N" in words):
            return 1.0, unit
        name = re.sub("[A-Za-z]+", lambda word: names[word[0]], unit).removeprefix("1")
        return quantity_to_si(f"1 {name}", unit), name

    def shown(self, number: float, unit: str) -> str:
        """A number given in an SI unit, as text in these units, such as "25 lbf/in"."""
        size, name = self.of(unit)
        return f"{number / size:.4g} {name}".rstrip()


INCHES = Units(INCH, "in", "inches", INCH, 6, POUND_FORCE, "lbf")

SYSTEMS = {
    "cm": Units(0.01, "cm", "cm", 0.02, 5),
    "mm": Units(0.001, "mm", "mm", 0.02, 5),
    "SI": Units(1.0, "m", "m", 0.1, 10),
    "in": INCHES,
}
"""Units for printed numbers, by the names that the option `--units` takes."""

_chosen: ContextVar[Units | None] = ContextVar("units", default=None)


@contextlib.contextmanager
def shown_in(name: str | None) -> Iterator[None]:
    """Context manager that shows all numbers in the units called `name`, a key of SYSTEMS. Without
    a name, each scenario keeps its own. Raises InputError for another name."""
    if name and name not in SYSTEMS:
        raise InputError("units", "", f"found '{name}', expected one of {', '.join(SYSTEMS)}")
    token = _chosen.set(SYSTEMS[name] if name else _chosen.get())
    try:
        yield
    finally:
        _chosen.reset(token)


def chosen_units() -> str:
    """The name of the units that shown_in() has chosen; "" without a choice."""
    return next((name for name, units in SYSTEMS.items() if units is _chosen.get()), "")


def current(own: Units) -> Units:
    """The units that shown_in() has chosen; without a choice, `own`."""
    return _chosen.get() or own


@functools.lru_cache(maxsize=1000)
def fitting(lengths: tuple[float, ...]) -> Units:
    """The units of SYSTEMS that show lengths (m) with the fewest digits. Lengths below a quarter of
    the longest do not count. If the lengths are round in no unit, such as in a robot whose nodes
    were rotated, the unit is cm."""
    least = _LONG * max(map(abs, lengths), default=0.0)
    long = [abs(length) for length in lengths if abs(length) >= least]
    return min(
        SYSTEMS.values(),
        key=lambda units: sum(min(_MANY, _digits(length / units.length)) for length in long),
    )


_MANY = 6
"""A number with this many digits or more is not round."""
_LONG = 0.25
"""Least length, as a share of the greatest, that counts in fitting(). Diameters are often in mm
where lengths are in cm."""


def _digits(number: float) -> int:
    """Number of digits in the text of a number, which is rounded to nine significant digits."""
    return sum(letter.isdecimal() for letter in f"{number:.9g}")


_SMALL = {
    "m": [(1e-3, "mm"), (1e-2, "cm")],
    "m/s": [(1e-3, "mm/s")],
    "s": [(1e-3, "ms")],
    "kg": [(1e-3, "g")],
    "kg/m^3": [(1e3, "g/cm^3")],
}
"""Further units for printed settings, by SI unit: size in SI, and name."""

LARGEST = 1e15
"""Largest size of a number in SI units. Products of several such numbers do not overflow."""

NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_FACTOR = r"[A-Za-z]+(?:\s*(?:\^|\*\*)\s*-?\d)?"
_FACTORS = rf"{_FACTOR}(?:(?:\s*[*/]\s*|\s+){_FACTOR})*"
PATTERN = rf"\s*({NUMBER})\s*(1?\s*/\s*)?({_FACTORS})\s*"
"""Regular expression of a quantity: groups of its number, a "1 /" before its unit, and its unit."""
PLUS_MINUS = r"(?:±|\+/-)"
"""Regular expression of what stands between a quantity and its tolerance."""
OTHER_SIGNS = r"^\s*[-+−\d.].*[^\x00-\x7F]"
"""Regular expression of texts that are perhaps quantities by plain()."""

_SIGNS = str.maketrans("·⋅∙×−∕⁄μ", "****-//u") | {ord("°"): "deg", ord("Å"): "angstrom"}
_AMBIGUOUS = {"gr": "g or grain", "ton": "t (1000 kg) or 2000 lb", "cwt": "100 lb or 112 lb"}
_AMBIGUOUS |= {"mil": "thou, mm or mrad", "pond": "gf or lbf", "grade?": "deg or gon"}
_AMBIGUOUS |= {"Ns": "N or N*s", "lbfs": "lbf or lbf*s"}
"""What names may mean that Pint reads, but not as many people do; without prefix and plural."""


def plain(text: str) -> str:
    """A quantity in ASCII, such as "1.5e3 N*m^-1" for "1.5×10³ N·m⁻¹"."""
    powers = unicodedata.normalize("NFKC", re.sub("[⁺⁻]?[⁰¹²³⁴-⁹]+", r"^\g<0>", text))
    return re.sub(r"\s*[×·⋅]\s*10(\^|\*\*)", "e", powers).translate(_SIGNS)


@functools.lru_cache(maxsize=1000)  # a base is read again for each file
def quantity_to_si(text: str, unit: str) -> float:
    """Reads a quantity such as "25 lbf/in", or "1 /in", as a number in the SI unit `unit` ("N/m").

    Raises ValueError if the text is no quantity, has another dimension (angle is one), is beyond
    1e15, or has a name of a unit with two meanings.
    """
    import pint

    example = f"expected a quantity that converts to {unit}"
    match = re.fullmatch(PATTERN, plain(text))
    if match is None:
        raise ValueError(f"found '{text}', which is not a quantity; {example}")
    for name, meant in _AMBIGUOUS.items():
        if unclear := re.search(rf"\b[kmMu]?{name}s?\b", match[3]):
            raise ValueError(f"found '{text}', expected {meant} in place of {unclear[0]}")
    try:
        given = f"1/{match[3]}" if match[2] else match[3]
        found = pint.Quantity(float(match[1]), given)
        if not (found / pint.Quantity(1.0, unit)).unitless:  # angles are units without dimension
            raise pint.DimensionalityError(found.units, unit)
        number = float(found.to(unit).magnitude)
    except pint.DimensionalityError as error:
        raise ValueError(f"found '{text}', {example}") from error
    except Exception as error:  # pint raises tokenizer, syntax and type errors of many kinds
        raise ValueError(f"found '{text}', whose unit is unknown; {example}") from error
    if not abs(number) <= LARGEST:
        raise ValueError(f"found '{text}', expected at most {LARGEST:g} {unit}")
    return number


def given_quantity(text: str, unit: str, source: object, key: str) -> float:
    """Reads a quantity like quantity_to_si(), but raises InputError that names `source`, such as a
    file, and the `key` of the quantity there."""
    try:
        return quantity_to_si(text, unit)
    except ValueError as error:
        raise InputError(source, key, str(error)) from error


def plainest(number: float, unit: str) -> str:
    """Text of an SI number in the SI, metric or inch unit that needs the fewest digits, such as "20
    ms". Six significant digits are kept."""
    if number == 0.0:
        return "0"
    candidates = [INCHES.of(unit), *_SMALL.get(unit, []), (1.0, unit.removeprefix("1"))]
    size, name = min(candidates, key=lambda candidate: _digits(number / candidate[0]))
    return f"{number / size:.6g} {name}".rstrip()


def shortest(number: float, unit: str) -> str:
    """Text of plainest() if quantity_to_si() reads it as exactly the same number. Otherwise the
    number with all digits, in the SI unit."""
    exact = f"{number!r} {unit}"
    text = plainest(number, unit)
    return text if " " in text and quantity_to_si(text, unit) == number else exact
