"""How much of a triangle lies in each band of an angle: Ben-Artzi 2006, appendix A; eight bands at once.

Only the angle at the three corners is needed: where the angle is linear over the triangle, the area below a value y
grows quadratically from the smallest corner to the middle one and from there to the largest. What lies beyond the last
band counts to it: angles are clamped to its end.

Half of the projector's time goes into the inner sums over bands, a handful for each triangle: too few for the compiler
to vectorise by itself, and scattered where it cannot know that they do not alias. Written as vectors of eight floats,
by Numba intrinsics, they take half the time (docs/adr/0017-eight-bands-at-once.md). LLVM lowers them to whatever
registers the machine has.
"""

from __future__ import annotations

from typing import Any

import numba as nb
import numpy as np
from llvmlite import ir
from numba.core import types

from relume.uncounted import UNCOUNTED
from relume.vector_code import (
    FAST,
    FLOAT,
    NUM,
    VECTOR,
    Array,
    difference,
    extracted,
    kernel_part,
    product,
    spread,
    sum_of,
    total,
    word,
)

_ONE = np.float32(1)
# corners closer than this, in bands, count as one: the formula divides by their distance
_CLOSE = np.float32(1e-4)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def overlap_of(a, b, c):  # type: ignore[no-untyped-def]
    """Compute what the share below an angle needs of a triangle, whose corners have the angles a, b, c in bands.

    Returns:
        Smallest, middle and largest angle of corners in any order; 1/((b−a)(c−a)) and 1/((c−b)(c−a)) of the sorted.
    """
    smaller, larger = min(a, b), max(a, b)
    low, middle, high = min(smaller, c), max(smaller, min(larger, c)), max(larger, c)
    rising, falling = max(middle - low, _CLOSE), max(high - middle, _CLOSE)
    width = rising + falling
    return low, middle, high, _ONE / (rising * width), _ONE / (falling * width)


_OVERLAP = (types.float32,) * 5  # what `overlap_of` returns


def _area_below(builder: Any, y: Any, low: Any, middle: Any, high: Any, rise: Any, fall: Any) -> Any:
    """Compute the share of a triangle's area where the angle is below each of eight values y."""
    risen, left = difference(builder, y, low), difference(builder, high, y)
    all_of_it, nothing = ir.Constant(VECTOR, [1.0] * NUM), ir.Constant(VECTOR, [0.0] * NUM)
    upper = difference(builder, all_of_it, product(builder, product(builder, left, left), fall))
    is_upper = builder.fcmp_ordered(">", y, middle, flags=FAST)
    area = builder.select(is_upper, upper, product(builder, product(builder, risen, risen), rise))
    area = builder.select(builder.fcmp_ordered(">=", y, high, flags=FAST), all_of_it, area)
    return builder.select(builder.fcmp_ordered("<=", y, low, flags=FAST), nothing, area)


def _areas(builder: Any, band: Any, overlap: Any) -> Any:
    """Compute the shares of area below the beginnings of bands [band, band + 8)."""
    first = spread(builder, builder.sitofp(band, FLOAT))
    places = total(builder, [first, ir.Constant(VECTOR, [float(k) for k in range(NUM)])])
    return _area_below(builder, places, *(spread(builder, value) for value in overlap))


def _shares(builder: Any, band: Any, overlap: Any) -> Any:
    """Compute Δ of bands [band, band + 8)."""
    upper = _areas(builder, builder.add(band, word(1)), overlap)
    return difference(builder, upper, _areas(builder, band, overlap))


@kernel_part
def deposit_eight(typing_context, out, band, low, middle, high, rise, fall, red, green, blue):  # type: ignore[no-untyped-def]
    """Add (red, green, blue) · Δ of bands [band, band + 8) to `out`.

    Args:
        typing_context: Numba's. out: (3, bands padded by 8) float32. band: the first of the eight.
        low, middle, high, rise, fall: the triangle's, from `overlap_of`. red, green, blue: its weights.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array, first, *values = arguments
        found, shares = Array(context, builder, signature.args[0], array), _shares(builder, first, values[:5])
        for channel, weight in enumerate(values[5:]):
            place = found.place_of_eight(word(channel), first)
            part = product(builder, shares, spread(builder, weight))
            builder.store(total(builder, [builder.load(place, align=4), part]), place, align=4)
        return context.get_dummy_value()

    return types.void(out, types.int64, *_OVERLAP, types.float32, types.float32, types.float32), generate


@kernel_part
def mean_of_eight(typing_context, falls, channel, band, low, middle, high, rise, fall):  # type: ignore[no-untyped-def]
    """Compute Σ_j A_j (c_{j-1} − c_j) over bands [band, band + 8), with A_j the share of area below band j.

    Of all bands from the smallest corner's to a last one k beyond the largest's, with c_k, it is the mean Σ Δ_j c_j:
    half of the areas, and where a curve falls nothing is a difference.

    Args:
        typing_context: Numba's. falls: c_{j-1} − c_j of a curve. (3, bands padded by 8) float32. channel: its row.
        band: the first of the eight. low, middle, high, rise, fall: the triangle's, from `overlap_of`.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array, index, first, *overlap = arguments
        eight = Array(context, builder, signature.args[0], array).eight(index, first)
        return sum_of(builder, product(builder, _areas(builder, first, overlap), eight))

    return types.float32(falls, types.int64, types.int64, *_OVERLAP), generate


@kernel_part
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
        settings = Array(context, builder, signature.args[1], array)
        place = Array(context, builder, signature.args[0], means_array).place_of_eight(first_setting)
        parts = [builder.load(place, align=4)]
        for lane in range(NUM):
            values = settings.eight(builder.add(first_band, word(lane)), first_setting)
            parts.append(product(builder, values, spread(builder, extracted(builder, shares, lane))))
        builder.store(total(builder, parts), place, align=4)
        return context.get_dummy_value()

    return types.void(means, settings, types.int64, types.int64, *_OVERLAP), generate
