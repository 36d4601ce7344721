"""Parts of Numba intrinsics on LLVM vectors of eight floats, for inner sums that the compiler does not vectorise well.

It cannot know that arrays are not the same memory, and looks before each short loop. LLVM lowers these vectors to
whatever registers the machine has.
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
_BYTES, _WHOLE = ir.VectorType(_BYTE, NUM), ir.VectorType(_INDEX, NUM)
FAST = ("fast",)
_NEAR = 2  # the second cache: what 64 rays read would not all stay in the first
_builders: Any = cgutils  # carries no types
kernel_part: Any = intrinsic  # its declared type is that of the generator, not of what kernels call


def word(value: int) -> Any:
    """A constant index."""
    return ir.Constant(WORD, value)


class Array:
    """A contiguous array that an intrinsic was handed.

    Args:
        context, builder: of the intrinsic. kind: type of the array. array: itself.
    """

    def __init__(self, context: Any, builder: Any, kind: Any, array: Any) -> None:
        struct = context.make_array(kind)(context, builder, array)
        self._context, self._builder, self._data = context, builder, struct.data
        self._shape = _builders.unpack_tuple(builder, struct.shape)
        self._strides = _builders.unpack_tuple(builder, struct.strides)

    def place(self, index: Sequence[Any]) -> Any:
        """Where an item stands."""
        return _builders.get_item_pointer2(
            self._context, self._builder, self._data, self._shape, self._strides, "C", index
        )

    def one(self, *index: Any) -> Any:
        """An item."""
        return self._builder.load(self.place(index))

    def place_of_eight(self, *index: Any) -> Any:
        """Where the eight floats from an index on stand, in the last dimension."""
        return self._builder.bitcast(self.place(index), VECTOR.as_pointer())

    def eight(self, *index: Any) -> Any:
        """The eight floats from an index on."""
        return self._builder.load(self.place_of_eight(*index), align=4)

    def eight_bytes(self, *index: Any) -> Any:
        """Eight int8 from an index on, as floats."""
        found = self._builder.load(self._builder.bitcast(self.place(index), _BYTES.as_pointer()), align=1)
        return self._builder.sitofp(self._builder.sext(found, _WHOLE), VECTOR)


def picked(builder: Any, one: Any, other: Any, places: Iterable[int]) -> Any:
    """Take lanes of two vectors, `one` and `other`; places of the second are counted from eight on. builder: LLVM's"""
    return builder.shuffle_vector(one, other, ir.Constant(_WHOLE, list(places)))


def spread(builder: Any, value: Any) -> Any:
    """Put the same float into all lanes."""
    undefined = ir.Constant(VECTOR, ir.Undefined)
    return picked(builder, builder.insert_element(undefined, value, ir.Constant(_INDEX, 0)), undefined, [0] * NUM)


def extracted(builder: Any, vector: Any, lane: int) -> Any:
    """One lane of a vector. builder: LLVM's"""
    return builder.extract_element(vector, ir.Constant(_INDEX, lane))


def product(builder: Any, one: Any, other: Any) -> Any:
    """one · other, of floats or of all lanes. builder: LLVM's"""
    return builder.fmul(one, other, flags=FAST)


def difference(builder: Any, one: Any, other: Any) -> Any:
    """one − other, of floats or of all lanes. builder: LLVM's"""
    return builder.fsub(one, other, flags=FAST)


def total(builder: Any, values: Sequence[Any]) -> Any:
    """Σ of some floats or vectors."""
    found = values[0]
    for value in values[1:]:
        found = builder.fadd(found, value, flags=FAST)
    return found


def inner(builder: Any, ones: Iterable[Any], others: Iterable[Any]) -> Any:
    """Σ one · other of ones and others, floats or vectors, lane by lane. builder: LLVM's"""
    return total(builder, [product(builder, a, b) for a, b in zip(ones, others, strict=True)])


def sum_of(builder: Any, vector: Any) -> Any:
    """Sum of all lanes."""
    kind = ir.FunctionType(FLOAT, [FLOAT, VECTOR])
    add_up = _builders.get_or_insert_function(builder.module, kind, f"llvm.vector.reduce.fadd.v{NUM}f32")
    return builder.call(add_up, [ir.Constant(FLOAT, 0.0), vector], fastmath=FAST)


@kernel_part
def call_for(typing_context, array, index):  # type: ignore[no-untyped-def]
    """Ask for the line of the cache that an item is in, which is read soon.

    Args:
        typing_context: Numba's. array: contiguous. index: of the item, a tuple.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        index = _builders.unpack_tuple(builder, arguments[1])
        kinds = signature.args[1]
        numbers = [context.cast(builder, *of, types.int64) for of in zip(index, kinds, strict=True)]
        place = Array(context, builder, signature.args[0], arguments[0]).place(numbers)
        kind = ir.FunctionType(ir.VoidType(), [_BYTE.as_pointer(), *[_INDEX] * 3])
        prefetch = _builders.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0i8")
        how = [ir.Constant(_INDEX, value) for value in (0, _NEAR, 1)]  # to be read; how near; data
        builder.call(prefetch, [builder.bitcast(place, _BYTE.as_pointer()), *how])
        return context.get_dummy_value()

    return types.void(array, index), generate
