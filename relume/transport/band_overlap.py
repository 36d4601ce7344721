"""Area of a triangle in each band of an angle (Ben-Artzi 2006, appendix A), for eight bands at a time.

Only the angle at the three corners is needed: if the angle is linear over the triangle, the area below a value y
grows quadratically from the smallest corner to the middle one and from there to the largest. The area beyond the last
band is added to this band: angles are clamped to its end.

The inner sums over bands take half of the projector's time. They have a handful of terms per triangle: too few for the
compiler to vectorize, with scattered writes that may alias. As vectors of eight floats, by Numba intrinsics, they take
half the time (docs/adr/0009-numba-and-embree.md). LLVM lowers them to the registers of the machine.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numba as nb
import numpy as np
from llvmlite import ir
from numba.core import types

from relume.core.numba_options import NO_REFCOUNT
from relume.core.simd import (
    FAST,
    FLOAT,
    NUM,
    VECTOR,
    ArrayPointer,
    broadcast,
    constant_index,
    extract_lane,
    multiply,
    subtract,
    sum_lanes,
    sum_values,
    untyped_intrinsic,
)

_ONE = np.float32(1)
# corners closer than this, in bands, are treated as equal: the formula divides by their distance
_CLOSE = np.float32(1e-4)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def overlap(a, b, c):  # type: ignore[no-untyped-def]
    """Return the parameters of the cumulative area of a triangle with the angles a, b, c at its corners, in bands.

    Returns:
        Smallest, middle and largest angle; 1/((b−a)(c−a)) and 1/((c−b)(c−a)) of the sorted angles.
    """
    smaller, larger = min(a, b), max(a, b)
    low, middle, high = min(smaller, c), max(smaller, min(larger, c)), max(larger, c)
    rising, falling = max(middle - low, _CLOSE), max(high - middle, _CLOSE)
    width = rising + falling
    return low, middle, high, _ONE / (rising * width), _ONE / (falling * width)


_OVERLAP = (types.float32,) * 5  # the return value of `overlap`


def _area_below(
    builder: ir.IRBuilder, y: ir.Value, low: ir.Value, middle: ir.Value, high: ir.Value, rise: ir.Value, fall: ir.Value
) -> ir.Value:
    """Return the fraction of a triangle's area with angles below each of eight values y."""
    from_low, to_high = subtract(builder, y, low), subtract(builder, high, y)
    ones, zeros = ir.Constant(VECTOR, [1.0] * NUM), ir.Constant(VECTOR, [0.0] * NUM)
    upper = subtract(builder, ones, multiply(builder, multiply(builder, to_high, to_high), fall))
    is_upper = builder.fcmp_ordered(">", y, middle, flags=FAST)
    area = builder.select(is_upper, upper, multiply(builder, multiply(builder, from_low, from_low), rise))
    area = builder.select(builder.fcmp_ordered(">=", y, high, flags=FAST), ones, area)
    return builder.select(builder.fcmp_ordered("<=", y, low, flags=FAST), zeros, area)


def _areas(builder: ir.IRBuilder, band: ir.Value, overlap: Sequence[ir.Value]) -> ir.Value:
    """Return the fractions of area below the lower ends of bands [band, band + 8)."""
    first = broadcast(builder, builder.sitofp(band, FLOAT))
    starts = sum_values(builder, [first, ir.Constant(VECTOR, [float(k) for k in range(NUM)])])
    return _area_below(builder, starts, *(broadcast(builder, value) for value in overlap))


def _band_fractions(builder: ir.IRBuilder, band: ir.Value, overlap: Sequence[ir.Value]) -> ir.Value:
    """Return Δ of bands [band, band + 8)."""
    upper = _areas(builder, builder.add(band, constant_index(1)), overlap)
    return subtract(builder, upper, _areas(builder, band, overlap))


@untyped_intrinsic
def deposit(typing_context, out, band, low, middle, high, rise, fall, red, green, blue):  # type: ignore[no-untyped-def]
    """Add (red, green, blue) · Δ of bands [band, band + 8) to `out`.

    Args:
        typing_context: Numba's. out: (3, bands padded by 8) float32. band: first of the eight.
        low, middle, high, rise, fall: shape of the triangle, from `overlap`. red, green, blue: its weights.
    """

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Sequence[ir.Value]) -> ir.Value:
        array, first, *values = arguments
        out_array, fractions = (
            ArrayPointer(context, builder, signature.args[0], array),
            _band_fractions(builder, first, values[:5]),
        )
        for channel, weight in enumerate(values[5:]):
            pointer = out_array.vector_pointer(constant_index(channel), first)
            increment = multiply(builder, fractions, broadcast(builder, weight))
            builder.store(sum_values(builder, [builder.load(pointer, align=4), increment]), pointer, align=4)
        return context.get_dummy_value()

    return types.void(out, types.int64, *_OVERLAP, types.float32, types.float32, types.float32), generate


@untyped_intrinsic
def mean_over_bands(typing_context, decrements, channel, band, low, middle, high, rise, fall):  # type: ignore[no-untyped-def]
    """Return Σ_j A_j (c_{j-1} − c_j) over bands [band, band + 8), with A_j the fraction of area below band j.

    Summed from the band of the smallest corner to a band k beyond the largest, plus c_k, it is the mean Σ Δ_j c_j. It
    needs half as many areas, and steep curves cause no cancellation.

    Args:
        typing_context: Numba's. decrements: c_{j-1} − c_j of a curve. (3, bands padded by 8) float32. channel: its row.
        band: first of the eight. low, middle, high, rise, fall: shape of the triangle, from `overlap`.
    """

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Sequence[ir.Value]) -> ir.Value:
        array, index, first, *overlap = arguments
        eight = ArrayPointer(context, builder, signature.args[0], array).load_vector(index, first)
        return sum_lanes(builder, multiply(builder, _areas(builder, first, overlap), eight))

    return types.float32(decrements, types.int64, types.int64, *_OVERLAP), generate


@untyped_intrinsic
def add_means(typing_context, means, settings, first, band, low, middle, high, rise, fall):  # type: ignore[no-untyped-def]
    """Add Σ Δ_j settings[j] over bands [band, band + 8) to the means of eight settings.

    Args:
        typing_context: Numba's. means: added to. (settings,) float32, a multiple of eight.
        settings: of a curve. (bands padded by 8, settings) float32. first: first of the eight settings.
        band: first of the eight bands. low, middle, high, rise, fall: shape of the triangle, from `overlap`.
    """

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Sequence[ir.Value]) -> ir.Value:
        means_array, array, first_setting, first_band, *overlap = arguments
        fractions = _band_fractions(builder, first_band, overlap)
        settings = ArrayPointer(context, builder, signature.args[1], array)
        pointer = ArrayPointer(context, builder, signature.args[0], means_array).vector_pointer(first_setting)
        terms = [builder.load(pointer, align=4)]
        for lane in range(NUM):
            values = settings.load_vector(builder.add(first_band, constant_index(lane)), first_setting)
            terms.append(multiply(builder, values, broadcast(builder, extract_lane(builder, fractions, lane))))
        builder.store(sum_values(builder, terms), pointer, align=4)
        return context.get_dummy_value()

    return types.void(means, settings, types.int64, types.int64, *_OVERLAP), generate
