"""Conversion of linear radiance to display values: white balance, exposure, contrast, tone map or view, and a LUT."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.image_io.contrast import NEUTRAL_CONTRAST, apply_contrast
from relume.image_io.ocio.view import OcioView
from relume.image_io.tone_mapping import MAX_RADIANCE, tone_map
from relume.image_io.white_balance import NEUTRAL_TEMPERATURE, balance_matrix

F32 = NDArray[np.float32]


@dataclass(frozen=True)
class DisplayTransform:
    """Settings of the conversion.

    Attributes:
        exposure: stops. tone_map: one of TONE_MAPS, or a view of the active OpenColorIO config.
        temperature, tint: the light that shows as white, as in `balance_matrix`.
        lut: display values by display values, as from `read_cube`; None: no LUT.
        contrast: as in `apply_contrast`.
    """

    exposure: float = 0.0
    tone_map: str | OcioView = "agx"
    temperature: float = NEUTRAL_TEMPERATURE
    tint: float = 0.0
    lut: Shaped[NDArray[np.uint16], "N N N 3"] | None = None
    contrast: float = NEUTRAL_CONTRAST

    @property
    def is_graded(self) -> bool:
        """True if white balance or contrast change the image."""
        return (self.temperature, self.tint, self.contrast) != (NEUTRAL_TEMPERATURE, 0.0, NEUTRAL_CONTRAST)


def to_display(
    image: Shaped[F32, "height width 3"], transform: DisplayTransform, *, use_table: bool = False
) -> Shaped[F32, "height width 3"]:
    """Convert linear radiance to display values in [0, 1].

    Args:
        image: linear Rec. 709; negative values and NaN become black. transform: the settings.
        use_table: as in `tone_map`.
    Raises:
        ParameterError, ShapeMismatchError: as `tone_map` does.
    """
    graded = _graded(image, transform) if transform.is_graded else image
    # exposure is before contrast
    display = tone_map(graded, transform.contrast * transform.exposure, transform.tone_map, use_table=use_table)
    if transform.lut is not None:
        from relume.image_io.ocio.sampling import apply_display_lut  # compiled

        apply_display_lut(transform.lut, display.reshape(-1, 3))
    return display


def _graded(image: F32, transform: DisplayTransform) -> F32:
    matrix = balance_matrix(transform.temperature, transform.tint).astype(np.float32)
    balanced = np.clip(np.nan_to_num(image, nan=0.0), 0, MAX_RADIANCE) @ matrix.T
    return (
        balanced
        if transform.contrast == NEUTRAL_CONTRAST
        else apply_contrast(np.maximum(balanced, 0), transform.contrast)
    )
