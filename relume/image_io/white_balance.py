"""White balance of the display: the light that shows as white, by color temperature and tint.

The white lies on the Planckian locus at the temperature (Krystek 1985, CIE 1960 u, v), moved across it by the tint: a
positive one toward green, so that images turn to magenta. von Kries adaptation in Bradford's cone space takes it to the
white of `NEUTRAL_TEMPERATURE` without tint: with the cones ρ of a white of luminance 1 and the matrix B of Rec. 709 to
cones, M = B⁻¹ diag(ρ_neutral / ρ) B. The editor's shader computes the same.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.color import TO_XYZ
from relume.image_io.primaries import BRADFORD

F64 = NDArray[np.float64]

NEUTRAL_TEMPERATURE = 6500.0
"""Temperature that leaves colors unchanged without a tint, kelvin."""

TEMPERATURES = (2800.0, 15_000.0)
TINTS = (-50.0, 50.0)
_TINTS_PER_UV = 3000.0  # 50 is a distance of 0.017 from the locus
_RGB_TO_CONES = BRADFORD @ TO_XYZ


def _planckian(temperature: float) -> F64:
    """u and v (CIE 1960) of a black body, within 1e-4 from 1,000 to 15,000 K. (2,)"""
    square = temperature * temperature
    return np.array(
        [
            (0.860117757 + 1.54118254e-4 * temperature + 1.28641212e-7 * square)
            / (1 + 8.42420235e-4 * temperature + 7.08145163e-7 * square),
            (0.317398726 + 4.22806245e-5 * temperature + 4.20481691e-8 * square)
            / (1 - 2.89741816e-5 * temperature + 1.61456053e-7 * square),
        ]
    )


def _cones(temperature: float, tint: float) -> F64:
    """Responses of Bradford's cones to a white of luminance 1. (3,)"""
    along_u, along_v = _planckian(temperature + 1) - _planckian(temperature - 1)
    across = np.array([along_v, -along_u]) / np.hypot(along_u, along_v)
    u, v = _planckian(temperature) + tint / _TINTS_PER_UV * across
    return np.asarray(BRADFORD @ [1.5 * u / v, 1.0, (4 - u - 10 * v) / (2 * v)])


def balance_matrix(temperature: float, tint: float) -> Shaped[F64, "3 3"]:
    """Matrix that multiplies columns of linear Rec. 709, so that a white becomes neutral.

    Args:
        temperature: correlated color temperature of the white, kelvin, in `TEMPERATURES`.
        tint: distance from the Planckian locus toward green, in `TINTS`.
    """
    gains = _cones(NEUTRAL_TEMPERATURE, 0.0) / _cones(temperature, tint)
    return np.asarray(np.linalg.solve(_RGB_TO_CONES, gains[:, None] * _RGB_TO_CONES))
