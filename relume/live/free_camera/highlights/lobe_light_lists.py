"""Lists of the lights in a lobe, by its direction and width.

A probe has a visibility bit for each environment triangle. The visible fraction of the environment in a lobe around ω
of width σ is

    V = Σ_l V_l w_l / Σ_l w_l,   w_l = E_l / (σ² + r_l²) · (1 − (1 − ω · ω_l) / (8 (σ² + r_l²)))₊⁸,

weighted by light, with r_l the width of a triangle. (1 − x / 8)⁸ approximates e^−x without a call, and vanishes beyond
twenty degrees for a lobe of seven. Few of a thousand lights matter; they are listed for each of 576 direction bins of
an octahedral map and each of some widths.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks
from relume.lights.sun_disks import MAX_SUN_DISKS
from relume.live.free_camera.basis.highlight_lobes import Lobes

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

SIDE = 24  # of the map, in direction bins
NUM_LISTED = 32  # greatest number of lights in a list
MAX_BRIGHT_LIGHTS, LIGHTS_PER_BRIGHT_LIGHT = MAX_SUN_DISKS, 16
MIN_SIGMA = 0.05  # σ of the first width, radians; each is √2 times the one before
NUM_WIDTHS = 10
_SHARPNESS = 8  # of the polynomial
_RADIUS_TO_VARIANCE = 8.0  # a triangle's r² over that of the circle about it: of an equilateral one, along an axis


class LobeLightLists(NamedTuple):
    """Environment lights, and lists of them per direction bin.

    Attributes:
        lights: lights of each the direction, r², and E, luminance, without bright lights.
        lists: lights of every width and bin; −1 after the last.
        first: list of the first bin of each width, or of the nearest width with lists.
        bright_lights: the lights that contribute most to each bright light, then −1.
        bright_light_weights: contribution of each, 1 in sum.
    """

    lights: Shaped[F32, "lights 5"]
    lists: Shaped[NDArray[np.int32], "lists listed"]
    first: Shaped[NDArray[np.int32], " widths"]
    bright_lights: Shaped[NDArray[np.int32], "bright_lights contributors"]
    bright_light_weights: Shaped[F32, "bright_lights contributors"]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def width_index(sigma):  # type: ignore[no-untyped-def]
    """Return the index of the width nearest to σ."""
    step = np.float32(2) * math.log2(max(sigma, np.float32(1e-6)) * np.float32(1 / MIN_SIGMA))
    return min(max(np.int64(step + np.float32(0.5)), 0), NUM_WIDTHS - 1)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def bin_of(x, y, z):  # type: ignore[no-untyped-def]
    """Return the direction bin of the direction x, y, z."""
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
    """Center directions of bins (bins, 3), and the angle from each to its farthest corner (bins,)."""
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


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def light_weight(lights, light, x, y, z, variance):  # type: ignore[no-untyped-def]
    """Return w of a light.

    Args:
        lights, light: list of `LobeLightLists`, and an index. x, y, z: direction of the lobe, unit.
        variance: variance of the lobe,
            σ².
    """
    one_minus_cosine = np.float32(1) - (x * lights[light, 0] + y * lights[light, 1] + z * lights[light, 2])
    return _weight(one_minus_cosine, lights[light, 3], lights[light, 4], variance)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _weight(one_minus_cosine, spread, luminance, variance):  # type: ignore[no-untyped-def]
    """Return w from 1 − ω · ω_l, r² and E."""
    inverse_variance = np.float32(1) / (variance + spread)
    remainder = max(np.float32(1) - one_minus_cosine * inverse_variance * np.float32(1 / _SHARPNESS), np.float32(0))
    remainder *= remainder
    remainder *= remainder
    return luminance * inverse_variance * remainder * remainder


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _list_lights(columns, centers, radius, variance, start, stop, out):  # type: ignore[no-untyped-def]
    """List the lights with the largest weight anywhere in bins [start, stop). columns: columns of the lights. (5,
    lights)
    """
    num, max_listed = columns.shape[1], out.shape[1]
    weight = np.empty(num, np.float32)
    bits = weight.view(np.int32)  # the same order as nonnegative floats
    for bin_index in range(start, stop):
        x, y, z = centers[bin_index, 0], centers[bin_index, 1], centers[bin_index, 2]
        cosine, sine = np.float32(math.cos(radius[bin_index])), np.float32(math.sin(radius[bin_index]))
        for k in range(num):  # no branches, so that it vectorizes
            along = x * columns[0, k] + y * columns[1, k] + z * columns[2, k]
            across = math.sqrt(max(np.float32(1) - along * along, np.float32(0)))
            nearest = along * cosine + across * sine  # cosine at the point in the bin nearest to the light
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


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _selection_threshold(bits, max_count):  # type: ignore[no-untyped-def]
    """Return the smallest of the largest `max_count` numbers, ignoring zeros.

    Bisects its range: counting vectorizes, sorting does not.

    Args:
        bits: bits of n nonnegative numbers. (n,) int32
    Returns:
        Its bits, and how many equal numbers may be selected.
    """
    num_lit, high = np.int32(0), np.int32(0)
    for k in range(bits.shape[0]):
        num_lit += bits[k] > 0
        high = max(high, bits[k])
    if num_lit <= max_count:
        return np.int32(1), np.int32(max_count)
    # more than `max_count` are at least `low`, fewer at least `high`
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
    directions: Shaped[F32, "lights 3"],
    radius: Shaped[F32, " lights"],
    luminance: Shaped[F32, " lights"],
    bright_light_fractions: Shaped[F32, "bright_lights lights"],
    widths: Sequence[int],
) -> LobeLightLists:
    """List the lights of an environment.

    Args:
        directions: unit, those of visibility bits.
        radius: radius of a circle about each, radians.
        luminance: E of each without bright lights, luminance.
        bright_light_fractions: contribution of each light to each bright light.
        widths: widths of lobes, from `lobe_widths`; ascending, at least one.
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
    """Return the fields `bright_lights` and `bright_light_weights`."""
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
    """Return the σ of lists of a width, radians."""
    return float(MIN_SIGMA * 2 ** (width / 2))


def lobe_widths(lobes: Lobes) -> tuple[int, ...]:
    """Return the widths of lobes for `relume.live.free_camera.highlights.lobe_visibility`, merged from two each."""
    if not len(lobes.sigma):
        return ()
    angle = np.arccos(np.clip(lobes.cosine.astype(np.float64), -1, 1))
    weights = np.stack([lobes.first, 1 - lobes.first], axis=-1)
    middle = (weights * np.exp(1j * angle)).sum(axis=-1)
    sigma = np.sqrt((weights * lobes.sigma**2).sum(axis=-1) + 1 - np.abs(middle))
    low, high = (int(width_index(np.float32(end))) for end in (sigma.min(), sigma.max()))
    return tuple(range(low, high + 1))
