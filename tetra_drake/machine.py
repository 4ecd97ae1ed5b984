"""Machine and package versions, which results depend on."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterable
from importlib import metadata


def available_cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def versions(packages: Iterable[str] = ()) -> dict[str, str]:
    """Versions of packages and kind of processor. The last digits of results depend on them.

    `packages` are additional ones, which only one engine needs.
    """
    from llvmlite.binding import get_host_cpu_name

    names = ["tetra_drake", "drake", "numpy", "numba", *packages]
    installed = {name: metadata.version(name) for name in names}
    processor = os.environ.get("NUMBA_CPU_NAME") or get_host_cpu_name()
    return installed | {"python": platform.python_version(), "processor": processor}
