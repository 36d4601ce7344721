"""Compose term images to the radiance of view samples: color · texture · view-angle curves · image, per term."""

from __future__ import annotations

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks

F32 = NDArray[np.float32]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _add_term_planes(  # type: ignore[no-untyped-def]
    image, color, texture, outgoing, has_texture, has_outgoing, first, num, replace, start, stop, radiance
):
    """Add planes [start, stop) of one term, one per channel and tile, to radiance (3, samples of the view).

    first: the material's first sample in the view. num: number of its samples.
    """
    samples = image.shape[2]
    for plane in range(start, stop):
        tile, channel = plane // 3, plane % 3
        tile_start = tile * samples
        c = color[channel]
        for s in range(min(samples, num - tile_start)):
            row = tile_start + s
            value = c * image[tile, channel, s]
            if has_texture:
                value *= texture[row, channel]
            if has_outgoing:
                value *= outgoing[channel, row]
            if replace:
                radiance[channel, first + row] = value
            else:
                radiance[channel, first + row] += value


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _add_diffuse(irradiance, factor, start, stop, image):  # type: ignore[no-untyped-def]
    """Add samples [start, stop) to all channels."""
    samples = image.shape[2]
    for tile in range(start // samples, (stop - 1) // samples + 1):
        tile_start = tile * samples
        range_start, range_stop = max(start, tile_start), min(stop, tile_start + samples)
        for channel in range(3):
            for s in range(range_start, range_stop):
                image[tile, channel, s - tile_start] += factor[channel] * irradiance[s]


def add_diffuse(
    irradiance: Shaped[F32, " n"], factor: Shaped[NDArray[np.floating], " 3"], image: Shaped[F32, "tiles 3 samples"]
) -> None:
    """Add diffusely reflected light, independent of directions.

    Args:
        irradiance: E of each sample, for a light of unit emission.
        factor: reflected radiance per irradiance, per channel. image: added to.
    """
    args = (np.ascontiguousarray(irradiance, np.float32), np.asarray(factor, np.float32).reshape(3))
    parallel_for_chunks(lambda start, stop: _add_diffuse(*args, start, stop, image), len(irradiance))


def add_term(
    image: Shaped[F32, "tiles 3 samples"],
    color: Shaped[F32, " 3"],
    texture: Shaped[F32, "n 3"] | None,
    outgoing: Shaped[F32, "3 n"] | None,
    first: int,
    num: int,
    replace: bool,
    radiance: Shaped[F32, "3 view_samples"],
) -> None:
    """Add one term of a material to the view's radiance, or overwrite the radiance with it.

    Args:
        image: Σ_j c_j T_j. color: color of the term.
        texture: texture per sample, None for 1. outgoing: product of the curves of the view angle, None for 1.
        first: the material's first sample in the view. num: number of its samples.
        replace: overwrite the radiance instead of adding to it. radiance: radiance of the view's samples, modified.
    """
    outgoing_values = outgoing if outgoing is not None else np.empty((3, 0), np.float32)
    texture_values = texture if texture is not None else np.empty((0, 3), np.float32)
    args = (
        image,
        color,
        texture_values,
        outgoing_values,
        texture is not None,
        outgoing is not None,
        first,
        num,
        replace,
    )
    parallel_for_chunks(lambda start, stop: _add_term_planes(*args, start, stop, radiance), 3 * len(image))
