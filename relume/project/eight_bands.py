"""Eight bands of a triangle's overlap at once, as Numba intrinsics on vectors of eight floats.

Half of the projector's time goes into the inner sums over bands, a handful for each triangle: too few for the compiler
to vectorise by itself, and scattered where it cannot know that they do not alias. Written as vectors they take half
the time (docs/adr/0017-eight-bands-at-once.md). LLVM lowers them to whatever registers the machine has.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic

NUM = 8

_FLOAT = ir.FloatType()
_VECTOR = ir.VectorType(_FLOAT, NUM)
_INDEX = ir.IntType(32)
_FAST = ("fast",)
_builders: Any = cgutils  # carries no types
_intrinsic: Any = intrinsic  # its declared type is that of the generator, not of what kernels call
_OVERLAP = (types.float32,) * 5  # what `overlap_of` returns


def _spread(builder: Any, value: Any) -> Any:
    """Put the same float into all lanes."""
    undefined = ir.Constant(_VECTOR, ir.Undefined)
    one = builder.insert_element(undefined, value, ir.Constant(_INDEX, 0))
    return builder.shuffle_vector(one, undefined, ir.Constant(ir.VectorType(_INDEX, NUM), [0] * NUM))


def _area_below(builder: Any, y: Any, low: Any, middle: Any, high: Any, rise: Any, fall: Any) -> Any:
    """Compute the share of a triangle's area where the angle is below each of eight values y."""

    def subtract(a: Any, b: Any) -> Any:
        return builder.fsub(a, b, flags=_FAST)

    def multiply(a: Any, b: Any) -> Any:
        return builder.fmul(a, b, flags=_FAST)

    risen, left = subtract(y, low), subtract(high, y)
    all_of_it, nothing = ir.Constant(_VECTOR, [1.0] * NUM), ir.Constant(_VECTOR, [0.0] * NUM)
    upper = subtract(all_of_it, multiply(multiply(left, left), fall))
    is_upper = builder.fcmp_ordered(">", y, middle, flags=_FAST)
    area = builder.select(is_upper, upper, multiply(multiply(risen, risen), rise))
    area = builder.select(builder.fcmp_ordered(">=", y, high, flags=_FAST), all_of_it, area)
    return builder.select(builder.fcmp_ordered("<=", y, low, flags=_FAST), nothing, area)


def _shares(builder: Any, band: Any, overlap: Any) -> Any:
    """Compute Δ of bands [band, band + 8)."""
    spread = [_spread(builder, value) for value in overlap]
    first = _spread(builder, builder.sitofp(band, _FLOAT))
    lower = builder.fadd(first, ir.Constant(_VECTOR, [float(k) for k in range(NUM)]), flags=_FAST)
    upper = builder.fadd(first, ir.Constant(_VECTOR, [float(k + 1) for k in range(NUM)]), flags=_FAST)
    above, below = _area_below(builder, upper, *spread), _area_below(builder, lower, *spread)
    return builder.fsub(above, below, flags=_FAST)


def _address(context: Any, builder: Any, array_type: Any, array: Any, *index: Any) -> Any:
    """Find where the eight floats from an index on stand, in the last dimension."""
    struct = context.make_array(array_type)(context, builder, array)
    shape, strides = _builders.unpack_tuple(builder, struct.shape), _builders.unpack_tuple(builder, struct.strides)
    item = _builders.get_item_pointer2(context, builder, struct.data, shape, strides, "C", index)
    return builder.bitcast(item, _VECTOR.as_pointer())


@_intrinsic
def deposit_eight(typing_context, out, band, low, middle, high, rise, fall, red, green, blue):  # type: ignore[no-untyped-def]
    """Add (red, green, blue) · Δ of bands [band, band + 8) to `out`.

    Args:
        typing_context: Numba's. out: (3, bands padded by 8) float32. band: the first of the eight.
        low, middle, high, rise, fall: the triangle's, from `overlap_of`. red, green, blue: its weights.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array, first, *values = arguments
        shares = _shares(builder, first, values[:5])
        for channel, weight in enumerate(values[5:]):
            index = ir.Constant(ir.IntType(64), channel)
            address = _address(context, builder, signature.args[0], array, index, first)
            eight = builder.load(address, align=4)
            part = builder.fmul(shares, _spread(builder, weight), flags=_FAST)
            builder.store(builder.fadd(eight, part, flags=_FAST), address, align=4)
        return context.get_dummy_value()

    return types.void(out, types.int64, *_OVERLAP, types.float32, types.float32, types.float32), generate


@_intrinsic
def mean_of_eight(typing_context, bands, channel, band, low, middle, high, rise, fall):  # type: ignore[no-untyped-def]
    """Compute Σ Δ_j bands[channel, j] over [band, band + 8).

    Args:
        typing_context: Numba's. bands: of a curve. (3, bands padded by 8) float32. channel: its row.
        band: the first of the eight. low, middle, high, rise, fall: the triangle's, from `overlap_of`.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array, index, first, *overlap = arguments
        shares = _shares(builder, first, overlap)
        eight = builder.load(_address(context, builder, signature.args[0], array, index, first), align=4)
        kind = ir.FunctionType(_FLOAT, [_FLOAT, _VECTOR])
        add_up = _builders.get_or_insert_function(builder.module, kind, f"llvm.vector.reduce.fadd.v{NUM}f32")
        product = builder.fmul(shares, eight, flags=_FAST)
        return builder.call(add_up, [ir.Constant(_FLOAT, 0.0), product], fastmath=_FAST)

    return types.float32(bands, types.int64, types.int64, *_OVERLAP), generate


@_intrinsic
def add_means_of_eight(typing_context, means, settings, first, band, low, middle, high, rise, fall):  # type: ignore[no-untyped-def]
    """Add Σ Δ_j settings[j] over bands [band, band + 8) to the means, eight settings from the first on.

    Args:
        typing_context: Numba's. means: added to. (settings,) float32, a multiple of eight of them.
        settings: of a curve. (bands padded by 8, settings) float32. first: the first of the eight settings.
        band: the first of the eight bands. low, middle, high, rise, fall: the triangle's, from `overlap_of`.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        means_array, array, first_setting, first_band, *overlap = arguments
        shares = _shares(builder, first_band, overlap)
        address = _address(context, builder, signature.args[0], means_array, first_setting)
        total = builder.load(address, align=4)
        for lane in range(NUM):
            share = builder.extract_element(shares, ir.Constant(_INDEX, lane))
            row = builder.add(first_band, ir.Constant(ir.IntType(64), lane))
            values = builder.load(_address(context, builder, signature.args[1], array, row, first_setting), align=4)
            part = builder.fmul(values, _spread(builder, share), flags=_FAST)
            total = builder.fadd(total, part, flags=_FAST)
        builder.store(total, address, align=4)
        return context.get_dummy_value()

    return types.void(means, settings, types.int64, types.int64, *_OVERLAP), generate
