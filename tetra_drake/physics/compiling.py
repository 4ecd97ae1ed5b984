"""The one way kernels are compiled."""

from __future__ import annotations

import functools
import hashlib
import inspect
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

from numba import njit

F = TypeVar("F", bound=Callable[..., object])


def compiled(function: F, *, nogil: bool = False) -> F:
    """Compiles a kernel, keeping the machine code beside the source or in the user's cache.

    Division follows NumPy (no check for zero); a product may be rounded together with the sum it
    goes into. With `nogil`, other threads run meanwhile; other kernels become part of their
    callers, since calls with many tables are slow.

    Where no folder can hold the cache (say, a read-only installation without a home), the
    kernel is compiled anew each time.
    """
    compile_ = functools.partial(
        njit, error_model="numpy", fastmath={"contract"}, nogil=nogil, forceinline=not nogil
    )
    try:
        kernel: Any = compile_(cache=True)(function)
    except RuntimeError:
        return cast(F, compile_()(function))
    if not hasattr(kernel, "_cache"):  # compilation is switched off (NUMBA_DISABLE_JIT)
        return cast(F, kernel)
    # Numba looks for changes in the kernel's own file only; what it calls is compiled into it.
    # Its version is compared before signatures are unpickled, whose classes may be gone.
    file, stamp = kernel._cache._cache_file, source_stamp(inspect.getfile(function))
    file._source_stamp, file._version = stamp, f"{file._version} {stamp}"
    return cast(F, kernel)


def source_stamp(file: str) -> str:
    """A digest of a module's source and of all modules of this package that it imports."""
    seen: set[Path] = set()
    pending = [Path(file).resolve()]
    while pending:
        path = pending.pop()
        if path not in seen:
            seen.add(path)
            pending += _imported(path)
    return hashlib.sha256(b"".join(sorted(path.read_bytes() for path in seen))).hexdigest()


@functools.cache
def _imported(path: Path) -> tuple[Path, ...]:
    """The files of the modules of this package that a module's source names in imports."""
    package = __name__.partition(".")[0]
    root = Path(__file__).resolve().parents[__name__.count(".")]
    imports = rf"^\s*(?:from|import)\s+({package}(?:\.\w+)+)"
    names = re.findall(imports, path.read_text(encoding="utf-8"), re.MULTILINE)
    files = (root.joinpath(*name.split(".")).with_suffix(".py") for name in names)
    return tuple(file for file in files if file.is_file())
