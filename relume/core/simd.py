"""SIMD building blocks for Numba intrinsics: LLVM vectors of eight floats, for inner sums that LLVM vectorizes poorly.

LLVM cannot prove that arrays do not alias, and checks this before each short loop. It lowers these vectors to the
registers of the machine.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic

NUM = 8

FLOAT, WORD = ir.FloatType(), ir.IntType(64)
VECTOR = ir.VectorType(FLOAT, NUM)
_INDEX = ir.IntType(32)
_BYTE = ir.IntType(8)
_BYTE_VECTOR, _INDEX_VECTOR = ir.VectorType(_BYTE, NUM), ir.VectorType(_INDEX, NUM)
FAST = ("fast",)
_L2_LOCALITY = 2  # prefetch to L2: the data of 64 rays does not fit in L1
_builders: Any = cgutils  # has no type annotations
untyped_intrinsic: Any = intrinsic  # it is annotated with the type of the generator, not of the function kernels call


def constant_index(value: int) -> ir.Value:
    """A constant index."""
    return ir.Constant(WORD, value)


class ArrayPointer:
    """A contiguous array argument of an intrinsic.

    Args:
        context, builder: context and builder of the intrinsic. array_type: Numba type of the array.
        array: its LLVM value.
    """

    def __init__(self, context: Any, builder: ir.IRBuilder, array_type: Any, array: ir.Value) -> None:
        struct = context.make_array(array_type)(context, builder, array)
        self._context, self._builder, self._data = context, builder, struct.data
        self._shape = _builders.unpack_tuple(builder, struct.shape)
        self._strides = _builders.unpack_tuple(builder, struct.strides)

    def pointer(self, index: Sequence[ir.Value]) -> ir.Value:
        """Pointer to an item."""
        return _builders.get_item_pointer2(
            self._context, self._builder, self._data, self._shape, self._strides, "C", index
        )

    def load(self, *index: ir.Value) -> ir.Value:
        """Load an item."""
        return self._builder.load(self.pointer(index))

    def vector_pointer(self, *index: ir.Value) -> ir.Value:
        """Pointer to eight floats along the last dimension, starting at an index."""
        return self._builder.bitcast(self.pointer(index), VECTOR.as_pointer())

    def load_vector(self, *index: ir.Value) -> ir.Value:
        """Load eight floats along the last dimension, starting at an index."""
        return self._builder.load(self.vector_pointer(*index), align=4)

    def load_int8_vector(self, *index: ir.Value) -> ir.Value:
        """Load eight int8 values, starting at an index, as floats."""
        loaded = self._builder.load(self._builder.bitcast(self.pointer(index), _BYTE_VECTOR.as_pointer()), align=1)
        return self._builder.sitofp(self._builder.sext(loaded, _INDEX_VECTOR), VECTOR)


def shuffle(builder: ir.IRBuilder, a: ir.Value, b: ir.Value, lanes: Iterable[int]) -> ir.Value:
    """Select lanes of two vectors, `a` and `b`; lanes of `b` count from eight. builder: LLVM's"""
    return builder.shuffle_vector(a, b, ir.Constant(_INDEX_VECTOR, list(lanes)))


def broadcast(builder: ir.IRBuilder, value: ir.Value) -> ir.Value:
    """Put the same float into all lanes."""
    undefined = ir.Constant(VECTOR, ir.Undefined)
    return shuffle(builder, builder.insert_element(undefined, value, ir.Constant(_INDEX, 0)), undefined, [0] * NUM)


def extract_lane(builder: ir.IRBuilder, vector: ir.Value, lane: int) -> ir.Value:
    """Extract one lane of a vector. builder: LLVM's"""
    return builder.extract_element(vector, ir.Constant(_INDEX, lane))


def multiply(builder: ir.IRBuilder, a: ir.Value, b: ir.Value) -> ir.Value:
    """Multiply a · b, scalars or lanes. builder: LLVM's"""
    return builder.fmul(a, b, flags=FAST)


def subtract(builder: ir.IRBuilder, a: ir.Value, b: ir.Value) -> ir.Value:
    """Subtract a − b, scalars or lanes. builder: LLVM's"""
    return builder.fsub(a, b, flags=FAST)


def sum_values(builder: ir.IRBuilder, values: Sequence[ir.Value]) -> ir.Value:
    """Σ of floats or vectors."""
    accumulator = values[0]
    for value in values[1:]:
        accumulator = builder.fadd(accumulator, value, flags=FAST)
    return accumulator


def dot(builder: ir.IRBuilder, a_values: Iterable[ir.Value], b_values: Iterable[ir.Value]) -> ir.Value:
    """Sum a · b over a_values and b_values, floats or vectors, lane by lane. builder: LLVM's"""
    return sum_values(builder, [multiply(builder, a, b) for a, b in zip(a_values, b_values, strict=True)])


def sum_lanes(builder: ir.IRBuilder, vector: ir.Value) -> ir.Value:
    """Horizontal sum of a vector."""
    function_type = ir.FunctionType(FLOAT, [FLOAT, VECTOR])
    add_up = _builders.get_or_insert_function(builder.module, function_type, f"llvm.vector.reduce.fadd.v{NUM}f32")
    return builder.call(add_up, [ir.Constant(FLOAT, 0.0), vector], fastmath=FAST)


@untyped_intrinsic
def prefetch(typing_context, array, index):  # type: ignore[no-untyped-def]
    """Prefetch the cache line of an item that will be read soon.

    Args:
        typing_context: Numba's. array: contiguous. index: index of the item, a tuple.
    """

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Sequence[ir.Value]) -> ir.Value:
        index = _builders.unpack_tuple(builder, arguments[1])
        index_types = signature.args[1]
        indices = [
            context.cast(builder, *typed_index, types.int64) for typed_index in zip(index, index_types, strict=True)
        ]
        pointer = ArrayPointer(context, builder, signature.args[0], arguments[0]).pointer(indices)
        function_type = ir.FunctionType(ir.VoidType(), [_BYTE.as_pointer(), *[_INDEX] * 3])
        prefetch_function = _builders.get_or_insert_function(builder.module, function_type, "llvm.prefetch.p0i8")
        hints = [ir.Constant(_INDEX, value) for value in (0, _L2_LOCALITY, 1)]  # read access; locality; data cache
        builder.call(prefetch_function, [builder.bitcast(pointer, _BYTE.as_pointer()), *hints])
        return context.get_dummy_value()

    return types.void(array, index), generate
