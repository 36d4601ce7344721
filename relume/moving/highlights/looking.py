"""Where lobes look, and the sky that they show there."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.moving.basis.rows import LEAST_COSINE, row_of
from relume.moving.sky import Sky, add_sky_about, level_of
from relume.uncounted import UNCOUNTED

F32 = NDArray[np.float32]

_NOTHING_LEFT = np.float32(16)  # e^−x is less than 2e-7


class SkyLight(NamedTuple):
    """The sky that lobes show.

    Attributes:
        sky: its levels, lamps left out of all that are blurred.
        lamps: what of it is small and strong: of each the direction, world space, ∫ L dω, and 1 − |Σ ω L / Σ L|, the
            variance of its own width; `MOST_LAMPS` at most. (lamps, 7) float32
        turn: of the levels, from `turn_of`. gain: of its light, in each channel. (3,) float32
    """

    sky: Sky
    lamps: F32
    turn: np.float32
    gain: F32


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def along_lobe(lobes, lobe, n, d):  # type: ignore[no-untyped-def]
    """Find where a lobe looks.

    Args:
        lobes, lobe: which. n: the normal, d: from the eye, unit, tuples.
    Returns:
        A row of its table and the share of the next; its direction, a tuple; its width.
    """
    row, share, aside = _aside(n, d)
    mean = lobes.mean[lobe, row] + share * (lobes.mean[lobe, row + 1] - lobes.mean[lobe, row])
    wide = lobes.wide[lobe, row] + share * (lobes.wide[lobe, row + 1] - lobes.wide[lobe, row])
    return row, share, _leaning(mean, aside, n), wide


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def along_both(lobes, lobe, n, d):  # type: ignore[no-untyped-def]
    """Find where the two lobes that a point has for one look.

    Args:
        lobes, lobe, n, d: as of `along_lobe`.
    Returns:
        A row of the table and the share of the next; both directions, tuples; the share of the first, s_1; σ of the
        first and of the other.
    """
    row, share, aside = _aside(n, d)
    first = lobes.first[lobe, row] + share * (lobes.first[lobe, row + 1] - lobes.first[lobe, row])
    sigma = lobes.sigma[lobe, row, 0] + share * (lobes.sigma[lobe, row + 1, 0] - lobes.sigma[lobe, row, 0])
    sigma_2 = lobes.sigma[lobe, row, 1] + share * (lobes.sigma[lobe, row + 1, 1] - lobes.sigma[lobe, row, 1])
    one = lobes.cosine[lobe, row, 0] + share * (lobes.cosine[lobe, row + 1, 0] - lobes.cosine[lobe, row, 0])
    other = lobes.cosine[lobe, row, 1] + share * (lobes.cosine[lobe, row + 1, 1] - lobes.cosine[lobe, row, 1])
    return row, share, _leaning(one, aside, n), _leaning(other, aside, n), first, sigma, sigma_2


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _aside(n, d):  # type: ignore[no-untyped-def]
    """Find where θo lies in tables, and the unit direction along the surface in which d goes on."""
    facing = -(n[0] * d[0] + n[1] * d[1] + n[2] * d[2])
    cosine: Any = min(max(facing, LEAST_COSINE), np.float32(1))
    row, share = row_of(cosine)
    x, y, z = d[0] + facing * n[0], d[1] + facing * n[1], d[2] + facing * n[2]
    per = np.float32(1) / math.sqrt(max(x * x + y * y + z * z, np.float32(1e-20)))
    return row, share, (per * x, per * y, per * z)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _leaning(cosine, aside, n):  # type: ignore[no-untyped-def]
    """The direction between n and `aside`, by the cosine of its angle from n."""
    flat = math.sqrt(max(np.float32(1) - cosine * cosine, np.float32(0)))
    return flat * aside[0] + cosine * n[0], flat * aside[1] + cosine * n[1], flat * aside[2] + cosine * n[2]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def add_sky_in_lobe(light, seen, direction, sigma, gain, out):  # type: ignore[no-untyped-def]
    """Add what a lobe shows of the sky, without the sky's gain.

    Args:
        light: a `SkyLight`. seen: how much of it is seen, lamps left out, and of each lamp, a tuple.
        direction: of the lobe, a tuple. sigma: of the blur, radians. gain: that it is multiplied by.
        out: added to, radiance. (3,)
    """
    level = level_of(sigma)
    add_sky_about(light.sky, light.turn, direction, level, seen[0] * gain, out)
    blurred = min(level, np.float32(1))  # the sharp level has its lamps
    for lamp in range(light.lamps.shape[0]):
        per = np.float32(1) / (sigma * sigma + light.lamps[lamp, 6])
        x, y, z = light.lamps[lamp, 0], light.lamps[lamp, 1], light.lamps[lamp, 2]
        near = _decay(per * (np.float32(1) - (direction[0] * x + direction[1] * y + direction[2] * z)))
        if near > 0:
            near *= per * np.float32(0.5 / math.pi) / (np.float32(1) - _decay(np.float32(2) * per))
            near *= gain * blurred * (seen[1] if lamp == 0 else seen[2])
            for channel in range(3):
                out[channel] += near * light.lamps[lamp, 3 + channel]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _decay(x):  # type: ignore[no-untyped-def]
    """e^−x, without a call where nothing is left."""
    return np.float32(math.exp(-x)) if x < _NOTHING_LEFT else np.float32(0)
