"""Packed arguments: converted once for all calls of a kernel.

Numba converts each array at each call: 44 ns for an array, 120 ns for one in a NamedTuple. In the
kernel each array has a reference count. For the constants of a robot, this takes longer than the
computation.

`Packed(values)` writes addresses, lengths and numbers of NamedTuples to one row of words. The
kernel gets the address of this row. In the kernel, `unpacked(packed)` is the NamedTuples again,
with a Field in place of each array.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, TypeVar

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import (
    NativeValue,
    intrinsic,
    models,
    overload,
    register_model,
    typeof_impl,
    unbox,
)

from tetra_drake.simd.lanes import Field, FieldArray

Values = TypeVar("Values", bound=tuple)

_intrinsic: Callable[..., Any] = intrinsic

_WORD = ir.IntType(64)


class PackedKind(types.Type):
    """Numba type of packed values; `content` is the type of the values."""

    def __init__(self, content: types.Type) -> None:
        self.content = content
        super().__init__(name=f"Packed({content})")


class Packed(Generic[Values]):
    """A nested tuple of arrays, fields, integers and booleans, as one argument of a kernel.

    The arrays are not copied, so a kernel sees later changes. Packing takes half a millisecond; for
    a few calls, pass the tuple itself. Raises ValueError for an array that cannot be a Field.
    """

    def __init__(self, values: Values) -> None:
        self.values = values
        words: list[int] = []
        self.kind = PackedKind(_pack(values, words))
        self._words = np.array(words, dtype=np.int64)
        self.address = self._words.ctypes.data


def _pack(value: Any, words: list[int]) -> types.Type:
    """Appends the words of a value to `words`. Returns the numba type of the value."""
    if isinstance(value, tuple):
        kinds = [_pack(item, words) for item in value]
        named = hasattr(value, "_fields")
        return types.NamedTuple(kinds, type(value)) if named else types.Tuple(kinds)
    if isinstance(value, np.ndarray):
        value = FieldArray(value, any_size=True)
    if isinstance(value, FieldArray):
        words += [value.address, *value.shape]
        return value.kind
    words.append(int(value))
    return types.boolean if isinstance(value, bool) else types.intp


def unpacked(values: Packed[Values] | Values) -> Values:
    """The values of a Packed, in a kernel or in Python. A tuple is returned as it is."""
    return values.values if isinstance(values, Packed) else values


@register_model(PackedKind)
class _PackedModel(models.OpaqueModel):
    pass


@typeof_impl.register(Packed)
def _typeof(value: Packed[Any], context: Any) -> PackedKind:
    return value.kind


@unbox(PackedKind)
def _unbox(kind: PackedKind, value: Any, c: Any) -> NativeValue:
    address = c.pyapi.object_getattr_string(value, "address")
    pointer = c.builder.inttoptr(c.pyapi.long_as_longlong(address), c.context.get_value_type(kind))
    c.pyapi.decref(address)
    return NativeValue(pointer)


@_intrinsic
def _unpacked(context: Any, packed: PackedKind) -> Any:
    def emit(c: Any, builder: Any, s: Any, args: Any) -> Any:
        words = builder.bitcast(args[0], _WORD.as_pointer())
        position = 0

        def next_word() -> Any:
            nonlocal position
            word = builder.load(builder.gep(words, [ir.Constant(_WORD, position)]))
            position += 1
            return word

        def unpack(kind: Any) -> Any:
            if hasattr(kind, "types"):  # the type of a tuple
                return c.make_tuple(builder, kind, [unpack(item) for item in kind.types])
            if isinstance(kind, Field):
                field = cgutils.create_struct_proxy(kind)(c, builder)
                field.data = builder.inttoptr(next_word(), field.data.type)
                count = len(kind.lengths)
                lengths = [next_word() for _ in range(count)]
                field.lengths = c.make_tuple(builder, types.UniTuple(types.intp, count), lengths)
                return field._getvalue()
            word = next_word()
            return builder.trunc(word, ir.IntType(1)) if kind == types.boolean else word

        return unpack(packed.content)

    return packed.content(packed), emit


overload(unpacked)(
    lambda values: (
        (lambda values: _unpacked(values))
        if isinstance(values, PackedKind)
        else (lambda values: values)
    )
)
