"""Loops over tuples whose items are of different types."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba.extending import overload

_INLINED: Any = {"forceinline": True, "no_cfunc_wrapper": True}


def for_each(method: str) -> Callable[[Any, Any], None]:
    """A function that calls a method of each item of a tuple that has it, with one argument.

    The items are NamedTuples whose method is `inlined`, tables or numbers. In a kernel the calls
    are written out, as each item is of another type.
    """

    def call(items: Any, given: Any) -> None:
        for item in items:
            if hasattr(item, method):
                getattr(item, method)(given)

    @overload(call, jit_options=_INLINED)
    def written_out(items: Any, given: Any) -> Callable[[Any, Any], None]:
        first: Any = getattr(items[0], "instance_class", None) if len(items) else None
        of_first: Any = getattr(first, method, None)

        def none(items: Any, given: Any) -> None:
            pass

        def rest(items: Any, given: Any) -> None:
            call(items[1:], given)

        def first_and_rest(items: Any, given: Any) -> None:
            of_first(items[0], given)
            call(items[1:], given)

        if not len(items):
            return none
        return first_and_rest if of_first else rest

    return call
