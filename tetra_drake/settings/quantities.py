"""Quantities: numbers in SI; their type gives the unit. In files they are texts with units.

A field `stiffness: Stiffness = Field(gt=0)` reads "25 lbf/in" as a number in N/m. Items of lists
and mappings may have such types, too.
"""

from __future__ import annotations

import typing
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import pydantic
from pydantic import Field, ValidationInfo
from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema, core_schema

from tetra_drake.settings.refusals import described, hint, refuse
from tetra_drake.settings.units import plainest, quantity_to_si


class Quantity(float):
    """A number in the tree of a scenario, with its SI unit."""

    unit: str

    def __new__(cls, number: float, unit: str) -> Quantity:
        made = super().__new__(cls, number)
        made.unit = unit
        return made

    def __str__(self) -> str:
        return plainest(self, self.unit)


@dataclass(frozen=True)
class Unit:
    """Annotation of a type of numbers with the SI unit `name`."""

    name: str

    def __get_pydantic_core_schema__(
        self, source: Any, handler: pydantic.GetCoreSchemaHandler
    ) -> CoreSchema:
        def read(value: Any, info: ValidationInfo) -> Any:
            return _si_number(value, self.name, info)

        def write(number: float) -> Quantity:
            return Quantity(number, self.name)

        return _converted(handler(source), read, write)


Length = Annotated[float, Unit("m")]
Angle = Annotated[float, Unit("rad")]
Mass = Annotated[float, Unit("kg")]
Density = Annotated[float, Unit("kg/m^3")]
Time = Annotated[float, Unit("s")]
Speed = Annotated[float, Unit("m/s")]
InverseSpeed = Annotated[float, Unit("s/m")]
Acceleration = Annotated[float, Unit("m/s^2")]
ForceQuantity = Annotated[float, Unit("N")]
Stiffness = Annotated[float, Unit("N/m")]
Damping = Annotated[float, Unit("N*s/m")]
DampingPerLength = Annotated[float, Unit("N*s/m^2")]

Position = Annotated[list[Length], Field(min_length=3, max_length=3)]
"""Coordinates x, y and z."""


@dataclass(frozen=True)
class UnitsByName:
    """Annotation of a type of mappings of numbers, or of lists of numbers, with SI units by
    name."""

    units: Mapping[str, str]
    """Units by name; "" for a number without a unit."""

    def __get_pydantic_core_schema__(
        self, source: Any, handler: pydantic.GetCoreSchemaHandler
    ) -> CoreSchema:
        def read(given: Any, info: ValidationInfo) -> Any:
            if not isinstance(given, dict):
                return given
            for name in given:
                if name not in self.units:
                    refuse(str(name), f"unknown name; {hint(name, self.units)}")
            return _each(given, lambda x, name: _si_number(x, self.units[name], info, key=name))

        def write(numbers: dict[str, Any]) -> dict[str, Any]:
            return _each(numbers, lambda x, name: Quantity(x, self.units[name]))

        return _converted(handler(source), read, write)


def _each(given: dict[str, Any], change: Callable[[Any, str], Any]) -> dict[str, Any]:
    """A mapping with change(number, name) in place of each number. Values are numbers or lists."""
    return {
        name: [change(x, name) for x in value] if isinstance(value, list) else change(value, name)
        for name, value in given.items()
    }


def _converted(
    schema: CoreSchema, read: Callable[[Any, ValidationInfo], Any], write: Callable[[Any], Any]
) -> CoreSchema:
    """A schema with functions that convert values before validation and when they are dumped."""
    serializer = core_schema.plain_serializer_function_ser_schema(write)
    return core_schema.with_info_before_validator_function(read, schema, serialization=serializer)


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
    parts = [field.annotation, *field.metadata]
    for part in parts:
        if isinstance(part, Unit):
            return part.name
        parts += typing.get_args(part)
    return ""
