"""Text with units to SI numbers, and the two units shown to people: inches and pounds-force."""

from __future__ import annotations

import re

INCH = 0.0254  # m, exact
POUND_FORCE = 4.4482216152605  # N, exact

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_FACTOR = r"[A-Za-z]+(?:\s*(?:\^|\*\*)\s*-?\d)?"
_FACTORS = rf"{_FACTOR}(?:(?:\s*[*/]\s*|\s+){_FACTOR})*"
_QUANTITY = re.compile(rf"\s*({_NUMBER})\s*(1?\s*/\s*)?({_FACTORS})\s*")


def quantity_to_si(text: str, unit: str) -> float:
    """Reads a quantity such as "25 lbf/in", or "1 /in", as a number in the SI unit `unit` ("N/m").

    Raises ValueError if the text is no quantity, or has another dimension.
    """
    import pint

    example = f"expected a quantity that converts to {unit}"
    match = _QUANTITY.fullmatch(text)
    if match is None:
        raise ValueError(f"found '{text}', which is not a quantity; {example}")
    try:
        given = f"1/{match[3]}" if match[2] else match[3]
        return float(pint.Quantity(float(match[1]), given).to(unit).magnitude)
    except pint.DimensionalityError as error:
        raise ValueError(f"found '{text}', {example}") from error
    except Exception as error:  # pint raises tokenizer, syntax and type errors of many kinds
        raise ValueError(f"found '{text}', whose unit is unknown; {example}") from error
