"""Rims of highlights a pixel thin: where brightness jumps from pixel to pixel, many rays find what a pixel sees of it.

Rays through the middles of pixels meet a thin rim or miss it, and it is hundreds of times as bright as what lies beside
it. Of all pixels a few make most of the error (docs/adr/0063-highlights.md). They take more time than a moving eye
has: fine frames alone have them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from relume.color import LUMINANCE
from relume.moving.frame import Frame, Wanted, finished_along
from relume.moving.look_up import Seen, look_through
from relume.moving.parted import mend
from relume.moving.transfer import MovingTransfer
from relume.scene.model import Camera

F32 = NDArray[np.float32]

_MOST = 0.02  # of all pixels, those across which it jumps most
_LEAST = 1.0  # of the picture's mean: the least jump
_RAYS = 16
_STEP = 7  # from row to row: no two rays share a row or a column, none are close
PLACES = ((np.stack([np.arange(_RAYS), np.arange(_RAYS) * _STEP % _RAYS], axis=1) + 0.5) / _RAYS).astype(np.float32)


def find_rims(image: F32, is_asked: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Find the pixels whose luminance differs most from one beside them, row after row. (n,) int32

    Args:
        image: linear radiance. (height, width, 3) float32
        is_asked: pixels that may be chosen. (height · width,) bool
    """
    luminance = image @ np.array(LUMINANCE, np.float32)
    jump = np.zeros_like(luminance)
    for axis in (0, 1):
        step, one, other = np.abs(np.diff(luminance, axis=axis)), *_beside(jump, axis)
        np.maximum(one, step, out=one)
        np.maximum(other, step, out=other)
    jumps = np.where(is_asked, jump.ravel(), 0)
    chosen = np.flatnonzero(jumps > _LEAST * luminance.mean(dtype=np.float64))
    most = int(_MOST * jumps.size)
    if len(chosen) > most:
        chosen = chosen[np.argpartition(-jumps[chosen], most)[:most]]
    return np.sort(chosen).astype(np.int32)


def _beside(values: F32, axis: int) -> tuple[F32, F32]:
    """Views of all but the last and of all but the first along an axis."""
    moved = np.moveaxis(values, axis, 0)
    return np.moveaxis(moved[:-1], 0, axis), np.moveaxis(moved[1:], 0, axis)


def add_rims(
    transfer: MovingTransfer, wanted: Wanted, seen: Seen, camera: Camera, frame: Frame, shares: Sequence[F32] = ()
) -> Frame:
    """Find anew what pixels across rims show.

    Args:
        transfer, wanted, seen, camera, shares: as of `relume.moving.frame.frame_of`, which made the frame. Of beams,
            all rays of a pixel see what the one through its middle does.
        frame: left as it is.
    """
    height, width, _ = frame.image.shape
    face = seen.hits.face[: width * height]
    has_lobe = wanted.materials.lobes.of[transfer.surface.face_material[np.maximum(face, 0)]] >= 0
    pixels = find_rims(frame.image, has_lobe & (face >= 0))
    if not len(pixels):
        return frame
    more = look_through(transfer.surface, transfer.embree, camera, (width, height), pixels, PLACES)
    mend(more, transfer.parted, transfer.solid)
    owner = np.repeat(pixels, _RAYS)
    owner = np.concatenate([owner, owner[more.panes.ray]])
    found = finished_along(transfer, wanted, more, camera, height, [share[owner] for share in shares])
    image, hides = frame.image.copy(), frame.hides
    image.reshape(-1, 3)[pixels] = found.radiance.reshape(-1, _RAYS, 3).mean(axis=1)
    if hides is not None:
        hides = hides.copy()
        hides.reshape(-1)[pixels] = found.hides.reshape(-1, _RAYS).mean(axis=1)
    return frame._replace(image=image, hides=hides)
