"""Compilation of kernels by numba, and the cache of their machine code."""

from __future__ import annotations

import ast
import contextlib
import functools
import hashlib
import inspect
import logging
import pickle
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.core.caching import CompileResultCacheImpl, NullCache
from numba.core.serialize import dumps
from numba.extending import overload

from tetra_drake.errors import InputError
from tetra_drake.files import write_whole

F = TypeVar("F", bound=Callable[..., object])

LOGGER = "tetra_drake"
"""The logger that gets a warning, once, when compilation takes longer than a moment."""

_OPTIONS: dict[str, Any] = {
    "error_model": "numpy",
    "fastmath": {"contract"},
    "no_cfunc_wrapper": True,  # which C would call
}

_MOMENT = 2.0
"""Time (s) that a compilation takes before it is announced."""


def compiled(function: F, *, nogil: bool = False) -> F:
    """Compiles a kernel that Python calls, keeping the machine code beside the source or in the
    user's cache.

    Division follows NumPy (no check for zero); a product may be rounded together with the sum it
    goes into. With `nogil`, other threads run meanwhile; without it, kernels that call this one
    contain it, since calls with many tables are slow.

    Where no folder can hold the cache (say, a read-only installation without a home), the kernel
    is compiled anew each time.
    """
    return _kernel(function, nogil=nogil, forceinline=not nogil)


def merged(function: F) -> F:
    """A large kernel whose source becomes part of the one that calls it; it is compiled by itself
    only if Python calls it."""
    return _kernel(function, inline="always")


def inlined(function: F) -> F:
    """A function that becomes part of the kernels that call it; from Python, a Python function.

    Compiling what a call from Python takes would cost as much again.
    """
    options: Any = _OPTIONS | {"forceinline": True}

    @overload(function, jit_options=options)
    @functools.wraps(function)
    def implementation(*_: object) -> F:
        return function

    return function


def machine_code(kernel: F, *arguments: object) -> F:
    """The machine code of a kernel for arguments of the types of these.

    A call does not look at types: with others it fails or computes nonsense.
    """
    if not hasattr(kernel, "compile"):  # compilation is switched off
        return kernel
    return cast(F, kernel.compile(tuple(numba.typeof(argument) for argument in arguments)))


def _kernel(function: F, **options: Any) -> F:
    kernel: Any = numba.njit(**_OPTIONS, **options)(function)
    if hasattr(kernel, "_cache"):  # else compilation is switched off by NUMBA_DISABLE_JIT
        kernel._cache = KernelCache(function)
    return cast(F, kernel)


class KernelCache(NullCache):
    """The machine code of a kernel, in a file for each signature.

    Numba's usual cache numbers the files in an index, which is wrong after two processes have
    saved at once. Here a digest of the signature names the file, and the file begins with a digest
    of its content and of all that the content depends on. A file that is damaged, out of date or
    another kernel's is replaced.

    Numba asks it at the first call of a kernel with arguments of other types than before:

        load_overload(sig) ──→ machine code, read from the file of this signature
              │
              ↓ None: there is no such file, and the timer of the announcement starts
        numba compiles
              ↓
        save_overload(sig, data): the timer stops, the file is written
    """

    def __init__(self, function: Callable[..., object]) -> None:
        file = inspect.getfile(function)
        self._kernel = f"{Path(file).stem}.{function.__qualname__}"
        self._origin = f"{self._kernel} {numba.__version__} {sys.version} {source_stamp(file)} "
        self._content: CompileResultCacheImpl | None = None
        if not function.__closure__:  # whose values would be in the machine code
            with contextlib.suppress(RuntimeError):  # there is no folder to write to
                self._content = CompileResultCacheImpl(function)
        self._timers: dict[object, threading.Timer] = {}

    @property
    def cache_path(self) -> str | None:
        """The folder of the files, None if there is none."""
        return str(self._content.locator.get_cache_path()) if self._content else None

    def load_overload(self, sig: object, target_context: Any) -> Any:
        """The kernel compiled earlier for a signature; None if it has to be compiled now."""
        target_context.refresh()
        if self._content:
            path, key = self._entry(sig, target_context.codegen())
            seal, data = _read(path)
            if seal == _seal(key, data):
                saved_sig, reduced = pickle.loads(data)
                if saved_sig == sig:  # another type may have the same name
                    return self._content.rebuild(target_context, reduced)
        timer = threading.Timer(_MOMENT, announce, [self._content is not None])
        timer.daemon = True
        timer.start()
        self._timers[sig] = timer
        return None

    def save_overload(self, sig: object, data: Any) -> None:
        """Keeps what was compiled for a signature, if the folder can be written to."""
        self._timers.pop(sig).cancel()
        if self._content and self._content.check_cachable(data):
            path, key = self._entry(sig, data.codegen)
            content = dumps((sig, self._content.reduce(data)))
            with contextlib.suppress(InputError, OSError):
                write_whole(path, _seal(key, content) + content)

    def _entry(self, sig: object, codegen: Any) -> tuple[Path, str]:
        """The file of a signature, and a text with all that its content depends on."""
        variant = f"{sig} {codegen.magic_tuple()} {sys.implementation.cache_tag}"
        digest = hashlib.sha256(variant.encode()).hexdigest()[:16]
        return Path(str(self.cache_path), f"{self._kernel}.{digest}.nbc"), self._origin + variant


def _seal(key: str, content: bytes) -> bytes:
    return hashlib.sha256(key.encode() + content).digest()


def _read(path: Path) -> tuple[bytes, bytes]:
    """The seal and the content of a file, empty if it cannot be read."""
    try:
        whole = path.read_bytes()
    except OSError:
        whole = b""
    size = hashlib.sha256().digest_size
    return whole[:size], whole[size:]


@functools.cache
def announce(kept: bool) -> None:
    """Logs, once a process, that kernels are compiled, and whether that is `kept`."""
    often = "once" if kept else "each time, as no folder can be written to: set NUMBA_CACHE_DIR"
    logging.getLogger(LOGGER).warning(
        "tetra_drake is compiling for this processor, which may take a minute, %s", often
    )


def source_stamp(file: str) -> str:
    """A digest of a module's source and of all modules of this package that it imports."""
    sources: set[Path] = set()
    pending = [Path(file).resolve()]
    while pending:
        path = pending.pop()
        if path not in sources:
            sources.add(path)
            pending += _imported(path)
    return hashlib.sha256(b"".join(sorted(path.read_bytes() for path in sources))).hexdigest()


@functools.cache
def _imported(path: Path) -> tuple[Path, ...]:
    """The files of the modules of this package that a module imports.

    What an import takes from a package may be a module: `from tetra_drake.physics import contact`.
    """
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module)
            names.update(f"{node.module}.{alias.name}" for alias in node.names)
    package = __name__.partition(".")[0]
    root = Path(__file__).resolve().parents[__name__.count(".")]
    modules = [root.joinpath(*name.split(".")) for name in names if name.startswith(f"{package}.")]
    files = [module.with_suffix(".py") for module in modules]
    files += [module / "__init__.py" for module in modules]
    return tuple(file for file in files if file.is_file())
