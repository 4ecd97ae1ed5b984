"""Digest of everything that the machine code of a kernel is made from.

Numba compiles a kernel from its bytecode and from the values of the names in it: functions that it
calls, constants, NamedTuples. The digest depends on these, and on nothing else in their modules. So
a changed comment, error text or reader of files compiles nothing anew.
"""

from __future__ import annotations

import dis
import functools
import hashlib
import inspect
import sys
from collections.abc import Iterator
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

_VARIADIC = inspect.CO_VARARGS | inspect.CO_VARKEYWORDS
"""Flags of code that numba reads; a profiler changes others."""

_LIBRARIES = {*sys.stdlib_module_names, "numpy", "numba", "llvmlite"}
"""Packages whose functions numba compiles by rules of its own."""


def stamp(*values: Any) -> str:
    """Digest (hexadecimal) of functions and constants, of all that the functions use, and of the
    package `kernels`, whose rules compile all kernels."""
    digest = hashlib.sha256(_rules().encode())
    numbers: dict[Any, int] = {}  # functions, in the order of discovery
    pending = [("", value) for value in values]
    for name, value in pending:
        text = _text(value)
        if text is None:
            if value not in numbers:
                numbers[value] = len(numbers)
                digest.update(_head(value).encode())
                pending += _used(value)
            text = f"function {numbers[value]}"
        digest.update(f"{name}: {text}\n".encode())
    return digest.hexdigest()


@functools.cache
def _rules() -> str:
    """Bytecode of the package `kernels`, without docstrings."""
    files = sorted(Path(__file__).parent.glob("*.py"))
    codes = [compile(file.read_bytes(), file.name, "exec", optimize=2) for file in files]
    return "\n".join(map(_bytecode, codes))


def _text(value: Any) -> str | None:
    """What machine code takes from a value that is no function of this package or of a plug-in;
    None for such a function."""
    if isinstance(value, np.ndarray):
        return f"{value.dtype} {value.shape} {value.tobytes().hex()}"
    if isinstance(value, type):  # such as a NamedTuple
        fields = getattr(value, "_fields", ()), getattr(value, "_field_defaults", {})
        return f"{value.__module__}.{value.__qualname__} {fields}"
    is_function = isinstance(getattr(value, "py_func", value), FunctionType)
    if is_function and value.__module__.partition(".")[0] not in _LIBRARIES:
        return None
    return str(getattr(value, "__name__", repr(value)))


@functools.cache  # many kernels use the same functions
def _head(function: Any) -> str:
    """What machine code takes from a function or kernel, such as the module where its names are
    looked up, without the values that it uses."""
    options = getattr(function, "targetoptions", {})
    function = getattr(function, "py_func", function)
    code = _bytecode(function.__code__, docstring=function.__doc__)
    return f"{function.__module__} {sorted(map(str, options.items()))} {code}\n"


def _bytecode(code: CodeType, *, docstring: str | None = None) -> str:
    """A code object as numba reads it: without positions in the file, and without its docstring."""
    constants = [_constant(one) for one in code.co_consts if docstring is None or one != docstring]
    names = code.co_names, code.co_varnames, code.co_cellvars, code.co_freevars
    counts = code.co_argcount, code.co_kwonlyargcount, code.co_flags & _VARIADIC
    return f"{code.co_code.hex()} {names} {counts} {constants}"


def _constant(value: Any) -> str:
    if isinstance(value, CodeType):
        return _bytecode(value)
    if isinstance(value, frozenset):  # their order differs between processes
        return str(sorted(map(repr, value)))
    return repr(value)


@functools.cache
def _used(function: Any) -> list[tuple[str, Any]]:
    """Values that a function or kernel uses, with their names: of its globals, its closure and its
    defaults. Tuples are taken apart."""
    function = getattr(function, "py_func", function)
    cells = [cell.cell_contents for cell in function.__closure__ or ()]
    pending = [*_globals(function.__code__, function.__globals__)]
    pending += [("", value) for value in (*cells, *(function.__defaults__ or ()))]
    found = []
    for name, value in pending:
        if isinstance(value, (tuple, list)):
            pending += [(name, item) for item in value]
        else:
            found.append((name, value))
    return found


def _globals(code: CodeType, space: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    """Values of the global names in a code object, with the names. In place of a module it gives
    the attributes of it that the code reads, such as MODE for `contact.MODE`."""
    value: Any = None
    for instruction in dis.get_instructions(code):
        name = str(instruction.argval)
        if instruction.opname == "LOAD_GLOBAL":
            value = space.get(name)
        elif isinstance(value, ModuleType) and instruction.opname in ("LOAD_ATTR", "LOAD_METHOD"):
            value = getattr(value, name)
        else:
            value = None
        if value is not None and not isinstance(value, ModuleType):
            yield name, value
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _globals(constant, space)
