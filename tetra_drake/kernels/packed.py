"""NamedTuples of tables: allocated by their annotations, and packed for kernels as one pointer.

The annotation of a table defines its shape:

    class Motion(NamedTuple):
        state: Annotated[Table, "13 * bodies"]
        rows: Annotated[Table, "bodies", 6, "width"]
        passed: Annotated[Table, "bodies", int]
        least: Annotated[Table, 1, math.inf]

    motion = allocate(Motion, {"bodies": 5, "width": 12})

Numba converts each array at each call: 44 ns for an array, 120 ns for one in a NamedTuple. In the
kernel each array has a reference count. For the constants of a robot, this takes longer than the
computation. Moreover, numba hands a NamedTuple to another function as all of its numbers, and
compiles hundreds of them at each call.

`Packed(values)` writes addresses, lengths and numbers of NamedTuples to a row of 64-bit words. The
kernel gets the address of this row. An attribute of a packed NamedTuple is read from there: it is
the address of a part of the row, a Field in place of an array, an integer or a boolean.
"""

from __future__ import annotations

import functools
import hashlib
import math
from collections.abc import Callable, Mapping
from typing import Annotated, Any, Generic, TypeVar, get_origin, get_type_hints

import numpy as np
from llvmlite import ir
from numba import typeof, types
from numba.core import cgutils
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    NativeValue,
    infer_getattr,
    intrinsic,
    lower_getattr_generic,
    models,
    overload,
    register_model,
    typeof_impl,
    unbox,
)

from tetra_drake.kernels.lanes import Field, FieldArray, NamedTupleT

Values = TypeVar("Values", bound=tuple)

_intrinsic: Callable[..., Any] = intrinsic

_WORD = ir.IntType(64)

_hints = functools.cache(functools.partial(get_type_hints, include_extras=True))


def allocate(kind: type[NamedTupleT], sizes: Mapping[str, int]) -> NamedTupleT:
    """A NamedTuple of new tables, with shapes from the annotations of its fields.

    Args:
        kind: class of the NamedTuple. The annotation of a table has a length per dimension: a
            number, the name of a size, or a product such as "6 * bodies". With `int` in it, the
            table has integers. With a float in it, all numbers start with this value; otherwise
            with 0. A field whose annotation is only a class is a NamedTuple of tables.
        sizes: sizes by name, such as {"bodies": 5}.
    """
    fields = []
    for hint in _hints(kind).values():
        if get_origin(hint) is not Annotated:
            fields.append(allocate(hint, sizes))
            continue
        marks = hint.__metadata__
        lengths = [str(mark).split(" * ") for mark in marks if isinstance(mark, (int, str))]
        shape = [
            math.prod(int(factor) if factor.isdigit() else sizes[factor] for factor in factors)
            for factors in lengths
        ]
        start = next((mark for mark in marks if isinstance(mark, float)), 0.0)
        fields.append(np.full(shape, start, dtype=np.int64 if int in marks else np.float64))
    return kind(*fields)


class PackedKind(types.Type):
    """Numba type of a Packed in a kernel: the address of the 64-bit words that hold its values.

    `members` are the numba types of the values, and `names` their names. In a plain tuple, the
    names are "0", "1" and so on.
    """

    def __init__(self, names: tuple[str, ...], members: tuple[types.Type, ...]) -> None:
        self.names, self.members = names, members
        self.words = sum(map(_words, members))
        # The name is a part of the name of each function, so it is short.
        content = ", ".join(f"{name}: {kind}" for name, kind in zip(names, members, strict=True))
        super().__init__(name=f"Packed({hashlib.sha256(content.encode()).hexdigest()[:16]})")


_kind = functools.cache(PackedKind)  # numba needs longer to make a type than to find it


def _words(kind: types.Type) -> int:
    """Number of 64-bit words of a packed value of this numba type."""
    if isinstance(kind, PackedKind):
        return kind.words
    return 1 + len(kind.lengths) if isinstance(kind, Field) else 1


class Packed(Generic[Values]):
    """A nested tuple of arrays, fields, integers and booleans, as one argument of a kernel.

    Another value, such as None, is in the numba type alone; its word is 0.

    The kernel gets one address in place of all values; unpacked() gives the values back. The arrays
    are not copied, so a kernel sees later changes. Packing takes half a millisecond.
    Raises ValueError for an array that cannot be a Field.
    """

    def __init__(self, values: Values) -> None:
        self.values = values
        words: list[int] = []
        self.kind = _pack(values, words)
        self._words = np.array(words, dtype=np.int64)
        self.address = self._words.ctypes.data


def _pack(value: Any, words: list[int]) -> types.Type:
    """Appends the 64-bit words of a value (addresses, lengths and numbers) to `words`. Returns the
    numba type that kernels see."""
    if isinstance(value, tuple):
        names = getattr(value, "_fields", None) or tuple(map(str, range(len(value))))
        return _kind(names, tuple(_pack(item, words) for item in value))
    if isinstance(value, np.ndarray):
        value = FieldArray(value, any_size=True)
    if isinstance(value, FieldArray):
        words += [value.address, *value.shape]
        return value.kind
    is_number = hasattr(value, "__int__")
    words.append(int(value) if is_number else 0)
    number: types.Type = types.boolean if isinstance(value, bool) else types.intp
    return number if is_number else typeof(value)


def unpacked(values: Packed[Values] | Values) -> Values:
    """The tuple of values of a Packed, in a kernel or in Python. A plain tuple is returned as it
    is."""
    return values.values if isinstance(values, Packed) else values


@register_model(PackedKind)
class _PackedModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: PackedKind) -> None:
        super().__init__(manager, kind, _WORD.as_pointer())


typeof_impl.register(Packed)(lambda value, context: value.kind)


@unbox(PackedKind)
def _unbox(kind: PackedKind, value: Any, c: Any) -> NativeValue:
    address = c.pyapi.object_getattr_string(value, "address")
    pointer = c.builder.inttoptr(c.pyapi.long_as_longlong(address), _WORD.as_pointer())
    c.pyapi.decref(address)
    return NativeValue(pointer)


@infer_getattr
class _Attributes(AttributeTemplate):
    key = PackedKind

    def generic_resolve(self, packed: Any, name: str) -> Any:  # type: ignore[override]
        return packed.members[packed.names.index(name)] if name in packed.names else None


def _member(context: Any, builder: Any, packed: PackedKind, words: Any, place: int) -> Any:
    """Emits code that reads member number `place` of values of the type `packed`. `words` is the
    address of their words."""
    kind: Any = packed.members[place]
    first = sum(map(_words, packed.members[:place]))

    def word(index: int) -> Any:
        loaded = builder.load(builder.gep(words, [ir.Constant(_WORD, first + index)]))
        # Words never change, so the compiler may read one once for many uses.
        loaded.set_metadata("invariant.load", builder.module.add_metadata([]))
        return loaded

    if isinstance(kind, PackedKind):
        return builder.gep(words, [ir.Constant(_WORD, first)])
    if isinstance(kind, Field):
        field = cgutils.create_struct_proxy(kind)(context, builder)
        field.data = builder.inttoptr(word(0), field.data.type)
        lengths = [word(1 + axis) for axis in range(len(kind.lengths))]
        field.lengths = context.make_tuple(
            builder, types.UniTuple(types.intp, len(lengths)), lengths
        )
        return field._getvalue()
    return builder.trunc(word(0), ir.IntType(1)) if kind == types.boolean else word(0)


lower_getattr_generic(PackedKind)(
    lambda context, builder, packed, words, name: _member(
        context, builder, packed, words, packed.names.index(name)
    )
)


@_intrinsic
def _unpacked(context: Any, packed: PackedKind) -> Any:
    values, places = types.Tuple(packed.members), range(len(packed.members))
    return values(packed), lambda c, builder, s, args: c.make_tuple(
        builder, values, [_member(c, builder, packed, args[0], place) for place in places]
    )


overload(unpacked)(
    lambda values: (
        (lambda values: _unpacked(values))
        if isinstance(values, PackedKind)
        else (lambda values: values)
    )
)
