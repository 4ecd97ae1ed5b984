"""The machine and the packages that results come from."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterable
from importlib import metadata


def available_cores() -> int:
    """The cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def versions(packages: Iterable[str] = ()) -> dict[str, str]:
    """The versions of packages, and the kind of processor, on which the last digits of a result
    depend; `packages` are those that only its engine needs."""
    from llvmlite.binding import get_host_cpu_name

    names = ["tetra_drake", "drake", "numpy", "numba", *packages]
    installed = {name: metadata.version(name) for name in names}
    processor = os.environ.get("NUMBA_CPU_NAME") or get_host_cpu_name()
    return installed | {"python": platform.python_version(), "processor": processor}
