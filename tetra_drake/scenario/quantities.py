"""Quantities: numbers in SI whose type says their unit, and which files hold as texts with units.

A field `stiffness: Stiffness = Field(gt=0)` reads "25 lbf/in" as a number in N/m. Items of lists
and mappings may have such types, too.
"""

from __future__ import annotations

import typing
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import pydantic
from pydantic import Field
from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema, core_schema

from tetra_drake.scenario.refusals import described, hint, refuse
from tetra_drake.scenario.units import plainest, quantity_to_si

Info = core_schema.ValidationInfo


class Quantity(float):
    """A number in a tree, in the SI unit `unit`."""

    unit: str

    def __new__(cls, number: float, unit: str) -> Quantity:
        made = super().__new__(cls, number)
        made.unit = unit
        return made

    def __str__(self) -> str:
        return plainest(self, self.unit)


@dataclass(frozen=True)
class Unit:
    """Marks the type of a number in the SI unit `name`."""

    name: str

    def __get_pydantic_core_schema__(
        self, source: Any, handler: pydantic.GetCoreSchemaHandler
    ) -> CoreSchema:
        def read(value: Any, info: Info) -> Any:
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
Acceleration = Annotated[float, Unit("m/s^2")]
Force = Annotated[float, Unit("N")]
Stiffness = Annotated[float, Unit("N/m")]
Damping = Annotated[float, Unit("N*s/m")]
DampingPerLength = Annotated[float, Unit("N*s/m^2")]

Position = Annotated[list[Length], Field(min_length=3, max_length=3)]
"""x, y and z."""


@dataclass(frozen=True)
class UnitsByName:
    """Marks the type of a mapping of numbers, or of lists of them, with SI units by their names."""

    units: Mapping[str, str]
    """Units; "" for a number without one."""

    def __get_pydantic_core_schema__(
        self, source: Any, handler: pydantic.GetCoreSchemaHandler
    ) -> CoreSchema:
        def read(given: Any, info: Info) -> Any:
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
    """A mapping of numbers, or of lists of them, with change(number, name) in place of each."""
    return {
        name: [change(x, name) for x in value] if isinstance(value, list) else change(value, name)
        for name, value in given.items()
    }


def _converted(
    schema: CoreSchema, read: Callable[[Any, Info], Any], write: Callable[[Any], Any]
) -> CoreSchema:
    """A schema that reads what it validates and writes what it dumps."""
    serializer = core_schema.plain_serializer_function_ser_schema(write)
    return core_schema.with_info_before_validator_function(read, schema, serialization=serializer)


def _si_number(value: Any, unit: str, info: Info, *, key: str = "") -> Any:
    """The number of a quantity; what is none is left to pydantic.

    In a validation with a context, that of a file, bare numbers but 0 are refused.
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
    """The unit of a field's numbers; "" for none."""
    parts = [field.annotation, *field.metadata]
    for part in parts:
        if isinstance(part, Unit):
            return part.name
        parts += typing.get_args(part)
    return ""
