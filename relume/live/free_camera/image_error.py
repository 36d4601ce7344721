"""Error of a free-camera image against the exact one: as it is displayed, and of radiance.

Both are over the pixels that show surfaces, because the background is exact.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.image_io.color_difference import color_difference
from relume.image_io.display_transform import to_display
from relume.live.fixed_camera.fidelity import ImageError
from relume.live.free_camera.primary_visibility import GBuffer
from relume.look.model import DisplayLook

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


class PixelErrors(NamedTuple):
    """Terms of the error, of each compared pixel; zero without a surface. (height, width) each

    Attributes:
        delta_e: CIEDE2000 difference. squared_error, squared_radiance: sums over channels.
        is_surface: 1 for pixels that show a surface.
    """

    delta_e: F64
    squared_error: F64
    squared_radiance: F64
    is_surface: F64

    def sum(self) -> ImageError | None:
        """Return the error of the whole image; None if no surface is visible, or all surfaces are black."""
        delta_e, squared_error, squared_radiance, num = (float(term.sum()) for term in self)
        return ImageError(delta_e / num, float(np.sqrt(squared_error / squared_radiance))) if squared_radiance else None


def pixel_errors(
    image: Shaped[F32, "height width 3"],
    exact: Shaped[F32, "height width 3"],
    gbuffer: GBuffer,
    display: DisplayLook,
    step: int = 1,
) -> PixelErrors:
    """Compare a free-camera image with the exact one.

    Args:
        image, exact: linear radiance. gbuffer: of the image; its first rays go through pixel centers.
        display: conversion to display values. step: compare each step-th pixel of each step-th row.
    """
    height, width = image.shape[:2]
    is_surface = gbuffer.shows_surface(width * height).reshape(height, width)[::step, ::step].astype(np.float64)
    image, exact = image[::step, ::step], exact[::step, ::step]
    displayed, exact_displayed = (to_display(each, display.transform) for each in (image, exact))
    reference = exact.astype(np.float64)
    return PixelErrors(
        is_surface * color_difference(displayed, exact_displayed),
        is_surface * ((image - reference) ** 2).sum(axis=2),
        is_surface * (reference**2).sum(axis=2),
        is_surface,
    )
