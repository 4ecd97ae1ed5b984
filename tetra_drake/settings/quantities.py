"""Quantities: numbers in SI; their type gives the unit. In files they are texts with units.

A field `stiffness: Stiffness = Field(gt=0)` reads "25 lbf/in" as a number in N/m. Items of lists
and mappings may have such types, too.
"""

from __future__ import annotations

import typing
from collections.abc import Callable, Mapping
from typing import Annotated, Any, TypeVar

from pydantic import BeforeValidator, Field, PlainSerializer, ValidationInfo
from pydantic.fields import FieldInfo

from tetra_drake.settings.refusals import described, hint, refuse
from tetra_drake.settings.units import PATTERN, plainest, quantity_to_si


class Quantity(float):
    """A number in the tree of a scenario, with its SI unit."""

    unit: str

    def __new__(cls, number: float, unit: str) -> Quantity:
        made = super().__new__(cls, number)
        made.unit = unit
        return made

    def __str__(self) -> str:
        return plainest(self, self.unit)


def quantity(unit: str, **words: float) -> tuple[Any, ...]:
    """Annotations of a type of numbers with an SI unit. In a file, each of `words` stands for a
    number."""

    def read(value: Any, info: ValidationInfo) -> Any:
        is_word = isinstance(value, str) and value in words
        return words[value] if is_word else _si_number(value, unit, info)

    def write(number: float) -> Any:
        return Quantity(number, unit)

    schema = Field(json_schema_extra=_text_schema(unit, *words))
    return BeforeValidator(read), PlainSerializer(write), schema


def _text_schema(unit: str, *words: str) -> dict[str, Any]:
    """JSON Schema of a quantity in a file: a text, or the number 0."""
    expected = f"Expected a quantity that converts to {unit}."
    return {
        "type": ["string", "number"],
        "pattern": f"^({'|'.join((*words, PATTERN))})$",
        "patternErrorMessage": expected,
        "if": {"type": "number"},
        "then": {"const": 0, "errorMessage": expected},
        "unit": unit,
    }


Length = Annotated[float, *quantity("m")]
Angle = Annotated[float, *quantity("rad")]
Mass = Annotated[float, *quantity("kg")]
Density = Annotated[float, *quantity("kg/m^3")]
Time = Annotated[float, *quantity("s")]
Frequency = Annotated[float, *quantity("Hz")]
Speed = Annotated[float, *quantity("m/s")]
InverseSpeed = Annotated[float, *quantity("s/m")]
Acceleration = Annotated[float, *quantity("m/s^2")]
ForceQuantity = Annotated[float, *quantity("N")]
Stiffness = Annotated[float, *quantity("N/m")]
Damping = Annotated[float, *quantity("N*s/m")]
DampingPerLength = Annotated[float, *quantity("N*s/m^2")]

Position = Annotated[list[Length], Field(min_length=3, max_length=3)]
"""Coordinates x, y and z."""

EMPTY = {"type": ["object", "null"]}
"""JSON Schema of a mapping that may be left empty in a file."""

Key = TypeVar("Key")
Value = TypeVar("Value")

Keyed = Annotated[
    dict[Key, Value],
    BeforeValidator(lambda given: {} if given is None else given),
    Field(json_schema_extra=EMPTY),
]
"""A mapping with names of the user's choice. Nothing is an empty mapping."""


def by_name(units: Mapping[str, str]) -> tuple[Any, ...]:
    """Annotations of a type of mappings of numbers, or of lists of numbers, with SI units by name;
    "" for a number without a unit."""

    def read(given: Any, info: ValidationInfo) -> Any:
        if not isinstance(given, dict):
            return {} if given is None else given
        for name in given:
            if name not in units:
                refuse(str(name), f"unknown name; {hint(name, units)}")
        return _each(given, lambda x, name: _si_number(x, units[name], info, key=name))

    def write(numbers: dict[str, Any]) -> Any:
        return _each(numbers, lambda x, name: Quantity(x, units[name]))

    def describe(schema: dict[str, Any]) -> None:
        value = schema["additionalProperties"]
        texts = {name: _text_schema(unit) if unit else {} for name, unit in units.items()}
        if "items" in value:
            texts = {name: {"items": value["items"] | text} for name, text in texts.items()}
        properties = {name: value | text for name, text in texts.items()}
        schema |= EMPTY | {"properties": properties, "additionalProperties": False}

    return BeforeValidator(read), PlainSerializer(write), Field(json_schema_extra=describe)


def _each(given: dict[str, Any], change: Callable[[Any, str], Any]) -> dict[str, Any]:
    """A mapping with change(number, name) in place of each number. Values are numbers or lists."""
    return {
        name: [change(x, name) for x in value] if isinstance(value, list) else change(value, name)
        for name, value in given.items()
    }


def _si_number(value: Any, unit: str, info: ValidationInfo, *, key: str = "") -> Any:
    """The SI number of a quantity. Other values are returned as they are, for pydantic's errors.

    In a validation with a context (for a file), numbers without a unit are refused, except 0.
    """
    if isinstance(value, Quantity):
        return float(value)
    if isinstance(value, str) and unit:
        try:
            return quantity_to_si(value, unit)
        except ValueError as error:
            refuse(key, str(error))
    if info.context and unit and type(value) in (int, float) and value != 0:
        expected = f"expected a quantity that converts to {unit}"
        refuse(key, f"found {described(value)} without a unit, {expected}")
    return value


def unit_of(field: FieldInfo) -> str:
    """Unit of the numbers of a field; "" if they have none."""
    parts = [field, field.annotation]
    for part in parts:
        extra = getattr(part, "json_schema_extra", None)
        if isinstance(extra, dict) and "unit" in extra:
            return str(extra["unit"])
        parts += typing.get_args(part)
    return ""
