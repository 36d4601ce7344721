"""Tone mapping: applies exposure, a tone curve and sRGB encoding to linear radiance.

The editor's shader computes the same. An OpenColorIO view can replace the tone curve and sRGB; its output is for the
view's display.

`agx`: the base look of Troy Sobotka's AgX, with the polynomial curve of Benjamin Wrensch ("Minimal AgX Implementation",
2023). `filmic`: Krzysztof Narkowicz, "ACES Filmic Tone Mapping Curve", 2015. `none`: no curve, clipped at one.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import ParameterError, ShapeMismatchError
from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import for_ranges
from relume.image_io.ocio.active_config import require_config
from relume.image_io.ocio.view import OcioView

F32 = NDArray[np.float32]

TONE_MAPS = ("none", "agx", "filmic")
_AGX, _FILMIC = np.int64(1), np.int64(2)
_PIXELS_PER_RANGE = 1 << 15

_ZERO, _ONE = np.float32(0), np.float32(1)
MAX_RADIANCE = np.float32(1e9)  # far above white in every tone curve; avoids inf/inf
AGX_INSET = np.array(
    [
        [0.842479062253094, 0.0784335999999992, 0.0792237451477643],
        [0.0423282422610123, 0.878468636469772, 0.0791661274605434],
        [0.0423756549057051, 0.0784336, 0.879142973793104],
    ],
    np.float32,
)
AGX_OUTSET = np.array(
    [
        [1.19687900512017, -0.0980208811401368, -0.0990297440797205],
        [-0.0528968517574562, 1.15190312990417, -0.0989611768448433],
        [-0.0529716355144438, -0.0980434501171241, 1.15107367264116],
    ],
    np.float32,
)
AGX_MIN_EV, AGX_RANGE_EV = np.float32(-12.47393), np.float32(4.026069 + 12.47393)
_MIN_RADIANCE = np.float32(1e-10)  # has a logarithm, and lies below AGX_MIN_EV


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def agx_curve(v):  # type: ignore[no-untyped-def]
    x = min(max((math.log2(max(v, _MIN_RADIANCE)) - AGX_MIN_EV) / AGX_RANGE_EV, _ZERO), _ONE)
    p = np.float32(15.5) * x - np.float32(40.14)
    p = p * x + np.float32(31.96)
    p = p * x - np.float32(6.868)
    p = p * x + np.float32(0.4298)
    p = p * x + np.float32(0.1191)
    return p * x - np.float32(0.00232)


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _srgb(v):  # type: ignore[no-untyped-def]
    v = min(max(v, _ZERO), _ONE)
    if v <= np.float32(0.0031308):
        return np.float32(12.92) * v
    return np.float32(1.055) * v ** np.float32(1 / 2.4) - np.float32(0.055)


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _filmic(x):  # type: ignore[no-untyped-def]
    above = x * (np.float32(2.51) * x + np.float32(0.03))
    return above / (x * (np.float32(2.43) * x + np.float32(0.59)) + np.float32(0.14))


@nb.njit("void(float32[:, ::1], float32, int64, float32[:, ::1], int64, int64)", nogil=True, cache=True)
def _tone_map_rows(pixels, gain, kind, out, start, stop):  # type: ignore[no-untyped-def]
    rgb = np.empty(3, np.float32)
    for k in range(start, stop):
        for c in range(3):
            v = gain * pixels[k, c]
            rgb[c] = min(v, MAX_RADIANCE) if v > _ZERO else _ZERO  # NaN is not above zero
        if kind == _AGX:
            for c in range(3):
                out[k, c] = agx_curve(AGX_INSET[c, 0] * rgb[0] + AGX_INSET[c, 1] * rgb[1] + AGX_INSET[c, 2] * rgb[2])
            rgb[0], rgb[1], rgb[2] = out[k, 0], out[k, 1], out[k, 2]
            for c in range(3):
                v = AGX_OUTSET[c, 0] * rgb[0] + AGX_OUTSET[c, 1] * rgb[1] + AGX_OUTSET[c, 2] * rgb[2]
                out[k, c] = min(max(v, _ZERO), _ONE)
        else:
            for c in range(3):
                out[k, c] = _srgb(_filmic(rgb[c]) if kind == _FILMIC else rgb[c])


def tone_map(
    image: Shaped[F32, "height width channels"], exposure: float, name: str | OcioView, *, use_table: bool = False
) -> Shaped[F32, "height width channels"]:
    """Convert linear radiance to display values in [0, 1]: sRGB, or for the display of an OpenColorIO view.

    Args:
        image: linear Rec. 709; negative values and NaN become black.
        exposure: stops. name: one of TONE_MAPS, or a view of the active config.
        use_table: evaluate OpenColorIO views by LUTs, as the editor's shader does, instead of by the library.
    Raises:
        ParameterError: there is no tone map of that name. ShapeMismatchError: not an RGB image.
    """
    if image.ndim != 3 or image.shape[2] != 3:
        raise ShapeMismatchError(f"an image has the shape (height, width, 3), not {image.shape}; reshape it")
    pixels, gain = np.ascontiguousarray(image, np.float32).reshape(-1, 3), np.float32(2.0**exposure)
    display = (
        _apply_view(pixels, gain, name, use_table)
        if isinstance(name, OcioView)
        else _apply_tone_map(pixels, gain, name)
    )
    return display.reshape(image.shape)


def _apply_tone_map(pixels: F32, gain: np.float32, name: str) -> F32:
    if name not in TONE_MAPS:
        raise ParameterError("tone_map", name, f"one of {', '.join(TONE_MAPS)}")
    out, kind = np.empty_like(pixels), TONE_MAPS.index(name)
    for_ranges(lambda start, stop: _tone_map_rows(pixels, gain, kind, out, start, stop), len(pixels), _PIXELS_PER_RANGE)
    return out


def _apply_view(pixels: F32, gain: np.float32, view: OcioView, use_table: bool) -> F32:
    display = np.clip(np.nan_to_num(gain * pixels, nan=0.0), 0, MAX_RADIANCE)
    require_config().apply_view(display, view, use_table=use_table)
    return np.asarray(np.clip(np.nan_to_num(display, copy=False), 0, 1), np.float32)
