"""Compilation of kernels by numba, and the cache of their machine code."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import inspect
import logging
import math
import pickle
import re
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.core import event
from numba.core.caching import CompileResultCacheImpl, NullCache
from numba.core.errors import NumbaError
from numba.core.serialize import dumps
from numba.extending import overload

from tetra_drake.errors import InputError
from tetra_drake.files import write_whole
from tetra_drake.kernels.stamp import stamp
from tetra_drake.machine import LEVELS, code_target

F = TypeVar("F", bound=Callable[..., Any])

LOGGER = "tetra_drake"
"""Name of the logger that gets a warning when compilation takes long."""
_OPTIONS: dict[str, Any] = {
    "error_model": "numpy",
    "fastmath": {"contract"},
    "no_cfunc_wrapper": True,  # only C code would call the wrapper
}
INLINED: Any = _OPTIONS | {"forceinline": True}
"""Numba's options of functions that become part of the machine code of their callers."""
_MOMENT, _MINUTE = 2.0, 60.0
"""Time (s) after which a compilation is announced, and time (s) without one after which the next is
announced again."""
_told = -math.inf
"""Time of the last compilation that took longer than a moment."""
_SEAL_SIZE = hashlib.sha256().digest_size
_TIMES = event.TimingListener()
event.register("numba:compile", _TIMES)


def _aim_at_target() -> None:
    """Makes numba compile for code_target(), unless the user chose other features."""
    config: Any = numba.config
    config.CPU_NAME = code_target()
    if config.CPU_NAME in (*LEVELS, "generic") and config.CPU_FEATURES is None:
        config.CPU_FEATURES = ""  # only what the level has


_aim_at_target()


def compiling_time() -> float:
    """Wall time (s) that this process has spent on numba's compilations that are finished."""
    return _TIMES.duration if _TIMES.done else 0.0


def compiled(function: F, *, nogil: bool = False) -> F:
    """Decorator that compiles a kernel, a numerical function, for calls from Python. The machine
    code is cached on disk.

    The cache is beside the source or in the user's cache folder. If neither can be written to (as
    in a read-only installation without a home), the kernel is compiled in each process.

    Division follows NumPy, without a check for zero. A product and a sum may be rounded together.
    With `nogil`, other Python threads run during a call. Without it, the kernel is inlined in other
    kernels, because calls with many tables are slow.
    """
    return _kernel(function, nogil=nogil, forceinline=not nogil)


def merged(function: F) -> F:
    """Decorator of a large kernel that other kernels call. Numba inserts its source into them
    before it compiles them. The kernel is compiled separately only if Python calls it."""
    return _kernel(function, inline="always")


def inlined(function: F) -> F:
    """Decorator of a small function that becomes part of the machine code of kernels that call it.

    A call from Python runs the plain Python function, because another compilation for such calls
    would take as long again.
    """
    return _for_kernels(function, INLINED)


def called(function: F) -> F:
    """Decorator of a function that kernels call: inlined, it would slow robots that never need it.
    A call from Python is as for `inlined`."""
    return _for_kernels(function, _OPTIONS)


def _for_kernels(function: F, options: Any) -> F:
    @overload(function, jit_options=options)
    @functools.wraps(function)
    def implementation(*_: object) -> F:
        return function

    return function


def machine_code(
    kernel: Callable[..., Any], parts: object, *arguments: object
) -> Callable[..., Any]:
    """Machine code of a kernel whose first argument is always `parts`, as a function of its other
    arguments, of the same types as `arguments`. If compilation is switched off, it calls the
    kernel.

    A call does not check types: with other types it fails or computes nonsense. Raises InputError
    with the place if a function cannot be compiled, as one of a plug-in may be.
    """
    if not hasattr(kernel, "compile"):  # compilation is switched off
        return functools.partial(kernel, parts)
    try:
        code = kernel.compile(tuple(numba.typeof(argument) for argument in (parts, *arguments)))
        return functools.partial(code, parts)
    except NumbaError as error:
        # Of numba's nested errors, the innermost tells the cause. Its place comes first.
        cause = [str(error), *re.findall(r"frontend\)\n\s*(.+)", str(error))][-1]
        place = [*re.findall(r"During: .* at (\S+ \(\d+\))", str(error)), kernel.__name__][0]
        raise InputError(place, "", f"cannot be compiled by numba: {cause}") from error


def _kernel(function: F, **options: Any) -> F:
    kernel: Any = numba.njit(**_OPTIONS, **options)(function)
    if hasattr(kernel, "_cache"):  # False with NUMBA_DISABLE_JIT
        kernel._cache = KernelCache(function)
    return cast(F, kernel)


class KernelCache(NullCache):
    """Cache of a kernel's machine code on disk, with a file for each signature, the types of the
    arguments.

    Numba's own cache numbers its files in an index. The index is wrong after two processes have
    saved at the same time. Here the name of a file contains a digest of the signature. The file
    begins with a digest of its content and of everything that the content depends on. A file that
    is damaged, out of date or of another kernel is replaced.

    Numba asks the cache at the first call of a kernel with arguments of new types:

        load_overload(sig) ──→ machine code, read from the file of this signature
              │
              ↓ None: there is no such file; a timer starts, for a log message after 2 s
        numba compiles
              ↓
        save_overload(sig, data): the timer stops, the file is written
    """

    def __init__(self, function: Callable[..., object]) -> None:
        file = inspect.getfile(function)
        self._kernel = f"{Path(file).stem}.{function.__qualname__}"
        self._function = function
        self._content: CompileResultCacheImpl | None = None
        if not function.__closure__:  # the machine code would contain the closure's values
            with contextlib.suppress(RuntimeError):  # no folder can be written to
                self._content = CompileResultCacheImpl(function)
        self._timers: dict[object, threading.Timer] = {}

    @property
    def cache_path(self) -> str | None:
        """Folder of the cache files; None if no folder can be written to."""
        return str(self._content.locator.get_cache_path()) if self._content else None

    @functools.cached_property
    def _stamp(self) -> str:
        """Digest of what the kernel is made from. All modules that it uses are imported by the time
        of its first call."""
        return stamp(self._function)

    def load_overload(self, sig: object, target_context: Any) -> Any:
        """The machine code for a signature `sig` from the cache; None if it must be compiled.
        `target_context` is numba's context of the processor."""
        target_context.refresh()
        if self._content:
            path, key = self._entry(sig, target_context.codegen())
            file = b""
            with contextlib.suppress(OSError):
                file = path.read_bytes()
            seal, data = file[:_SEAL_SIZE], file[_SEAL_SIZE:]
            if seal == _seal(key, data):
                saved_sig, reduced = pickle.loads(data)
                if saved_sig == sig:  # different types may have the same name
                    return self._content.rebuild(target_context, reduced)
        timer = threading.Timer(_MOMENT, announce, [self._content is not None])
        timer.daemon = True
        timer.start()
        self._timers[sig] = timer
        return None

    def save_overload(self, sig: object, data: Any) -> None:
        """Saves `data`, numba's compiled kernel for a signature `sig`, if the folder can be written
        to."""
        self._timers.pop(sig).cancel()
        if self._content and self._content.check_cachable(data):
            path, key = self._entry(sig, data.codegen)
            content = dumps((sig, self._content.reduce(data)))
            with contextlib.suppress(InputError, OSError):
                write_whole(path, _seal(key, content) + content)

    def _entry(self, sig: object, codegen: Any) -> tuple[Path, str]:
        """Path of the cache file for a signature, and a text with everything that the file's
        content depends on."""
        variant = f"{sig} {codegen.magic_tuple()} {sys.implementation.cache_tag}"
        digest = hashlib.sha256(variant.encode()).hexdigest()[:16]
        key = f"{self._kernel} {numba.__version__} {sys.version} {self._stamp} {variant}"
        return Path(str(self.cache_path), f"{self._kernel}.{digest}.nbc"), key


def _seal(key: str, content: bytes) -> bytes:
    return hashlib.sha256(key.encode() + content).digest()


def announce(kept: bool) -> None:
    """Logs that kernels are being compiled, once as long as one follows the other within a minute.
    `kept` is True if the machine code will be cached."""
    global _told
    follows = time.monotonic() < _told + _MINUTE
    _told = time.monotonic()
    if follows:
        return
    lost = " each time, as no folder can be written to: set NUMBA_CACHE_DIR"
    often = "; later runs reuse the code" if kept else lost
    logging.getLogger(LOGGER).warning(
        "tetra_drake is compiling for this processor, which may take a minute%s", often
    )
