"""Fidelity of images: one word, inside and on the wire."""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple


class Fidelity(StrEnum):
    """Exactness of an image with respect to its look, worst first; of several images, the worst counts.

    - PREVIEW: few samples of the target are shaded, and the others interpolated; or nothing is shown yet.
    - APPROXIMATE: an older look, the most important coefficients of the target, or a free-camera image.
    - INCREMENTAL: an exact image plus the approximate change of its light, or of a curve by merged lights or a subset
      of the samples.
    - NEAR_EXACT: a sum over the few nodes of a parameter, of quantized columns, or with noticeable float32 rounding;
      within a thousandth (relative RMS).
    - EXACT: the complete sum over all light that was baked.

    Everything below EXACT is replaced when nobody edits. The first exact image after a free camera stopped comes with
    the error of the image that was shown while it moved (`free_camera_error`).
    """

    PREVIEW = "preview"
    APPROXIMATE = "approximate"
    INCREMENTAL = "incremental"
    NEAR_EXACT = "near_exact"
    EXACT = "exact"

    def __lt__(self, other: str) -> bool:
        return _ORDER.index(self) < _ORDER.index(other)

    def __le__(self, other: str) -> bool:
        return _ORDER.index(self) <= _ORDER.index(other)

    def __gt__(self, other: str) -> bool:
        return _ORDER.index(self) > _ORDER.index(other)

    def __ge__(self, other: str) -> bool:
        return _ORDER.index(self) >= _ORDER.index(other)


_ORDER: tuple[str, ...] = tuple(Fidelity)


class ImageError(NamedTuple):
    """Error of an approximate image against the exact one, over surfaces.

    Attributes:
        delta_e: mean CIEDE2000 difference of the displayed images. rms: relative RMS error of linear radiance.
    """

    delta_e: float
    rms: float
