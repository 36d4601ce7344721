"""The lights that a lobe may see, listed by where it looks and how wide it is.

A point knows of each light triangle whether it sees it. What it sees of the sky in a lobe about ω, σ wide, is

    V = Σ_l V_l w_l / Σ_l w_l,   w_l = E_l / (σ² + r_l²) · (1 − (1 − ω · ω_l) / (8 (σ² + r_l²)))₊⁸,

weighed by light, with r_l what a triangle is wide: (1 − x / 8)⁸ is e^−x nearly, without a call, and nothing beyond
twenty degrees of a lobe of seven. Of a thousand lights few count, and those that do are listed for each of 576 squares
of an octahedral map of directions and each of some widths.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.core.numba_options import UNCOUNTED
from relume.core.thread_pools import parallel_for_chunks
from relume.lights.sun_disks import MAX_SUN_DISKS
from relume.live.free_camera.basis.highlight_lobes import Lobes

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

SIDE = 24  # of the map, in squares
NUM_LISTED = 32  # lights in a list, at most
MAX_BRIGHT_LIGHTS, LIGHTS_PER_BRIGHT_LIGHT = MAX_SUN_DISKS, 16
MIN_SIGMA = 0.05  # σ of the first width, radians; each is √2 times the one before
NUM_WIDTHS = 10
_SHARPNESS = 8  # of the polynomial
_RADIUS_TO_VARIANCE = 8.0  # a triangle's r² over that of the circle about it: of an equilateral one, along an axis


class LobeLightLists(NamedTuple):
    """Lights of a sky, and lists of them.

    Attributes:
        lights: of each light the direction, r², and E, luminous, without lamps. (lights, 5) float32
        lists: lights of every width and square; after the last of a list −1. (lists, `NUM_LISTED`) int32
        first: list of the first square of each width, or of the nearest that has lists. (`NUM_WIDTHS`,) int32
        bright_lights: the lights that most of each lamp comes by, then −1. (lamps, `LIGHTS_PER_BRIGHT_LIGHT`) int32
        bright_light_weights: how much of it comes by each, one in all. (lamps, `LIGHTS_PER_BRIGHT_LIGHT`) float32
    """

    lights: F32
    lists: NDArray[np.int32]
    first: NDArray[np.int32]
    bright_lights: NDArray[np.int32]
    bright_light_weights: F32


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def width_index(sigma):  # type: ignore[no-untyped-def]
    """Find which width's lists a lobe of σ takes: the nearest."""
    step = np.float32(2) * math.log2(max(sigma, np.float32(1e-6)) * np.float32(1 / MIN_SIGMA))
    return min(max(np.int64(step + np.float32(0.5)), 0), NUM_WIDTHS - 1)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def bin_of(x, y, z):  # type: ignore[no-untyped-def]
    """Find the square of a direction, whose parts are x, y, z."""
    per = np.float32(1) / (abs(x) + abs(y) + abs(z))
    u, v = x * per, z * per
    if y < 0:
        folded = np.float32(1) - abs(v)
        v = math.copysign(np.float32(1) - abs(u), v)
        u = math.copysign(folded, u)
    half = np.float32(0.5 * SIDE)
    column: Any = min(max(np.int64((u + np.float32(1)) * half), 0), SIDE - 1)
    row: Any = min(max(np.int64((v + np.float32(1)) * half), 0), SIDE - 1)
    return row * SIDE + column


def _direction_bins() -> tuple[F64, F64]:
    """Directions of the squares' middles (squares, 3), and the angle from each to its farthest corner (squares,)."""
    edge = np.linspace(-1, 1, SIDE + 1)
    middle = 0.5 * (edge[1:] + edge[:-1])

    def towards(u: F64, v: F64) -> F64:
        y = 1 - np.abs(u) - np.abs(v)
        over = np.maximum(-y, 0)
        raw = np.stack([u - np.copysign(over, u), y, v - np.copysign(over, v)], axis=-1)
        return np.asarray(raw / np.linalg.norm(raw, axis=-1, keepdims=True))

    v, u = np.meshgrid(middle, middle, indexing="ij")
    centers = towards(u, v)
    v, u = np.meshgrid(edge, edge, indexing="ij")
    corners = towards(u, v)
    bin_corners = [corners[a : SIDE + a, b : SIDE + b] for a in (0, 1) for b in (0, 1)]
    cosine = np.min([np.einsum("abk,abk->ab", centers, corner) for corner in bin_corners], axis=0)
    return centers.reshape(-1, 3), np.arccos(np.clip(cosine, -1, 1)).ravel()


_DIRECTION_BINS = _direction_bins()


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def light_weight(lights, light, x, y, z, variance):  # type: ignore[no-untyped-def]
    """Find w of a light.

    Args:
        lights, light: of `LobeLightLists`, and which. x, y, z: about what a lobe is, unit. variance: of the lobe, σ².
    """
    one_minus_cosine = np.float32(1) - (x * lights[light, 0] + y * lights[light, 1] + z * lights[light, 2])
    return _weight(one_minus_cosine, lights[light, 3], lights[light, 4], variance)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _weight(one_minus_cosine, spread, luminance, variance):  # type: ignore[no-untyped-def]
    """Find w from 1 − ω · ω_l, r² and E."""
    inverse_variance = np.float32(1) / (variance + spread)
    remainder = max(np.float32(1) - one_minus_cosine * inverse_variance * np.float32(1 / _SHARPNESS), np.float32(0))
    remainder *= remainder
    remainder *= remainder
    return luminance * inverse_variance * remainder * remainder


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _list_lights(columns, centers, radius, variance, start, stop, out):  # type: ignore[no-untyped-def]
    """List the lights that weigh most anywhere in squares [start, stop). columns: of the lights. (5, lights)"""
    num, max_listed = columns.shape[1], out.shape[1]
    weight = np.empty(num, np.float32)
    bits = weight.view(np.int32)  # of numbers that are not negative these are in the same order
    for bin_index in range(start, stop):
        x, y, z = centers[bin_index, 0], centers[bin_index, 1], centers[bin_index, 2]
        cosine, sine = np.float32(math.cos(radius[bin_index])), np.float32(math.sin(radius[bin_index]))
        for k in range(num):  # without a branch: eight at once
            along = x * columns[0, k] + y * columns[1, k] + z * columns[2, k]
            across = math.sqrt(max(np.float32(1) - along * along, np.float32(0)))
            nearest = along * cosine + across * sine  # at the place in the square that is nearest to the light
            one_minus_cosine = np.float32(1) - (nearest if along < cosine else np.float32(1))
            weight[k] = _weight(one_minus_cosine, columns[3, k], columns[4, k], variance)
        threshold, num_equal = _selection_threshold(bits, max_listed)
        n = 0
        for k in range(num):
            if bits[k] > threshold or (bits[k] == threshold and num_equal > 0):
                num_equal -= bits[k] == threshold
                out[bin_index, n] = k
                n += 1
        out[bin_index, n:] = -1


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _selection_threshold(bits, max_count):  # type: ignore[no-untyped-def]
    """Find the least of the largest `max_count` numbers, none of them 0.

    By halving the range that it is in: counting is vector code, sorting is not.

    Args:
        bits: of n numbers, not negative. (n,) int32
    Returns:
        Its bits, and how many like it may be among these.
    """
    num_lit, high = np.int32(0), np.int32(0)
    for k in range(bits.shape[0]):
        num_lit += bits[k] > 0
        high = max(high, bits[k])
    if num_lit <= max_count:
        return np.int32(1), np.int32(max_count)
    # more than `most` are at least `low`, fewer at least `high`
    low, high, above = np.int32(1), high + np.int32(1), np.int32(0)
    while high - low > 1:
        middle = low + (high - low) // np.int32(2)
        count = np.int32(0)
        for k in range(bits.shape[0]):
            count += bits[k] >= middle
        if count == max_count:
            return middle, count
        if count > max_count:
            low = middle
        else:
            high, above = middle, count
    return low, np.int32(max_count) - above


def build_light_lists(
    directions: F32, radius: F32, luminance: F32, bright_light_fractions: F32, widths: Sequence[int]
) -> LobeLightLists:
    """List the lights of a sky.

    Args:
        directions: unit, that points see them in or not. (lights, 3) float32
        radius: of a circle about each, radians. (lights,) float32
        luminance: E of each without lamps, luminance. (lights,) float32
        bright_light_fractions: how much of each lamp comes by each light. (lamps, lights) float32
        widths: that lobes have, from `lobe_widths`; ascending, one at least.
    """
    lights = np.column_stack([directions, radius**2 / _RADIUS_TO_VARIANCE, luminance]).astype(np.float32)
    columns, (centers, farthest) = np.ascontiguousarray(lights.T), _DIRECTION_BINS
    lists = np.empty((len(widths), len(centers), NUM_LISTED), np.int32)
    for width_lists, width in zip(lists, widths, strict=True):
        args = columns, centers.astype(np.float32), farthest, np.float32(sigma_at_width(width) ** 2)
        parallel_for_chunks(partial(_list_lights_into, args, width_lists), len(centers))
    nearest = np.abs(np.arange(NUM_WIDTHS)[:, None] - np.array(widths)).argmin(axis=1)
    first = (nearest * len(centers)).astype(np.int32)
    return LobeLightLists(lights, lists.reshape(-1, NUM_LISTED), first, *_bright_light_lists(bright_light_fractions))


def _bright_light_lists(bright_light_fractions: F32) -> tuple[NDArray[np.int32], F32]:
    """Find the fields `lamps` and `share`."""
    num_lights = min(LIGHTS_PER_BRIGHT_LIGHT, bright_light_fractions.shape[1])
    lights = np.full((len(bright_light_fractions), LIGHTS_PER_BRIGHT_LIGHT), -1, np.int32)
    weights = np.zeros(lights.shape, np.float32)
    lights[:, :num_lights] = np.argsort(-bright_light_fractions, axis=1)[:, :num_lights]
    weights[:, :num_lights] = np.take_along_axis(bright_light_fractions, lights[:, :num_lights], axis=1)
    lights[weights <= 0] = -1
    return lights, weights / np.maximum(weights.sum(axis=1, keepdims=True), np.float32(1e-20))


def _list_lights_into(args: tuple[Any, ...], lists: NDArray[np.int32], start: int, stop: int) -> None:
    _list_lights(*args, start, stop, lists)  # type: ignore[call-arg]


def sigma_at_width(width: int) -> float:
    """Find the σ that lists of a width are made for, radians."""
    return float(MIN_SIGMA * 2 ** (width / 2))


def lobe_widths(lobes: Lobes) -> tuple[int, ...]:
    """Find the widths of lobes, as `relume.live.free_camera.highlights.lobe_visibility` takes them: two a lobe."""
    if not len(lobes.sigma):
        return ()
    angle = np.arccos(np.clip(lobes.cosine.astype(np.float64), -1, 1))
    weights = np.stack([lobes.first, 1 - lobes.first], axis=-1)
    middle = (weights * np.exp(1j * angle)).sum(axis=-1)
    sigma = np.sqrt((weights * lobes.sigma**2).sum(axis=-1) + 1 - np.abs(middle))
    low, high = (int(width_index(np.float32(end))) for end in (sigma.min(), sigma.max()))
    return tuple(range(low, high + 1))
