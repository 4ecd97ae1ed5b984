"""Machine and package versions, which results depend on."""

from __future__ import annotations

import importlib.util
import os
import platform
from collections.abc import Iterable
from importlib import metadata

from tetra_drake.errors import InputError, check_whole


def available_cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def threads_for(workers: int | None, *, source: str) -> int:
    """Number of threads for the argument `workers` of the function named `source`: None means one
    per core. Raises InputError unless it is a whole number, 1 or more."""
    if workers is None:
        return available_cores()
    return check_whole(source, "workers", workers, least=1)


def check_package(name: str, *, extra: str, source: str) -> None:
    """Raises InputError, naming `source`, if the package `name` is not installed. The message says
    to install this project with its pip `extra`."""
    if importlib.util.find_spec(name) is None:
        raise InputError(source, "", f"needs {name}: pip install 'tetra_drake[{extra}]'")


_V3 = {"+avx2", "+bmi", "+bmi2", "+f16c", "+fma", "+lzcnt", "+movbe"}
_V4 = _V3 | {"+avx512bw", "+avx512cd", "+avx512dq", "+avx512f", "+avx512vl"}
LEVELS = {"x86-64-v4": _V4, "x86-64-v3": _V3}
"""Levels of x86-64 with the features that a processor needs for them, the higher level first."""


def code_target() -> str | None:
    """Processor for which kernels are compiled, by its name for LLVM: the level of this processor,
    not its exact model. None for the model.

    Code for a level is as fast. All processors of a level share it, and both levels of x86-64 round
    alike. On arm64 the level is "generic". NUMBA_CPU_NAME can name a level or a model instead.
    """
    from numba.core.codegen import get_host_cpu_features

    if chosen := os.environ.get("NUMBA_CPU_NAME"):
        return chosen
    if platform.machine() in ("arm64", "aarch64"):
        return "generic"
    has = set(get_host_cpu_features().split(","))
    return next((level for level, needed in LEVELS.items() if needed <= has), None)


def versions(packages: Iterable[str] = ()) -> dict[str, str]:
    """Versions of packages by name, with the keys python and processor (its kind) added. The last
    digits of results depend on them.

    `packages` are additional ones, which only one engine needs.
    """
    from llvmlite.binding import get_host_cpu_name

    target = code_target() or get_host_cpu_name()
    names = ["tetra_drake", "drake", "numpy", "numba", *packages]
    installed = {name: metadata.version(name) for name in names}
    processor = "x86-64" if target in LEVELS else target  # its levels round alike
    return installed | {"python": platform.python_version(), "processor": processor}
