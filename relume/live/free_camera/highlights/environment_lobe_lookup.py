"""Directions of lobes, and the prefiltered environment in them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.live.free_camera.basis.table_index import MIN_COSINE, table_row
from relume.live.free_camera.environment_lookup import EnvironmentLookup, add_environment, blur_level

F32 = NDArray[np.float32]

_MAX_EXPONENT = np.float32(16)  # e^−x is less than 2e-7


class PrefilteredEnvironment(NamedTuple):
    """The environment as lobes show it.

    Attributes:
        environment: its levels; blurred ones exclude bright lights.
        bright_lights: small bright regions: direction, world space, ∫ L dω, and 1 − |Σ ω L / Σ L|, the variance of
            their own width; at most `MAX_BRIGHT_LIGHTS`.
        rotation: rotation of the levels, from `rotation_of`. gain: per channel.
    """

    environment: EnvironmentLookup
    bright_lights: Shaped[F32, "bright_lights 7"]
    rotation: np.float32
    gain: Shaped[F32, " 3"]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def evaluate_lobe(lobes, lobe, n, d):  # type: ignore[no-untyped-def]
    """Evaluate the direction and width of a lobe.

    Args:
        lobes, lobe: all lobes, and an index. n: the normal, d: from the camera, unit, tuples.
    Returns:
        A row of its table and the fraction toward the next; its direction, a tuple; its width.
    """
    row, fraction, tangential = _lobe_frame(n, d)
    cosine = lobes.mean[lobe, row] + fraction * (lobes.mean[lobe, row + 1] - lobes.mean[lobe, row])
    sigma = lobes.single_sigma[lobe, row] + fraction * (
        lobes.single_sigma[lobe, row + 1] - lobes.single_sigma[lobe, row]
    )
    return row, fraction, _direction_at_cosine(cosine, tangential, n), sigma


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def evaluate_two_lobes(lobes, lobe, n, d):  # type: ignore[no-untyped-def]
    """Evaluate the directions and widths of the two lobes of a highlight.

    Args:
        lobes, lobe, n, d: as in `evaluate_lobe`.
    Returns:
        A row of the table and the fraction toward the next; both directions, tuples; the weight of the first, s_1; σ_1
        and
        σ_2.
    """
    row, fraction, tangential = _lobe_frame(n, d)
    weight_1 = lobes.first[lobe, row] + fraction * (lobes.first[lobe, row + 1] - lobes.first[lobe, row])
    sigma_1 = lobes.sigma[lobe, row, 0] + fraction * (lobes.sigma[lobe, row + 1, 0] - lobes.sigma[lobe, row, 0])
    sigma_2 = lobes.sigma[lobe, row, 1] + fraction * (lobes.sigma[lobe, row + 1, 1] - lobes.sigma[lobe, row, 1])
    cosine_1 = lobes.cosine[lobe, row, 0] + fraction * (lobes.cosine[lobe, row + 1, 0] - lobes.cosine[lobe, row, 0])
    cosine_2 = lobes.cosine[lobe, row, 1] + fraction * (lobes.cosine[lobe, row + 1, 1] - lobes.cosine[lobe, row, 1])
    return (
        row,
        fraction,
        _direction_at_cosine(cosine_1, tangential, n),
        _direction_at_cosine(cosine_2, tangential, n),
        weight_1,
        sigma_1,
        sigma_2,
    )


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _lobe_frame(n, d):  # type: ignore[no-untyped-def]
    """Return the table row of θo, and the unit projection of d onto the surface."""
    facing = -(n[0] * d[0] + n[1] * d[1] + n[2] * d[2])
    cosine = min(max(facing, MIN_COSINE), np.float32(1))
    row, fraction = table_row(cosine)
    x, y, z = d[0] + facing * n[0], d[1] + facing * n[1], d[2] + facing * n[2]
    inverse_length = np.float32(1) / math.sqrt(max(x * x + y * y + z * z, np.float32(1e-20)))
    return row, fraction, (inverse_length * x, inverse_length * y, inverse_length * z)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _direction_at_cosine(cosine, tangential, n):  # type: ignore[no-untyped-def]
    """Return the direction in the plane of n and `tangential` with a given cosine to n."""
    sine = math.sqrt(max(np.float32(1) - cosine * cosine, np.float32(0)))
    return (
        sine * tangential[0] + cosine * n[0],
        sine * tangential[1] + cosine * n[1],
        sine * tangential[2] + cosine * n[2],
    )


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def add_environment_in_lobe(environment, visibility, direction, sigma, gain, out):  # type: ignore[no-untyped-def]
    """Add the environment in a lobe, without the environment's gain.

    Args:
        environment: a `PrefilteredEnvironment`.
        visibility: visibility of the environment without bright lights, and of each
            bright light, a tuple.
        direction: direction of the lobe, a tuple. sigma: sigma of the blur, radians. gain: a factor.
        out: added to, radiance. (3,)
    """
    level = blur_level(sigma)
    add_environment(environment.environment, environment.rotation, direction, level, visibility[0] * gain, out)
    blurred = min(level, np.float32(1))  # the sharp level includes bright lights
    for bright_light in range(environment.bright_lights.shape[0]):
        concentration = np.float32(1) / (sigma * sigma + environment.bright_lights[bright_light, 6])
        x, y, z = (
            environment.bright_lights[bright_light, 0],
            environment.bright_lights[bright_light, 1],
            environment.bright_lights[bright_light, 2],
        )
        falloff = _decay(concentration * (np.float32(1) - (direction[0] * x + direction[1] * y + direction[2] * z)))
        if falloff > 0:
            falloff *= (
                concentration * np.float32(0.5 / math.pi) / (np.float32(1) - _decay(np.float32(2) * concentration))
            )
            falloff *= gain * blurred * (visibility[1] if bright_light == 0 else visibility[2])
            for channel in range(3):
                out[channel] += falloff * environment.bright_lights[bright_light, 3 + channel]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _decay(x):  # type: ignore[no-untyped-def]
    """Return e^−x, without a call if it is negligible."""
    return np.float32(math.exp(-x)) if x < _MAX_EXPONENT else np.float32(0)
