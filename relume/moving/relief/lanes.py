"""The two sums of a ray that sees a texel, as vectors of eight: of numbers over texels and sides, and under its light.

As plain loops they take twice the time: see `relume.vector_code`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import types
from numpy.polynomial import chebyshev, polynomial
from numpy.typing import NDArray

from relume.moving.relief.numbers import AXIS_OF, EMPTY, HALF, LANE_OF, NUMBERS, OF_ORDER, PAIRS
from relume.vector_code import (
    NUM,
    VECTOR,
    WORD,
    Array,
    difference,
    extracted,
    inner,
    kernel_part,
    picked,
    product,
    spread,
    sum_of,
    total,
    word,
)

_tuple: Any = types.UniTuple  # carries no types
_TEXELS, _SIDES, _CORNERS, _CHANNELS = 4, 4, 3, 3
_ORDERS = [int(order) for order in OF_ORDER[:, :HALF].argmax(axis=0)]  # of a channel's pairs of lanes
_FEW = [int(lane) for lane in LANE_OF[2 * HALF :]]  # that the second and the third axis count for
_MOST_ORDER = max(_ORDERS)


@kernel_part
def add_texels(typing_context, weight, step, view, of_view, first_view, texel, share, first, is_more, out):  # type: ignore[no-untyped-def]
    """Sum the numbers of four texels between four sides.

    Args:
        typing_context: Numba's. weight: (V, texels, 24) int8. step: (V, 24) float32.
        view: sides, int32. of_view: their weights, float32. first_view: the first of the four.
        texel: int32. share: of each, float32. first: of the four.
        is_more: they are added to what is there. out: (24,) float32
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        first_view, first, is_more = (arguments[k] for k in (4, 7, 8))
        weights, steps, views, of_views, texels, shares, sums = (
            Array(context, builder, kind, one)
            for kind, one in zip(signature.args, arguments, strict=True)
            if isinstance(kind, types.Array)
        )
        places = [builder.add(first, word(k)) for k in range(_TEXELS)]
        numbers = [builder.sext(texels.one(place), WORD) for place in places]
        parts = [spread(builder, shares.one(place)) for place in places]
        places = [builder.add(first_view, word(k)) for k in range(_SIDES)]
        sides = [builder.sext(views.one(place), WORD) for place in places]
        of_sides = [spread(builder, of_views.one(place)) for place in places]
        nothing = ir.Constant(VECTOR, [0.0] * NUM)
        for lane in map(word, range(0, NUMBERS, NUM)):
            place, told = sums.place_of_eight(lane), []
            for side, of_side in zip(sides, of_sides, strict=True):
                of_texels = inner(builder, parts, [weights.eight_bytes(side, number, lane) for number in numbers])
                told.append(product(builder, product(builder, of_side, steps.eight(side, lane)), of_texels))
            before = builder.select(is_more, builder.load(place, align=4), nothing)
            builder.store(total(builder, [before, *told]), place, align=4)
        return context.get_dummy_value()

    where = types.int64, texel, share, types.int64, types.boolean
    return types.void(weight, step, view, of_view, *where, out), generate


@kernel_part
def under_light(typing_context, numbers, axes, few_axes, vectors, about, shares, turns, side):  # type: ignore[no-untyped-def]
    """Sum numbers with the light between three vertices, each turned: what `AXIS_OF` and `LANE_OF` say.

    Args:
        typing_context: Numba's. numbers: (24,) float32. axes: of colours. (3, 3) float32
        few_axes: from `few_of`. vectors: light about vertices, in lanes. (vertices, 3 F) float32
        about: the three vertices, a tuple of uint32. shares: of each, a tuple.
        turns: cosine and sine for each, a tuple of six. side: −1 where azimuths run the other way round, else 1.
    Returns:
        Of each channel, a tuple of float32.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        numbers, axes, few_axes, vectors = (
            Array(context, builder, kind, one) for kind, one in zip(signature.args[:4], arguments[:4], strict=True)
        )
        about, shares, turns, side = arguments[4:]
        corners = [builder.zext(builder.extract_value(about, k), WORD) for k in range(_CORNERS)]
        ones = ir.Constant(VECTOR, [1.0] * NUM)  # what no order turns is not mirrored either
        mirror = builder.select(_where(lambda order: order > 0), spread(builder, side), ones)
        cosines: list[Any] = []
        sines: list[Any] = []
        for k in range(_CORNERS):
            weight = spread(builder, builder.extract_value(shares, k))
            turn = (spread(builder, builder.extract_value(turns, 2 * k + part)) for part in range(2))
            for found, turned in zip((cosines, sines), _turned(builder, *turn), strict=True):
                found.append(product(builder, weight, turned))
        mirrored = [[product(builder, mirror, one) for one in of] for of in (cosines, sines)]
        low, high, few = (numbers.eight(word(k * NUM)) for k in range(3))
        lone, lone_axis = numbers.one(word(EMPTY)), int(AXIS_OF[EMPTY])
        summed_up = []
        for channel in map(word, range(_CHANNELS)):
            at = builder.mul(channel, word(HALF))
            a, b = (
                [vectors.eight(corner, place) for corner in corners] for place in (at, builder.add(at, word(PAIRS)))
            )
            along = difference(builder, inner(builder, cosines, a), inner(builder, mirrored[1], b))
            across = total(builder, [inner(builder, sines, a), inner(builder, mirrored[0], b)])
            # where a lane is empty its light is nothing
            first = inner(builder, (low, high), (along, across))
            of_few = product(builder, few, picked(builder, along, across, _FEW))
            weighed = spread(builder, axes.one(channel, word(0))), few_axes.eight(channel, word(0))
            summed = sum_of(builder, inner(builder, weighed, (first, of_few)))
            of_lone = product(builder, lone, extracted(builder, along, int(LANE_OF[EMPTY])))
            summed_up.append(total(builder, [summed, product(builder, axes.one(channel, word(lone_axis)), of_lone)]))
        return context.make_tuple(builder, signature.return_type, summed_up)

    three, corner, six = (_tuple(*of) for of in ((types.float32, 3), (types.uint32, 3), (types.float32, 6)))
    given = corner, three, six, types.float32
    return three(numbers, axes, few_axes, vectors, *given), generate


def few_of(axes: NDArray[np.float32]) -> NDArray[np.float32]:
    """What numbers of the second and third axis count for in each channel. axes: (3, 3). Returns (3, 8)"""
    return np.ascontiguousarray(axes[:, AXIS_OF[2 * HALF :]])


def _where(chosen: Callable[[int], bool]) -> Any:
    """Lanes of some orders."""
    return ir.Constant(ir.VectorType(ir.IntType(1), NUM), [int(chosen(order)) for order in _ORDERS])


def _turned(builder: Any, cosine: Any, sine: Any) -> tuple[Any, Any]:
    """cos mφ and sin mφ of every pair of lanes: Chebyshev's T_m(cos φ), and sin φ U_{m−1}(cos φ)."""
    of_cosine = [_polynomial(chebyshev.cheb2poly(np.eye(order + 1)[order])) for order in _ORDERS]
    # m U_{m−1} is the derivative of T_m
    of_sine = [
        _polynomial(polynomial.polyder(row) / max(order, 1)) for row, order in zip(of_cosine, _ORDERS, strict=True)
    ]
    found = []
    for rows in (of_cosine, of_sine):
        powers = [ir.Constant(VECTOR, [float(row[k]) for row in rows]) for k in range(_MOST_ORDER + 1)]
        value = powers.pop()
        while powers:
            value = total(builder, [product(builder, value, cosine), powers.pop()])
        found.append(value)
    return found[0], product(builder, sine, found[1])


def _polynomial(coefficients: NDArray[np.float64]) -> NDArray[np.float64]:
    """Coefficients of a polynomial, up to the highest order of all."""
    return np.pad(coefficients, (0, _MOST_ORDER + 1 - len(coefficients)))
