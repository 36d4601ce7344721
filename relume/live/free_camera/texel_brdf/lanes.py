"""The two sums per ray that hits a texel, in SIMD: coefficients over texels and view directions, and their product with
light.

As plain loops they take twice the time: see `relume.core.simd`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from jaxtyping import Shaped
from llvmlite import ir
from numba.core import types
from numpy.polynomial import chebyshev, polynomial
from numpy.typing import NDArray

from relume.core.simd import (
    FAST,
    NUM,
    VECTOR,
    WORD,
    ArrayPointer,
    broadcast,
    constant_index,
    dot,
    extract_lane,
    multiply,
    shuffle,
    subtract,
    sum_lanes,
    sum_values,
    untyped_intrinsic,
)
from relume.live.free_camera.texel_brdf.coefficient_packing import (
    COEFFICIENT_AXIS,
    COEFFICIENT_LANE,
    EMPTY_LANE,
    HALF,
    HAS_ORDER,
    NUM_COEFFICIENTS,
    PAIRS,
)

_tuple: Any = types.UniTuple  # has no type annotations
NUM_VIEWS, TEXELS_PER_VIEW = 4, 8  # view directions of a ray; texels of each, of two levels
_TEXELS, _CORNERS, _CHANNELS = 4, 3, 3
_ORDERS = [int(order) for order in HAS_ORDER[:, :HALF].argmax(axis=0)]  # of the pairs of lanes of a channel
_SECONDARY_LANES = [int(lane) for lane in COEFFICIENT_LANE[2 * HALF :]]  # of the second and third color axis
_MAX_ORDER = max(_ORDERS)


@untyped_intrinsic
def add_texels(typing_context, weight, step, view, view_weight, first_view, texel, texel_weight, first, is_more, out):  # type: ignore[no-untyped-def]
    """Sum the coefficients of four texels of each of four view directions, interpolated between them.

    Args:
        typing_context: Numba's. weight: (V, texels, 24) int8. step: (V, 24) float32.
        view: view directions, int32. view_weight: float32. first_view: index of the first of the four.
        texel: int32. texel_weight: float32. first: index of the first of the four of the first view direction; those
            of the next ones lie `TEXELS_PER_VIEW` further on each.
        is_more: add to `out`, else overwrite it. out: (24,) float32
    """

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Sequence[ir.Value]) -> ir.Value:
        first_view, first, is_more = (arguments[k] for k in (4, 7, 8))
        weights, steps, views, view_weights, texels, texel_weights, sums = (
            ArrayPointer(context, builder, kind, value)
            for kind, value in zip(signature.args, arguments, strict=True)
            if isinstance(kind, types.Array)
        )
        zero = ir.Constant(VECTOR, [0.0] * NUM)
        lanes = [constant_index(lane) for lane in range(0, NUM_COEFFICIENTS, NUM)]
        pointers = [sums.vector_pointer(lane) for lane in lanes]
        totals = [builder.select(is_more, builder.load(pointer, align=4), zero) for pointer in pointers]
        for k in range(NUM_VIEWS):  # view by view: the weights of all would not fit the registers
            at = builder.add(first_view, constant_index(k))
            side, side_weight = builder.sext(views.load(at), WORD), view_weights.load(at)
            texel_indices, texel_vectors = [], []
            for texel in range(_TEXELS):
                at = builder.add(first, constant_index(TEXELS_PER_VIEW * k + texel))
                texel_indices.append(builder.sext(texels.load(at), WORD))
                weight = builder.fmul(side_weight, texel_weights.load(at), FAST)
                texel_vectors.append(broadcast(builder, weight))
            for i, lane in enumerate(lanes):
                values = [weights.load_int8_vector(side, texel_index, lane) for texel_index in texel_indices]
                texel_sum = multiply(builder, steps.load_vector(side, lane), dot(builder, texel_vectors, values))
                totals[i] = sum_values(builder, [totals[i], texel_sum])
        for pointer, total in zip(pointers, totals, strict=True):
            builder.store(total, pointer, align=4)
        return context.get_dummy_value()

    range_types = types.int64, texel, texel_weight, types.int64, types.boolean
    return types.void(weight, step, view, view_weight, *range_types, out), generate


@untyped_intrinsic
def integrate(typing_context, coefficients, axes, secondary_axes, vectors, nodes, weights, rotations, side):  # type: ignore[no-untyped-def]
    """Integrate coefficients with the light interpolated between three lattice nodes, each rotated into the texture's
    frame.

    `COEFFICIENT_AXIS` and `COEFFICIENT_LANE` define the numbers.

    Args:
        typing_context: Numba's. coefficients: (24,) float32. axes: color axes. (3, 3) float32
        secondary_axes: from `pack_secondary_axes`. vectors: light at nodes, in lanes. (nodes, 3 F) float32
        nodes: three, a tuple of uint32. weights: weights of each, a tuple.
        rotations: cosine and sine of each, a tuple of six.
        side: −1 if azimuths run the other way, else 1.
    Returns:
        Radiance per channel, a tuple of float32.
    """

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Sequence[ir.Value]) -> ir.Value:
        coefficients, axes, secondary_axes, vectors = (
            ArrayPointer(context, builder, kind, value)
            for kind, value in zip(signature.args[:4], arguments[:4], strict=True)
        )
        nodes, weights, rotations, side = arguments[4:]
        corners = [builder.zext(builder.extract_value(nodes, k), WORD) for k in range(_CORNERS)]
        ones = ir.Constant(VECTOR, [1.0] * NUM)  # order 0 is not mirrored
        mirror = builder.select(_lane_mask(lambda order: order > 0), broadcast(builder, side), ones)
        cosines: list[ir.Value] = []
        sines: list[ir.Value] = []
        for k in range(_CORNERS):
            weight = broadcast(builder, builder.extract_value(weights, k))
            rotation = (
                broadcast(builder, builder.extract_value(rotations, 2 * k + component)) for component in range(2)
            )
            for factors, rotated in zip((cosines, sines), _rotation_factors(builder, *rotation), strict=True):
                factors.append(multiply(builder, weight, rotated))
        mirrored = [[multiply(builder, mirror, value) for value in factor_list] for factor_list in (cosines, sines)]
        low, high, secondary = (coefficients.load_vector(constant_index(k * NUM)) for k in range(3))
        empty_lane_value, empty_lane_axis = (
            coefficients.load(constant_index(EMPTY_LANE)),
            int(COEFFICIENT_AXIS[EMPTY_LANE]),
        )
        channel_sums = []
        for channel in map(constant_index, range(_CHANNELS)):
            at = builder.mul(channel, constant_index(HALF))
            a, b = (
                [vectors.load_vector(corner, offset) for corner in corners]
                for offset in (at, builder.add(at, constant_index(PAIRS)))
            )
            along = subtract(builder, dot(builder, cosines, a), dot(builder, mirrored[1], b))
            across = sum_values(builder, [dot(builder, sines, a), dot(builder, mirrored[0], b)])
            # the light of the empty lane is zero
            first = dot(builder, (low, high), (along, across))
            secondary_product = multiply(builder, secondary, shuffle(builder, along, across, _SECONDARY_LANES))
            axis_weights = (
                broadcast(builder, axes.load(channel, constant_index(0))),
                secondary_axes.load_vector(channel, constant_index(0)),
            )
            summed = sum_lanes(builder, dot(builder, axis_weights, (first, secondary_product)))
            empty_lane_product = multiply(
                builder, empty_lane_value, extract_lane(builder, along, int(COEFFICIENT_LANE[EMPTY_LANE]))
            )
            channel_sums.append(
                sum_values(
                    builder,
                    [
                        summed,
                        multiply(builder, axes.load(channel, constant_index(empty_lane_axis)), empty_lane_product),
                    ],
                )
            )
        return context.make_tuple(builder, signature.return_type, channel_sums)

    triple_type, index_type, six_type = (
        _tuple(*args) for args in ((types.float32, 3), (types.uint32, 3), (types.float32, 6))
    )
    node_types = index_type, triple_type, six_type, types.float32
    return triple_type(coefficients, axes, secondary_axes, vectors, *node_types), generate


def pack_secondary_axes(axes: Shaped[NDArray[np.float32], "3 3"]) -> Shaped[NDArray[np.float32], "3 8"]:
    """Return the weights of the second and third color axis in each channel."""
    return np.ascontiguousarray(axes[:, COEFFICIENT_AXIS[2 * HALF :]])


def _lane_mask(predicate: Callable[[int], bool]) -> ir.Value:
    """Mask of the lanes whose order satisfies a predicate."""
    return ir.Constant(ir.VectorType(ir.IntType(1), NUM), [int(predicate(order)) for order in _ORDERS])


def _rotation_factors(builder: ir.IRBuilder, cosine: ir.Value, sine: ir.Value) -> tuple[ir.Value, ir.Value]:
    """Return cos mφ and sin mφ for each pair of lanes: Chebyshev's T_m(cos φ), and sin φ U_{m−1}(cos φ)."""
    cosine_polynomials = [_polynomial(chebyshev.cheb2poly(np.eye(order + 1)[order])) for order in _ORDERS]
    # m U_{m−1} is the derivative of T_m
    sine_polynomials = [
        _polynomial(polynomial.polyder(row) / max(order, 1))
        for row, order in zip(cosine_polynomials, _ORDERS, strict=True)
    ]
    polynomial_values = []
    for rows in (cosine_polynomials, sine_polynomials):
        powers = [ir.Constant(VECTOR, [float(row[k]) for row in rows]) for k in range(_MAX_ORDER + 1)]
        value = powers.pop()
        while powers:
            value = sum_values(builder, [multiply(builder, value, cosine), powers.pop()])
        polynomial_values.append(value)
    return polynomial_values[0], multiply(builder, sine, polynomial_values[1])


def _polynomial(coefficients: NDArray[np.float64]) -> NDArray[np.float64]:
    """Coefficients of a polynomial, padded to the highest order."""
    return np.pad(coefficients, (0, _MAX_ORDER + 1 - len(coefficients)))
