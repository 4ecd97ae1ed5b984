"""The one way kernels are compiled."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

from numba import njit

F = TypeVar("F", bound=Callable[..., object])


def compiled(function: F) -> F:
    """Compiles a kernel, keeping the machine code beside the source or in the user's cache.

    Division follows NumPy (no check for zero). Where no folder can hold the cache
    (say, a read-only installation without a home), the kernel is compiled anew each time.
    """
    try:
        return cast(F, njit(cache=True, error_model="numpy")(function))
    except RuntimeError:
        return cast(F, njit(error_model="numpy")(function))
