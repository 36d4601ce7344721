"""Inverse tone mapping: linear radiance from display values, as far as the tone map does not clip them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.color import srgb_decode
from relume.core.errors import ParameterError
from relume.image_io.ocio.view import OcioView
from relume.image_io.tone_mapping import AGX_INSET, AGX_MIN_EV, AGX_OUTSET, AGX_RANGE_EV, TONE_MAPS, agx_curve

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
_TABLE_SIZE = 4096


def inverse_tone_map(
    display: Shaped[F32, "height width 3"], exposure: float, name: str | OcioView
) -> Shaped[F32, "height width 3"]:
    """Convert display values to the linear radiance that `tone_map` shows as these.

    Values at which the tone map clips become the radiance at its limits. An OpenColorIO view has no inverse here.

    Args:
        display: values in [0, 1]. exposure: stops. name: one of `TONE_MAPS`.
    Raises:
        ParameterError: the tone map has no inverse.
    """
    if not isinstance(name, str) or name not in _INVERSES:
        raise ParameterError("tone_map", str(name)[:80], f"one of {', '.join(TONE_MAPS)}, whose inverse is known")
    radiance = _INVERSES[name](np.clip(display, 0.0, 1.0).astype(np.float64))
    return np.asarray(np.maximum(radiance, 0.0) * 2.0**-exposure, np.float32)


def _filmic(display: F64) -> F64:
    """Solve y (2.43 x² + 0.59 x + 0.14) = 2.51 x² + 0.03 x for the positive x."""
    y = np.minimum(srgb_decode(display), 0.9999)
    a, b, c = 2.51 - 2.43 * y, 0.03 - 0.59 * y, -0.14 * y
    return np.asarray((-b + np.sqrt(b * b - 4.0 * a * c)) / (2.0 * a))


def _agx(display: F64) -> F64:
    curve, log_radiance = _agx_table()
    toned = display @ np.linalg.inv(AGX_OUTSET.astype(np.float64)).T
    return np.asarray(np.exp2(np.interp(toned, curve, log_radiance)) @ np.linalg.inv(AGX_INSET.astype(np.float64)).T)


@lru_cache(maxsize=1)
def _agx_table() -> tuple[Shaped[F64, " n"], Shaped[F64, " n"]]:
    """The AgX curve, which rises, and the log₂ radiance of its values."""
    first = float(AGX_MIN_EV)
    log_radiance = np.linspace(first, first + float(AGX_RANGE_EV), _TABLE_SIZE)
    curve = np.array([agx_curve(np.float32(2.0**stops)) for stops in log_radiance], np.float64)
    return np.asarray(np.maximum.accumulate(curve)), log_radiance


_INVERSES: Mapping[str, Callable[[F64], F64]] = {"none": srgb_decode, "agx": _agx, "filmic": _filmic}
