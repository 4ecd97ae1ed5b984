"""The one way kernels are compiled."""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

from numba import njit

F = TypeVar("F", bound=Callable[..., object])


def compiled(function: F, *, nogil: bool = False) -> F:
    """Compiles a kernel, keeping the machine code beside the source or in the user's cache.

    Division follows NumPy (no check for zero). With `nogil`, other threads run meanwhile.
    Where no folder can hold the cache (say, a read-only installation without a home), the
    kernel is compiled anew each time.
    """
    try:
        kernel: Any = njit(cache=True, error_model="numpy", nogil=nogil)(function)
    except RuntimeError:
        return cast(F, njit(error_model="numpy", nogil=nogil)(function))
    if not hasattr(kernel, "_cache"):  # compilation is switched off (NUMBA_DISABLE_JIT)
        return cast(F, kernel)
    # Numba looks for changes in the kernel's own file only; what it calls is compiled into it.
    kernel._cache._cache_file._source_stamp = _stamp_of_all_kernels()
    return cast(F, kernel)


@functools.cache
def _stamp_of_all_kernels() -> str:
    """Changes with any source file that holds kernels."""
    package = Path(__file__).parent.parent
    digest = hashlib.sha256()
    for folder in ("physics", "engines/compiled"):
        for source in sorted((package / folder).glob("*.py")):
            digest.update(source.read_bytes())
    return digest.hexdigest()
