"""Types of quantities: SI numbers that files give as texts with units.

A field `stiffness: Stiffness = Field(gt=0)` reads "25 lbf/in" as a number in N/m. Items of lists
and mappings may have such types, too.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from typing import Annotated, Any, TypeVar

import pydantic
from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    PlainSerializer,
    ValidationInfo,
    WrapValidator,
)
from pydantic_core import CoreSchema, core_schema

from tetra_drake.errors import InputError
from tetra_drake.settings.refusals import described
from tetra_drake.settings.units import OTHER_SIGNS, PATTERN, PLUS_MINUS, plainest, quantity_to_si


class Quantity(float):
    """SI number that carries its unit. model_dump() of a section gives quantities in this form."""

    unit: str

    def __new__(cls, number: float, unit: str) -> Quantity:
        made = super().__new__(cls, number)
        made.unit = unit
        return made

    def __getnewargs__(self) -> tuple[float, str]:  # type: ignore[override]
        return float(self), self.unit

    def __str__(self) -> str:
        return plainest(self, self.unit)


def quantity(unit: str, **words: float) -> tuple[Any, ...]:
    """Annotations that make `float` the type of a quantity in an SI unit, for pydantic, such as
    Annotated[float, *quantity("N/m")].

    Texts such as "25 lbf/in" are converted. `words` are further texts that stand for numbers, such
    as balanced=0. In a file, numbers without a unit are refused, except 0. From Python they are
    accepted, in SI.
    """
    expected = f"expected a quantity that converts to {unit}"

    def read(value: Any, info: ValidationInfo) -> Any:
        if isinstance(value, Quantity):
            return float(value)
        if isinstance(value, str):
            return words[value] if value in words else quantity_to_si(value, unit)
        if info.context and type(value) in (int, float) and value != 0:
            raise ValueError(f"found {described(value)} without a unit, {expected}")
        return value

    schema: dict[str, Any] = {
        "type": ["string", "number"],
        "pattern": f"^({'|'.join((*words, PATTERN))})({PLUS_MINUS}.+)?$|{OTHER_SIGNS}",
        "patternErrorMessage": expected,
        "if": {"type": "number"},
        "then": {"const": 0, "errorMessage": expected},
        "unit": unit,
    }
    write = PlainSerializer(lambda number: Quantity(number, unit))
    return BeforeValidator(read), write, Field(json_schema_extra=schema)


Length = Annotated[float, *quantity("m")]
Angle = Annotated[float, *quantity("rad")]
Mass = Annotated[float, *quantity("kg")]
InertiaQuantity = Annotated[float, *quantity("kg*m^2")]
Density = Annotated[float, *quantity("kg/m^3")]
Time = Annotated[float, *quantity("s")]
Frequency = Annotated[float, *quantity("Hz")]
InverseTime = Annotated[float, *quantity("1/s")]
Speed = Annotated[float, *quantity("m/s")]
InverseSpeed = Annotated[float, *quantity("s/m")]
Acceleration = Annotated[float, *quantity("m/s^2")]
ForceQuantity = Annotated[float, *quantity("N")]
Torque = Annotated[float, *quantity("N*m")]
Stiffness = Annotated[float, *quantity("N/m")]
Damping = Annotated[float, *quantity("N*s/m")]
DampingPerLength = Annotated[float, *quantity("N*s/m^2")]

TWO, THREE = Field(min_length=2, max_length=2), Field(min_length=3, max_length=3)
"""Annotations of lists with two or three items."""

Position = Annotated[list[Length], THREE]
"""Coordinates x, y and z."""


def _ascending(pair: list[float]) -> list[float]:
    low, high = pair
    if low > high:
        raise ValueError(f"found {low:g} to {high:g}, expected the least value first")
    return pair


PAIR = TWO, AfterValidator(_ascending)
"""Annotations of a list with a least and a greatest value."""

EMPTY: dict[str, Any] = {"type": ["object", "null"]}
"""JSON Schema of a mapping that may be left empty in a file."""

Key = TypeVar("Key")
Value = TypeVar("Value")

Keyed = Annotated[
    dict[Key, Value],
    BeforeValidator(lambda given: {} if given is None else given),
    Field(json_schema_extra=EMPTY),
]
"""Mapping whose keys the user chooses. In a file it may be left empty."""


def by_name(
    units: Mapping[str, str], value: Callable[[Any], Any] = lambda number: number
) -> tuple[Any, ...]:
    """Annotations for a mapping from known names, such as metrics, to numbers with units.

    `units` has the SI unit of each name, or "" for a number without a unit. By default each value
    is a number. Otherwise `value` turns the type of the number into the type of the value, such as
    a list of numbers.
    """
    numbers = {
        name: Annotated[float, *quantity(unit)] if unit else float for name, unit in units.items()
    }

    def table(_: Any, handler: pydantic.GetCoreSchemaHandler) -> CoreSchema:
        fields = {
            name: core_schema.typed_dict_field(
                handler.generate_schema(value(number)), required=False
            )
            for name, number in numbers.items()
        }
        strict = core_schema.CoreConfig(strict=True, allow_inf_nan=False)
        return core_schema.typed_dict_schema(fields, extra_behavior="forbid", config=strict)

    def in_order(given: Any, read: pydantic.ValidatorFunctionWrapHandler) -> Any:
        values = read({} if given is None else given)
        return {name: values[name] for name in given or ()}

    return (
        pydantic.GetPydanticSchema(table),
        WrapValidator(in_order),
        Field(json_schema_extra=EMPTY),
    )


def separate(joined: str) -> list[str]:
    """Splits a key that joins scenario keys by commas: "cpg.gain, robot.density" gives two keys."""
    return [key.strip() for key in joined.split(",")]


def different_keys(by_joined: Mapping[str, Value], *, source: str = "") -> Mapping[str, Value]:
    """Checks a mapping whose keys may each name several scenario keys, such as "a.b, c.d", and
    returns it. Raises InputError, naming `source`, if a scenario key occurs twice."""
    counts = Counter(key for joined in by_joined for key in separate(joined))
    for key, count in counts.items():
        if count > 1:
            raise InputError(source, key, "is given twice")
    return by_joined
