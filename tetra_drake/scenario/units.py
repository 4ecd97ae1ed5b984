"""Units: conversion of texts to SI numbers, and of SI numbers to texts in customary units."""

from __future__ import annotations

import functools
import math
import re

INCH = 0.0254  # m, exact
POUND_FORCE = 4.4482216152605  # N, exact

_READ = {"m": (INCH, "in"), "N": (POUND_FORCE, "lbf"), "rad": (math.pi / 180.0, "deg")}
"""Customary unit of each SI unit: size in SI, and name."""

_SMALL = {
    "m": [(1e-3, "mm"), (1e-2, "cm")],
    "m/s": [(1e-3, "mm/s")],
    "s": [(1e-3, "ms")],
    "kg": [(1e-3, "g")],
    "kg/m^3": [(1e3, "g/cm^3")],
}
"""More units for printed settings, by SI unit: size in SI, and name."""

LARGEST = 1e15
"""Largest size of a number in SI units. Products of several such numbers do not overflow."""

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_FACTOR = r"[A-Za-z]+(?:\s*(?:\^|\*\*)\s*-?\d)?"
_FACTORS = rf"{_FACTOR}(?:(?:\s*[*/]\s*|\s+){_FACTOR})*"
_QUANTITY = re.compile(rf"\s*({_NUMBER})\s*(1?\s*/\s*)?({_FACTORS})\s*")


@functools.lru_cache(maxsize=1000)  # a base is read again for each file
def quantity_to_si(text: str, unit: str) -> float:
    """Reads a quantity such as "25 lbf/in", or "1 /in", as a number in the SI unit `unit` ("N/m").

    Raises ValueError if the text is no quantity, has another dimension, or is beyond 1e15.
    """
    import pint

    example = f"expected a quantity that converts to {unit}"
    match = _QUANTITY.fullmatch(text)
    if match is None:
        raise ValueError(f"found '{text}', which is not a quantity; {example}")
    try:
        given = f"1/{match[3]}" if match[2] else match[3]
        number = float(pint.Quantity(float(match[1]), given).to(unit).magnitude)
    except pint.DimensionalityError as error:
        raise ValueError(f"found '{text}', {example}") from error
    except Exception as error:  # pint raises tokenizer, syntax and type errors of many kinds
        raise ValueError(f"found '{text}', whose unit is unknown; {example}") from error
    if not abs(number) <= LARGEST:
        raise ValueError(f"found '{text}', expected at most {LARGEST:g} {unit}")
    return number


def rounded_in_text(text: str) -> str:
    """Rounds all numbers with many decimals in a text to six digits."""
    return re.sub(r"\d+\.\d{6,}(e[+-]?\d+)?", lambda number: f"{float(number[0]):.6g}", text)


def customary(unit: str) -> tuple[float, str]:
    """Customary unit for an SI unit, such as "lbf/in" for "N/m": its size in SI, and its name. A
    unit with other dimensions than length, force, angle and time is returned as it is."""
    above, _, below = unit.partition("/")
    size = 1.0
    for factors, sign in ((above, 1), (below, -1)):
        for factor in factors.split("*"):
            name, _, power = factor.partition("^")
            if name not in {*_READ, "s", "1", ""}:
                return 1.0, unit
            size *= _READ.get(name, (1.0, ""))[0] ** (sign * int(power or 1))
    name = re.sub(r"[A-Za-z]+", lambda word: _READ.get(word[0], (1.0, word[0]))[1], unit)
    return size, name.removeprefix("1")


def shown(number: float, unit: str) -> str:
    """A number given in an SI unit, as text in the customary unit, such as "25 lbf/in"."""
    size, name = customary(unit)
    return f"{number / size:.4g} {name}".rstrip()


def plainest(number: float, unit: str) -> str:
    """A number given in an SI unit, as text in the unit that needs the fewest digits, such as
    "20 ms"."""
    if number == 0.0:
        return "0"
    candidates = [customary(unit), *_SMALL.get(unit, []), (1.0, unit.removeprefix("1"))]

    def digits(candidate: tuple[float, str]) -> int:
        return sum(letter.isdecimal() for letter in f"{number / candidate[0]:.9g}")

    size, name = min(candidates, key=digits)
    return f"{number / size:.6g} {name}".rstrip()


def shortest(number: float, unit: str) -> str:
    """The text of plainest(), if it reads as exactly the same number; otherwise the exact number in
    SI."""
    exact = f"{number!r} {unit}"
    text = plainest(number, unit)
    return text if " " in text and quantity_to_si(text, unit) == number else exact
