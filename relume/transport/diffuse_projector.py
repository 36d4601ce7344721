"""Lambertian terms under the environment: the visible lights are summed, eight at a time.

    R(x) = q(x) Σ_m V(x, m) L_m Ω_m max(cos θi, 0)

A byte of visibility selects eight weights, 0 or 1, from a table. Bytes without visible lights are skipped.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numba as nb
import numpy as np
from jaxtyping import Shaped
from llvmlite import ir
from numba.core import cgutils, types
from numpy.typing import NDArray

from relume.brdf.term import Term
from relume.core.numba_options import NO_REFCOUNT
from relume.core.simd import (
    FAST,
    NUM,
    VECTOR,
    WORD,
    ArrayPointer,
    broadcast,
    constant_index,
    dot,
    multiply,
    sum_lanes,
    sum_values,
    untyped_intrinsic,
)
from relume.lights.spherical_triangles import TriangleLights
from relume.transport.shading_points import ShadingPoints
from relume.transport.term_contraction import Contraction

F32 = NDArray[np.float32]

_builders: Any = cgutils  # has no type annotations
_numba_types: Any = types
_BYTES = np.arange(256, dtype=np.uint8)[:, None]
_BIT_WEIGHTS = np.unpackbits(_BYTES, axis=1, bitorder="little").astype(np.float32)  # of each byte


def is_constant(term: Term, contraction: Contraction) -> bool:
    """Return whether a term reflects equally in all directions: it is Lambertian, and its curves are constant."""
    return term.is_lambertian and contraction.kinds.size == 0


def diffuse_quotients(term: Term, receivers: ShadingPoints, start: int, stop: int) -> Shaped[F32, " m"]:
    """Quotients of a Lambertian term at points [start, stop) of `receivers`; they depend only on the side of ωo."""
    cos_theta_o = np.einsum("nc,nc->n", receivers.normal[start:stop], receivers.wo[start:stop])
    zeros = np.zeros_like(cos_theta_o)
    return np.asarray(term.quotients(zeros, zeros, zeros + 1, zeros, zeros, cos_theta_o)[0])


def _reflect(builder: ir.IRBuilder, normal: Sequence[ir.Value], lights: Sequence[ir.Value]) -> list[ir.Value]:
    """Return L Ω max(cos θi, 0) of eight lights, per channel. lights: see `pack_lights`"""
    zeros = ir.Constant(VECTOR, [0.0] * NUM)
    cosine = dot(builder, normal, lights[:3])
    clamped = builder.select(builder.fcmp_ordered(">", cosine, zeros, flags=FAST), cosine, zeros)
    return [multiply(builder, clamped, irradiance) for irradiance in lights[3:]]


@untyped_intrinsic
def _sum_bytes(typing_context, visible, point, bit_weights, lights, num_bytes, x, y, z):  # type: ignore[no-untyped-def]
    """Return Σ V L Ω max(cos θi, 0) of a point, per channel. num_bytes: of its visibility. x, y, z: its normal"""

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Sequence[ir.Value]) -> ir.Value:
        visible_bytes, weights, packed = (
            ArrayPointer(context, builder, signature.args[k], arguments[k]) for k in (0, 2, 3)
        )
        zeros = ir.Constant(VECTOR, [0.0] * NUM)
        normal = [broadcast(builder, value) for value in arguments[5:]]
        sums = [_builders.alloca_once_value(builder, zeros) for _ in range(3)]
        with _builders.for_range(builder, arguments[4]) as loop:
            byte = visible_bytes.load(arguments[1], loop.index)
            with builder.if_then(builder.icmp_unsigned("!=", byte, ir.Constant(byte.type, 0))):
                eight = [packed.load_vector(loop.index, constant_index(k), constant_index(0)) for k in range(6)]
                weight = weights.load_vector(builder.zext(byte, WORD), constant_index(0))
                for total, reflected in zip(sums, _reflect(builder, normal, eight), strict=True):
                    summand = multiply(builder, weight, reflected)
                    builder.store(sum_values(builder, [builder.load(total), summand]), total)
        totals = [sum_lanes(builder, builder.load(total)) for total in sums]
        return context.make_tuple(builder, signature.return_type, totals)

    index, normal_types = types.int64, (types.float32,) * 3
    return _numba_types.UniTuple(types.float32, 3)(visible, index, bit_weights, lights, index, *normal_types), generate


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def sum_lights(normal, visible, bit_weights, lights, out):  # type: ignore[no-untyped-def]
    """Sum the visible lights of points.

    Args:
        normal: of the points. (n, 3) float32. visible: as in `ShadingPoints`, contiguous. (n, bytes) uint8
        bit_weights: the eight bits of each byte. (256, 8) float32. lights: from `pack_lights`.
        out: Σ V L Ω max(cos θi, 0), written. (n, 3) float32
    """
    for p in range(normal.shape[0]):
        x, y, z = normal[p, 0], normal[p, 1], normal[p, 2]
        out[p, 0], out[p, 1], out[p, 2] = _sum_bytes(visible, p, bit_weights, lights, lights.shape[0], x, y, z)


def pack_lights(direction: Shaped[F32, "M 3"], irradiance: Shaped[F32, "M 3"]) -> Shaped[F32, "bytes 6 8"]:
    """Group lights by the bytes of visibility: x, y and z of eight directions, then three channels; zeros at the end.

    Args:
        direction, irradiance: of the lights.
    """
    num_bytes = -(-len(direction) // NUM)
    rows = np.zeros((num_bytes * NUM, 6), np.float32)
    rows[: len(direction), :3], rows[: len(direction), 3:] = direction, irradiance
    return np.ascontiguousarray(rows.reshape(num_bytes, NUM, 6).transpose(0, 2, 1))


class DiffuseProjector:
    """Shades points of a Lambertian term with constant curves.

    Args:
        term: the term. constant: product of its curves. lights: lights of the environment.
    """

    def __init__(self, term: Term, constant: Shaped[F32, " 3"], lights: TriangleLights) -> None:
        self._term = term
        self._lights = pack_lights(lights.direction, lights.irradiance * constant)

    def shade(self, receivers: ShadingPoints, start: int, stop: int) -> Shaped[F32, "m 3"]:
        """Return the reflected radiance of receivers [start, stop)."""
        out = np.zeros((stop - start, 3), np.float32)
        if len(self._lights):  # without lights no visibility is stored
            visible = np.ascontiguousarray(receivers.visible[start:stop])
            sum_lights(receivers.normal[start:stop], visible, _BIT_WEIGHTS, self._lights, out)
        return out * diffuse_quotients(self._term, receivers, start, stop)[:, None]
