"""Packets of `LANES` rays in Embree's memory layout; every kernel that traces rays uses them.

A kernel aims the lanes of one packet, calls Embree, reads the results, and aims the same lanes again. The helpers are
inlined: calls would count references to the packet's arrays, and the loops over lanes would not be vectorized.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from llvmlite import ir
from numba.core import types
from numpy.typing import NDArray

from relume.core.simd import WORD, untyped_intrinsic
from relume.raytrace.embree import PACKET_WIDTH, PacketTracer

LANES = PACKET_WIDTH

FAR = np.float32(1e30)  # length of shadow rays to lights at infinity
# rows of RTCRayHit8 or 16, one word per lane; an origin and a direction take three rows
_ORIGIN, _DIRECTION, _ALPHA_SAMPLE, _FAR, _MASK = 0, 4, 7, 8, 9
_U, _V, _PRIMITIVE, _GEOMETRY, _INSTANCE = 15, 16, 17, 18, 19
_ROWS = 21
_INVALID_ID = 0xFFFFFFFF


class RayPacket(NamedTuple):
    """`LANES` rays, and the other arguments of Embree's trace calls.

    Attributes:
        rays: RTCRay8 or 16, then RTCHit with its instance ids; on a 64-byte boundary. Its size is 21 · `LANES`.
        words: the same memory.
        is_active: −1 if the ray of a lane is traced, else 0.
        owner: index of each lane's ray, for the caller.
        tracer: what traces the rays.
    """

    rays: Shaped[NDArray[np.float32], " words"]
    words: Shaped[NDArray[np.uint32], " words"]
    is_active: Shaped[NDArray[np.int32], " lanes"]
    owner: Shaped[NDArray[np.int64], " lanes"]
    tracer: PacketTracer


@nb.njit(nogil=True, cache=True)
def _aligned(num_words):  # type: ignore[no-untyped-def]
    """Zeroed float32 memory on a 64-byte boundary, as required by Embree's widest packets. (num_words,)"""
    raw = np.zeros(num_words + 16, np.float32)
    skip = (64 - raw.ctypes.data % 64) // 4 % 16
    return raw[skip : skip + num_words]


@nb.njit(nogil=True, cache=True)
def new_packet(tracer):  # type: ignore[no-untyped-def]
    """Make a packet whose rays start at their origins and hit all triangles. tracer: a `PacketTracer`."""
    rays = _aligned(_ROWS * LANES)
    words = rays.view(np.uint32)
    words[_MASK * LANES : (_MASK + 1) * LANES] = _INVALID_ID
    return RayPacket(rays, words, _aligned(LANES).view(np.int32), np.zeros(LANES, np.int64), tracer)


@nb.njit(nogil=True, cache=True, inline="always")
def set_origin(packet, lane, x, y, z):  # type: ignore[no-untyped-def]
    """Set the origin of the ray of a `lane` of a `packet` to (x, y, z)."""
    packet.rays[_ORIGIN * LANES + lane] = x
    packet.rays[(_ORIGIN + 1) * LANES + lane] = y
    packet.rays[(_ORIGIN + 2) * LANES + lane] = z


@nb.njit(nogil=True, cache=True, inline="always")
def set_direction(packet, lane, x, y, z, far):  # type: ignore[no-untyped-def]
    """Set the direction (x, y, z) of a `lane` of a `packet`, of any length; the ray ends after `far` lengths."""
    packet.rays[_DIRECTION * LANES + lane] = x
    packet.rays[(_DIRECTION + 1) * LANES + lane] = y
    packet.rays[(_DIRECTION + 2) * LANES + lane] = z
    packet.rays[_FAR * LANES + lane] = far


@nb.njit(nogil=True, cache=True, inline="always")
def enable_stochastic_alpha(packet, lane, alpha_sample):  # type: ignore[no-untyped-def]
    """Set the `alpha_sample` of the ray of a `lane`. See `relume.raytrace.alpha_filter`."""
    packet.rays[_ALPHA_SAMPLE * LANES + lane] = alpha_sample


@nb.njit(nogil=True, cache=True, inline="always")
def enable_lane(packet, lane, is_active):  # type: ignore[no-untyped-def]
    """Enable the ray of a `lane` of a `packet` if `is_active`, else disable it."""
    packet.is_active[lane] = -1 if is_active else 0


@nb.njit(nogil=True, cache=True, inline="always")
def enable_first_lanes(packet, num):  # type: ignore[no-untyped-def]
    """Enable the first `num` lanes and disable the others."""
    for lane in range(LANES):
        packet.is_active[lane] = -1 if lane < num else 0


@untyped_intrinsic
def _call(typing_context, function, is_active, scene, rays, arguments):  # type: ignore[no-untyped-def]
    """Call one of Embree's functions by its address, which writes into the packet. All are addresses."""

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, values: Sequence[ir.Value]) -> ir.Value:
        kind = ir.FunctionType(ir.VoidType(), [WORD] * 4)
        builder.call(builder.inttoptr(values[0], kind.as_pointer()), values[1:])
        return context.get_dummy_value()

    return types.void(*[types.int64] * 5), generate


@nb.njit(nogil=True, cache=True, inline="always")
def trace_shadows(packet):  # type: ignore[no-untyped-def]
    """Trace shadow rays of the active lanes. The packet's tracer is from `EmbreeScene.shadow_tracer`."""
    tracer, is_active, rays = packet.tracer, packet.is_active.ctypes.data, packet.rays.ctypes.data
    _call(tracer.function, np.int64(is_active), tracer.scene, np.int64(rays), tracer.arguments)


@nb.njit(nogil=True, cache=True, inline="always")
def is_unoccluded(packet, lane):  # type: ignore[no-untyped-def]
    """True if a ray traced by `trace_shadows` hit nothing."""
    return packet.rays[_FAR * LANES + lane] > 0  # Embree sets it to minus infinity for an occluded ray


@nb.njit(nogil=True, cache=True, inline="always")
def trace_hits(packet):  # type: ignore[no-untyped-def]
    """Find the first hits of the active lanes. The packet's tracer is from `EmbreeScene.hit_tracer`."""
    packet.words[_GEOMETRY * LANES : (_INSTANCE + 1) * LANES] = _INVALID_ID
    trace_shadows(packet)


@nb.njit(nogil=True, cache=True, inline="always")
def get_hit(packet, lane):  # type: ignore[no-untyped-def]
    """Read the first hit of a ray: its triangle, −1 for none, and its distance in lengths of the direction."""
    is_hit = packet.words[_GEOMETRY * LANES + lane] != _INVALID_ID
    face = np.int32(packet.words[_PRIMITIVE * LANES + lane]) if is_hit else np.int32(-1)
    return face, packet.rays[_FAR * LANES + lane]


@nb.njit(nogil=True, cache=True, inline="always")
def get_uv(packet, lane):  # type: ignore[no-untyped-def]
    """Read the barycentric coordinates of the first hit, of the triangle's second and third corner."""
    return packet.rays[_U * LANES + lane], packet.rays[_V * LANES + lane]


@nb.njit(nogil=True, cache=True, inline="always")
def get_position(packet, lane, axis):  # type: ignore[no-untyped-def]
    """Compute a component (`axis`) of the hit position of a `lane` of a `packet`, or of the ray's end."""
    far = packet.rays[_FAR * LANES + lane]
    return packet.rays[(_ORIGIN + axis) * LANES + lane] + far * packet.rays[(_DIRECTION + axis) * LANES + lane]


@nb.njit(nogil=True, cache=True, inline="always")
def get_direction(packet, lane, axis):  # type: ignore[no-untyped-def]
    """Read a component (`axis`) of the direction of a `lane` of a `packet`."""
    return packet.rays[(_DIRECTION + axis) * LANES + lane]
