"""Lanes: several simulations side by side in the registers of one core.

A SIMD register holds several doubles (four with AVX2, eight with AVX-512), and one instruction
adds, multiplies or compares all of them. Compilers use these instructions only in simple loops; a
robot's equations are not simple loops. Therefore a number in a kernel is `Lanes(W)`: W doubles of W
simulations. An addition of two such numbers is one instruction. So W robots are simulated in little
more than the time of one.

How numba learns the type
    Numba translates a kernel to LLVM, the compiler's own language. LLVM has the types `double` and
    `<8 x double>`. In numba a type is a Python class (Lanes, Mask, Field) and a model that names
    its LLVM type. An operator needs two entries: a template (types of arguments and result) and a
    lowering (the instruction to emit). LLVM's instructions fadd, fmul, fcmp ... take doubles and
    vectors. If registers are narrower than W, LLVM splits an instruction in two or more; the
    results are the same. (The last digit depends on whether the processor can multiply and add with
    one rounding. This holds for single numbers, too.)

What a kernel must not do
    A comparison of lanes gives a `Mask(W)`: W truth values. An `if` cannot branch per lane, so
    numba refuses `if mask`, and also `and`, `or`, `not` and `a < b < c` of lanes. Therefore kernels
    have no branches on lanes. They use &, |, ^, `not_` and parentheses; `select(mask, x, y)` takes
    x or y, both computed, lane by lane. An `if any_lane(mask)` may skip work that no lane needs. An
    unused lane may compute nonsense, such as a division by zero: other lanes are not affected.
    Lanes may be in variables, tuples and fields, but not in lists.

The same kernel for one simulation
    `select`, `any_lane` and the other functions also take floats and booleans. Fields and arrays
    have the same indexing. So the same kernels run in lanes and in LeafSystems with NumPy arrays.
    In type hints, Real is a float or Lanes, Truth is a bool or Mask, and Table is an array or a
    Field.

Arrays of lanes
    A `Field` is the array of a kernel: `field[i, j]` is a number, such as Lanes(W). In Python,
    `lane_table` makes one. In memory it has the shape (..., W), with the lanes of a number side by
    side. All lengths but the first are part of its type, so that the compiler knows the strides.
    Fields need no reference counts. Indices are not checked: -1 is the memory before the field.
"""

from __future__ import annotations

import functools
import math
import operator
from collections.abc import Callable, Sequence
from typing import Any, ClassVar, TypeAlias, TypeVar

import numpy as np
from llvmlite import ir
from numba import from_dtype, types
from numba.core import cgutils
from numba.core.imputils import lower_builtin, lower_cast
from numba.core.typeconv import Conversion
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import (
    NativeValue,
    intrinsic,
    models,
    overload,
    overload_attribute,
    register_model,
    typeof_impl,
    unbox,
)

from tetra_drake.kernels.compiling import inlined

Real: TypeAlias = float
Truth: TypeAlias = bool
Table: TypeAlias = np.ndarray

NamedTupleT = TypeVar("NamedTupleT", bound=tuple)

_intrinsic: Callable[..., Any] = intrinsic

_DOUBLE, _BIT, _INT, _INT32 = ir.DoubleType(), ir.IntType(1), ir.IntType(64), ir.IntType(32)
_ALIGNMENT = 64  # bytes of the widest register


# Numba types and their LLVM types.


class Lanes(types.Type):
    """Numba type of a number in lanes: `width` doubles, one for each of `width` simulations."""

    element: ClassVar[Any] = _DOUBLE
    scalar: ClassVar[Any] = types.float64
    accepted: ClassVar[tuple[type, ...]] = types.Float, types.Integer
    """Types of scalars that stand for the same value in every lane."""

    def __init__(self, width: int) -> None:
        self.width = width
        super().__init__(name=f"{type(self).__name__}({width})")

    def can_convert_from(self, context: Any, other: types.Type) -> Conversion | None:
        """Allows numba to cast the scalar type `other` to lanes; None for another type. So a
        variable that is sometimes a scalar becomes lanes."""
        return Conversion.safe if isinstance(other, self.accepted) else None


class Mask(Lanes):
    """Numba type of a truth value in lanes: `width` bits, one for each of `width` simulations."""

    element: ClassVar[Any] = _BIT
    scalar: ClassVar[Any] = types.boolean
    accepted: ClassVar[tuple[type, ...]] = (types.Boolean,)


@register_model(Lanes)
@register_model(Mask)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Lanes) -> None:
        super().__init__(manager, kind, ir.VectorType(kind.element, kind.width))


@lower_cast(types.Number, Lanes)
@lower_cast(types.Boolean, Mask)
def _to_all_lanes(context: Any, builder: Any, of: Any, to: Lanes, value: Any) -> Any:
    value = context.cast(builder, value, of, to.scalar)
    vector = ir.VectorType(to.element, to.width)
    # Puts the scalar into lane 0 of a vector, then copies lane 0 to all lanes.
    undefined, first = ir.Constant(vector, ir.Undefined), ir.Constant(_INT32, 0)
    every = ir.Constant(ir.VectorType(_INT32, to.width), [0] * to.width)
    return builder.shuffle_vector(builder.insert_element(undefined, value, first), undefined, every)


# Operators: `emit` gives the LLVM instruction for operands of vector type.


def _operator(
    names: Sequence[str],
    emit: Callable[..., Any],
    *,
    operands: int = 2,
    over: type = Lanes,
    to: type = Lanes,
) -> None:
    """Registers functions of the module operator with numba, by their `names`. Operands have the
    type `over`, but one of two may be a scalar; the result has the type `to`. `operands` is their
    number. `emit`, called with the LLVM builder and the operands, writes the instruction."""

    def generic(self: Any, args: tuple[Any, ...], kws: Any) -> Any:
        vector: Any = next((kind for kind in args if type(kind) is over), None)
        if vector is None or not all(
            kind == vector or isinstance(kind, vector.accepted) for kind in args
        ):
            return None
        return signature(to(vector.width), *[vector] * len(args))

    for name in names:
        function = getattr(operator, name)
        infer_global(function)(type(f"_{name}", (AbstractTemplate,), {"generic": generic}))
        lower = lower_builtin(function, *[over] * operands)
        lower(lambda context, builder, s, args: emit(builder, *args))


# Numba needs the in-place names to type x += y; the result is an addition.
_operator(["add", "iadd"], ir.IRBuilder.fadd)
_operator(["sub", "isub"], ir.IRBuilder.fsub)
_operator(["mul", "imul"], ir.IRBuilder.fmul)
_operator(["truediv", "itruediv"], ir.IRBuilder.fdiv)
_operator(["neg"], ir.IRBuilder.fneg, operands=1)
# With NaN, ordered comparisons are false, and != is true.
_operator(["lt"], lambda b, x, y: b.fcmp_ordered("<", x, y), to=Mask)
_operator(["le"], lambda b, x, y: b.fcmp_ordered("<=", x, y), to=Mask)
_operator(["gt"], lambda b, x, y: b.fcmp_ordered(">", x, y), to=Mask)
_operator(["ge"], lambda b, x, y: b.fcmp_ordered(">=", x, y), to=Mask)
_operator(["eq"], lambda b, x, y: b.fcmp_ordered("==", x, y), to=Mask)
_operator(["ne"], lambda b, x, y: b.fcmp_unordered("!=", x, y), to=Mask)
_operator(["and_", "iand"], ir.IRBuilder.and_, over=Mask, to=Mask)
_operator(["or_", "ior"], ir.IRBuilder.or_, over=Mask, to=Mask)
_operator(["xor", "ixor"], ir.IRBuilder.xor, over=Mask, to=Mask)


# Functions of floats for Python. Kernels use the overloads, for floats and lanes.


def _call(builder: Any, name: str, x: Any) -> Any:
    """Emits the call of the LLVM function `name` for `x`, a number or a vector: for "llvm.sqrt" and
    8 doubles, llvm.sqrt.v8f64."""
    is_vector = isinstance(x.type, ir.VectorType)
    count = f"v{x.type.count}" if is_vector else ""
    element = x.type.element if is_vector else x.type
    bits = 32 if element == ir.FloatType() else 64
    kind = ir.FunctionType(x.type, [x.type])
    function = cgutils.get_or_insert_function(builder.module, kind, f"{name}.{count}f{bits}")
    return builder.call(function, [x])


def _llvm_function(name: str) -> Any:
    """Function for kernels that calls the LLVM function `name`, such as "llvm.sqrt", with one
    number or one vector."""

    @_intrinsic
    def function(context: Any, x: types.Type) -> Any:
        return signature(x, x), lambda c, builder, s, args: _call(builder, name, *args)

    return function


_sqrt, _abs, _floor = map(_llvm_function, ("llvm.sqrt", "llvm.fabs", "llvm.floor"))

overload(math.sqrt)(lambda x: (lambda x: _sqrt(x)) if isinstance(x, Lanes) else None)
overload(abs)(lambda x: (lambda x: _abs(x)) if isinstance(x, Lanes) else None)


def floor(x: Real) -> Real:
    """Largest whole number that is not above x, as a float or in lanes."""
    return float(np.floor(x))


overload(floor)(lambda x: lambda x: _floor(x))


def select(mask: Truth, x: Real, y: Real) -> Real:
    """x in lanes where the mask is true, y in other lanes. Both are computed in all lanes. From
    Python also for arrays."""
    return np.where(mask, x, y)[()]  # type: ignore[return-value]


@_intrinsic
def _select(context: Any, mask: types.Type, x: types.Type, y: types.Type) -> Any:
    if not isinstance(mask, (Mask, types.Boolean)):
        return None
    kind = Lanes(mask.width) if isinstance(mask, Mask) else types.float64
    return signature(kind, mask, kind, kind), lambda c, builder, s, args: builder.select(*args)


overload(select)(lambda mask, x, y: lambda mask, x, y: _select(mask, x, y))


@inlined
def minimum(x: Real, y: Real) -> Real:
    """The smaller of two numbers; y if they are equal or one is NaN."""
    return select(x < y, x, y)


@inlined
def maximum(x: Real, y: Real) -> Real:
    """The larger of two numbers; y if they are equal or one is NaN."""
    return select(x > y, x, y)


@inlined
def not_(mask: Truth) -> Truth:
    """Negation of a mask."""
    return mask ^ True


def any_lane(mask: Truth) -> bool:
    """True if a mask is true in at least one lane."""
    return mask


@_intrinsic
def _any(context: Any, mask: Mask) -> Any:
    bits = ir.IntType(mask.width)
    return signature(types.boolean, mask), lambda c, builder, s, args: builder.icmp_unsigned(
        "!=", builder.bitcast(args[0], bits), ir.Constant(bits, 0)
    )


overload(any_lane)(
    lambda mask: (lambda mask: _any(mask)) if isinstance(mask, Mask) else (lambda mask: mask)
)


def inverse_sqrt(x: Real) -> Real:
    """1 / sqrt(x), with an error of at most 2 units in the last place for x from 1e-37 to 1e38.

    The result is 0 above 3.4e38, and NaN for 0, negative numbers and infinity. Division and square
    root of doubles are slow. This function uses singles, and two steps of Newton's method for the
    precision. It takes a third of the time.
    """
    return 1.0 / math.sqrt(x)


@_intrinsic
def _inverse_sqrt_in_single(context: Any, x: types.Type) -> Any:
    def emit(c: Any, builder: Any, s: Any, args: Any) -> Any:
        single: Any = ir.FloatType()
        one: Any = 1.0
        if isinstance(x, Lanes):
            single, one = ir.VectorType(single, x.width), [1.0] * x.width
        root = _call(builder, "llvm.sqrt", builder.fptrunc(args[0], single))
        return builder.fpext(builder.fdiv(ir.Constant(single, one), root), args[0].type)

    return signature(x, x), emit


def _inverse_sqrt_by_newton(x):  # type: ignore[no-untyped-def]
    y = _inverse_sqrt_in_single(x)
    half = 0.5 * x
    y += y * (0.5 - half * y * y)
    y += y * (0.5 - half * y * y)
    return y


overload(inverse_sqrt)(lambda x: _inverse_sqrt_by_newton)


_PI_HIGH, _PI_LOW = 3.1415926534682512, 1.2154201013012384e-10
"""A part of pi with 33 bits, and the rest: multiples up to 2^20 of the first have no rounding."""


@inlined
def sine(x: Real) -> Real:
    """sin(x) for numbers or lanes, with an error of at most 4e-16 up to 1e5, by Taylor's series in
    half a turn. (numba calls the C library for each lane.)"""
    half_turns = floor(x * (1.0 / math.pi) + 0.5)
    y = (x - half_turns * _PI_HIGH) - half_turns * _PI_LOW
    odd, z = half_turns - 2.0 * floor(0.5 * half_turns), y * y
    series = 1.0 - z * (1.0 / 272.0) * (1.0 - z * (1.0 / 342.0))
    for divisor in (210.0, 156.0, 110.0, 72.0, 42.0, 20.0, 6.0):
        series = 1.0 - z * (1.0 / divisor) * series
    return (1.0 - 2.0 * odd) * y * series


@inlined
def exponential(x: Real) -> Real:
    """exp(x) for numbers or lanes, with a relative error of at most 1e-13 up to 6, by Taylor's
    series of a 64th of x."""
    y, series = x * (1.0 / 64.0), 1.0 + 0.0 * x
    for divisor in (8.0, 7.0, 6.0, 5.0, 4.0, 3.0, 2.0, 1.0):
        series = 1.0 + y * (1.0 / divisor) * series
    for _ in range(6):
        series = series * series
    return series


def gather(numbers: Table, index: Real, offset: int) -> Real:
    """Reads numbers[index + offset], with a separate index for each lane. `numbers` (size,) has no
    lanes: all simulations share it. `index` has whole numbers, as floats."""
    return numbers[int(index) + offset]


@_intrinsic
def _gather(context: Any, numbers: Any, index: Any, offset: Any) -> Any:
    def emit(c: Any, builder: Any, s: Any, args: Any) -> Any:
        field = cgutils.create_struct_proxy(numbers)(c, builder, args[0])
        first = builder.gep(field.data, [args[2]])
        vector = ir.VectorType(_INT, index.width)
        indices, gathered = builder.fptosi(args[1], vector), ir.Constant(args[1].type, ir.Undefined)
        for i in range(index.width):
            lane = ir.Constant(_INT32, i)
            number = builder.load(builder.gep(first, [builder.extract_element(indices, lane)]))
            gathered = builder.insert_element(gathered, number, lane)
        return gathered

    return signature(index, numbers, index, types.intp), emit


overload(gather)(
    lambda numbers, index, offset: (
        (lambda numbers, index, offset: _gather(numbers, index, offset))
        if isinstance(index, Lanes)
        else (lambda numbers, index, offset: numbers[int(index) + offset])
    )
)


def named(kind: type[NamedTupleT], table: Table) -> NamedTupleT:
    """NamedTuple of the class `kind` from a table (fields, ...): row i of the table is the value of
    the i-th field."""
    return kind(*table)


@_intrinsic
def _named(context: Any, kind: Any, table: Any) -> Any:
    item = context.resolve_function_type(operator.getitem, (table, types.intp), {})
    count = len(kind.instance_class._fields)
    record = types.NamedUniTuple(item.return_type, count, kind.instance_class)

    def emit(c: Any, builder: Any, s: Any, args: Any) -> Any:
        get = c.get_function(operator.getitem, item)
        numbers = [get(builder, (args[1], ir.Constant(_INT, i))) for i in range(count)]
        return c.make_tuple(builder, record, numbers)

    return signature(record, kind, table), emit


overload(named)(lambda kind, table: lambda kind, table: _named(kind, table))


# Fields: a pointer and the lengths of all dimensions. The type may fix some lengths.


class Field(types.Type):
    """Numba type of an array in kernels. Each of its numbers is in lanes, or single.

    `number` is the numba type of a number. `lengths` has the length of each dimension; None if the
    type does not fix it.
    """

    def __init__(self, number: types.Type, lengths: tuple[int | None, ...]) -> None:
        self.number, self.lengths = number, lengths
        super().__init__(name=f"Field({number}, {lengths})")


class FieldArray:
    """Wrapper that passes a contiguous array to kernels, which see a Field.

    With `width`, the last axis of the array has this length: it is the lanes of a number. Without
    `width`, the numbers have no lanes.

    Numbers are float64, or int64 without lanes. The numba type `kind` contains all lengths but the
    first, so that a kernel is compiled anew for other lengths; with `any_size` it contains none.
    Raises ValueError for another array, or if it is not contiguous.
    """

    def __init__(
        self, array: np.ndarray, width: int | None = None, *, any_size: bool = False
    ) -> None:
        proper = array.dtype == np.float64 or (width is None and array.dtype == np.int64)
        if not (proper and array.flags.c_contiguous and width in (None, array.shape[-1])):
            raise ValueError(f"no field: {array.dtype}, {array.shape}, {array.strides}, {width=}")
        self.array, self.address = array, array.ctypes.data
        self.shape = array.shape if width is None else array.shape[:-1]
        typed = (None,) * len(self.shape) if any_size else (None, *self.shape[1:])
        self.kind = _field(array.dtype, width, typed)


@functools.cache  # numba needs longer to make a type than to find it
def _field(dtype: np.dtype, width: int | None, lengths: tuple[int | None, ...]) -> Field:
    return Field(from_dtype(dtype) if width is None else Lanes(width), lengths)


def lane_table(shape: tuple[int, ...], width: int, *, any_size: bool = False) -> FieldArray:
    """Table of zeros in lanes, for kernels. `shape` is the shape that kernels see; the attribute
    `array` has the shape (*shape, width). For `any_size` see FieldArray."""
    size = math.prod(shape) * width
    buffer = np.zeros(size + _ALIGNMENT // 8)
    first = -buffer.ctypes.data % _ALIGNMENT // 8
    array = buffer[first : first + size].reshape(*shape, width)
    return FieldArray(array, width, any_size=any_size)


@register_model(Field)
class _FieldModel(models.StructModel):
    def __init__(self, manager: Any, kind: Field) -> None:
        lengths = types.UniTuple(types.intp, len(kind.lengths))
        members = [("data", types.CPointer(kind.number)), ("lengths", lengths)]
        super().__init__(manager, kind, members)


typeof_impl.register(FieldArray)(lambda value, context: value.kind)


@unbox(Field)
def _unbox(kind: Field, value: Any, c: Any) -> NativeValue:
    field = cgutils.create_struct_proxy(kind)(c.context, c.builder)
    address = c.pyapi.object_getattr_string(value, "address")
    field.data = c.builder.inttoptr(c.pyapi.long_as_longlong(address), field.data.type)
    shape = c.pyapi.object_getattr_string(value, "shape")
    lengths = types.UniTuple(types.intp, len(kind.lengths))
    field.lengths = c.pyapi.to_native_value(lengths, shape).value
    c.pyapi.decref(address)
    c.pyapi.decref(shape)
    return NativeValue(field._getvalue())


def _lengths(context: Any, builder: Any, kind: Field, value: Any) -> list[Any]:
    """Emits the lengths of the dimensions of the field `value`; constants if the type `kind` fixes
    them."""
    field = cgutils.create_struct_proxy(kind)(context, builder, value)
    lengths = cgutils.unpack_tuple(builder, field.lengths)
    for axis, length in enumerate(kind.lengths):
        if length is not None:
            lengths[axis] = ir.Constant(_INT, length)
    return lengths


def _place(context: Any, builder: Any, kind: Field, value: Any, index: Any) -> Any:
    """Emits the address of value[index], where `value` is a field of the type `kind`. The flag nsw
    promises LLVM that the arithmetic of integers does not overflow."""
    indices = [index] if len(kind.lengths) == 1 else cgutils.unpack_tuple(builder, index)
    lengths = _lengths(context, builder, kind, value)
    offset = indices[0]
    for length, i in zip(lengths[1:], indices[1:], strict=True):
        offset = builder.add(builder.mul(offset, length, flags=("nsw",)), i, flags=("nsw",))
    field = cgutils.create_struct_proxy(kind)(context, builder, value)
    return builder.gep(field.data, [offset], inbounds=True)


def _index_kind(kind: types.Type, index: Any) -> types.Type | None:
    """Numba type that an index of the type `index` is cast to; None if it is no valid index of an
    array of the type `kind`, or if that is no Field."""
    if not isinstance(kind, Field):
        return None
    count = len(kind.lengths)
    if count == 1:
        return types.intp if isinstance(index, types.Integer) else None
    is_tuple = isinstance(index, types.BaseTuple)
    if not is_tuple or len(index.types) != count:
        return None
    if not all(isinstance(i, types.Integer) for i in index.types):
        return None
    return types.UniTuple(types.intp, count)


@infer_global(operator.getitem)
class _GetItem(AbstractTemplate):
    def generic(self, args: Any, kws: Any) -> Any:
        index = _index_kind(args[0], args[1])
        return index and signature(args[0].number, args[0], index)


@infer_global(operator.setitem)
class _SetItem(AbstractTemplate):
    def generic(self, args: Any, kws: Any) -> Any:
        index = _index_kind(args[0], args[1])
        return index and signature(types.none, args[0], index, args[0].number)


# Without `align`, LLVM assumes that a vector is at a multiple of its size, and crashes otherwise.


lower_builtin(operator.getitem, Field, types.Any)(
    lambda context, builder, kinds, args: builder.load(
        _place(context, builder, kinds.args[0], *args), align=8
    )
)


@lower_builtin(operator.setitem, Field, types.Any, types.Any)
def _lower_setitem(context: Any, builder: Any, kinds: Any, args: Any) -> Any:
    field, index, number = args
    builder.store(number, _place(context, builder, kinds.args[0], field, index), align=8)
    return context.get_dummy_value()


@_intrinsic
def by_lane(context: Any, field: Any) -> Any:
    """View of a field of lanes (...) as a field of floats (..., W), whose last axis is the lanes.
    Kernels use it to read and write the numbers of a single lane."""
    width = field.number.width
    floats = Field(types.float64, (*field.lengths, width))

    def emit(c: Any, builder: Any, s: Any, args: Any) -> Any:
        of = cgutils.create_struct_proxy(field)(c, builder, args[0])
        to = cgutils.create_struct_proxy(floats)(c, builder)
        to.data = builder.bitcast(of.data, to.data.type)
        lengths = [*_lengths(c, builder, field, args[0]), ir.Constant(_INT, width)]
        to.lengths = c.make_tuple(builder, types.UniTuple(types.intp, len(lengths)), lengths)
        return to._getvalue()

    return signature(floats, field), emit


@_intrinsic
def _shape(context: Any, field: Field) -> Any:
    lengths = types.UniTuple(types.intp, len(field.lengths))
    return signature(lengths, field), lambda c, builder, s, args: c.make_tuple(
        builder, lengths, _lengths(c, builder, field, args[0])
    )


overload_attribute(Field, "shape")(lambda field: lambda field: _shape(field))


def _size(field):  # type: ignore[no-untyped-def]
    count = 1
    for length in _shape(field):
        count *= length
    return count


overload_attribute(Field, "size")(lambda field: _size)
