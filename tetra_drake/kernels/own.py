"""Laws with functions of their own, which plug-ins bring along.

All kernels contain all laws of this package, and choose between them by a number. A law of a
plug-in has an OwnFunctions. Its numba type contains the functions. So kernels are compiled anew for
the robots that have this law, and its functions become part of their machine code, as fast as the
package's own. Kernels for all other robots stay as they are.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, fields
from typing import Any, cast

import numpy as np
from numba import types
from numba.extending import overload, typeof_impl

from tetra_drake.kernels.compiling import INLINED, F
from tetra_drake.kernels.lanes import Table, named
from tetra_drake.kernels.packed import PackedKind
from tetra_drake.kernels.stamp import stamp


@dataclass(frozen=True)
class OwnFunctions:
    """Base class of the functions of a law that kernels call. Fields are functions decorated with
    `inlined`, whose last argument is the law's constants."""

    constants: Any
    """Class of the law's constants: a NamedTuple of numbers."""

    def table(self, settings: object) -> Table:
        """Constants from settings, whose attributes have the same names, as an array."""
        return np.array([getattr(settings, name) for name in self.constants._fields], dtype=float)


class OwnType(types.Type):
    """Numba type of the functions of one law. Its name, by which machine code is cached, contains a
    digest of what they are made from."""

    def __init__(self, functions: OwnFunctions) -> None:
        self.functions = functions
        given = [getattr(functions, field.name) for field in fields(functions)]
        names = ", ".join(f"{one.__module__}.{one.__qualname__}" for one in given)
        super().__init__(name=f"Own({names}, {stamp(*given)})")


_own_type = functools.cache(OwnType)

typeof_impl.register(OwnFunctions)(lambda functions, context: _own_type(functions))


def with_own(name: str, shipped: F | None = None) -> F:
    """Function of a law, which is its first argument.

    If the law has an OwnFunctions in the attribute `own`, it calls the function `name` of them with
    the remaining arguments, then the law's constants. Otherwise it calls `shipped` with all
    arguments. The constants are a table, or a NamedTuple of tables, which is passed on as it is.
    Numba wants equal signatures: (law: Any, *more: Any).
    """

    def call(law: Any, *more: Any) -> Any:
        if law.own is None:
            return shipped(law, *more)  # type: ignore[misc]
        of_tables = isinstance(law.constants, tuple)
        constants = law.constants if of_tables else named(law.own.constants, law.constants)
        return getattr(law.own, name)(*more, constants)

    @overload(call, jit_options=INLINED)
    def implementation(law: Any, *more: Any) -> Any:
        kinds = dict(zip(law.names, law.members, strict=True))  # law is a PackedKind
        if not isinstance(kinds["own"], OwnType):
            return shipped
        functions = kinds["own"].functions
        function, constants = getattr(functions, name), functions.constants

        def own(law: Any, *more: Any) -> Any:
            return function(*more, named(constants, law.constants))

        def of_tables(law: Any, *more: Any) -> Any:
            return function(*more, law.constants)

        return of_tables if isinstance(kinds["constants"], PackedKind) else own

    return cast(F, call)
