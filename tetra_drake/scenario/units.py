"""Text with units to SI numbers, and the two units shown to people: inches and pounds-force."""

from __future__ import annotations

import functools
import math
import re
from typing import Any

INCH = 0.0254
"""Metres in an inch (exact)."""

POUND_FORCE = 4.4482216152605
"""Newtons in a pound-force (exact)."""


_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_FACTOR = r"[A-Za-z]+(?:\s*(?:\^|\*\*)\s*-?\d)?"
_QUANTITY = re.compile(
    rf"\s*(?P<number>{_NUMBER})\s*(?P<unit>{_FACTOR}(?:(?:\s*[*/]\s*|\s+){_FACTOR})*)\s*"
)


@functools.cache
def _registry() -> Any:
    import pint

    return pint.UnitRegistry()


def quantity_to_si(text: str, unit: str) -> float:
    """Reads a quantity such as "25 lbf/in" as a number in the SI unit `unit` ("N/m").

    Raises ValueError, with a sentence that fits after "found ...", if the text
    is not a quantity, has the wrong dimension, or is not finite.
    """
    import pint

    example = f"expected a quantity that converts to {unit}"
    match = _QUANTITY.fullmatch(text)
    if match is None:
        raise ValueError(f"found '{text}', which is not a quantity; {example}")
    try:
        quantity = _registry().Quantity(float(match["number"]), match["unit"])
        value = float(quantity.to(unit).magnitude)
    except pint.DimensionalityError as error:
        raise ValueError(f"found '{text}', {example}") from error
    except Exception as error:  # pint raises tokenizer, syntax and type errors of many kinds
        raise ValueError(f"found '{text}', whose unit is unknown; {example}") from error
    if not math.isfinite(value):
        raise ValueError(f"found '{text}', {example} and is finite")
    return value
