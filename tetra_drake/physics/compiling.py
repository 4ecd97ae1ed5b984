"""The one way kernels are compiled."""

from __future__ import annotations

import functools
import hashlib
import inspect
import re
from collections.abc import Callable, Iterator
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
    kernel._cache._cache_file._source_stamp = source_stamp(inspect.getfile(function))
    return cast(F, kernel)


def source_stamp(file: str) -> str:
    """A digest of a module's source and of all modules of its package that it imports."""
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
    """The files of the modules of its own package that a module's source names in imports."""
    root = path.parent
    while (root.parent / "__init__.py").is_file():
        root = root.parent
    names = re.findall(
        rf"^\s*(?:from|import)\s+({root.name}(?:\.\w+)+)", path.read_text(encoding="utf-8"), re.M
    )
    return tuple(_files(root.parent, names))


def _files(folder: Path, names: list[str]) -> Iterator[Path]:
    for name in names:
        file = folder.joinpath(*name.split(".")).with_suffix(".py")
        if file.is_file():
            yield file
