"""The opacity of an imported material, from an alpha texture or one value."""

from __future__ import annotations

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.import_warnings import ImporterWarning, unsupported
from relume.scene.model import Opacity

_OPAQUE = 254  # of 255; tolerates lossy compression of white


def make_opacity(
    alpha: Shaped[NDArray[np.uint8], "height width"] | None,
    wrap: tuple[str, str],
    factor: float,
    cutoff: float | None,
    label: str,
    warnings: list[ImporterWarning],
) -> Opacity | None:
    """Make a material's opacity; None if it is opaque.

    Args:
        alpha: alpha values of its texture, 255 is opaque; None without a texture.
        wrap: wrap mode of the texture. factor: multiplies alpha, in [0, 1].
        cutoff: alpha-test threshold in [0, 1]; None for stochastic transparency.
        label: names the material in warnings. warnings: gets a sentence if the material is invisible.
    """
    opacity = _opacity(alpha, wrap, factor, cutoff)
    if opacity is not None and _is_invisible(opacity):
        warnings.append(unsupported(f"The {label} is fully transparent in the file, so it is invisible."))
    return opacity


def _opacity(
    alpha: NDArray[np.uint8] | None, wrap: tuple[str, str], factor: float, cutoff: float | None
) -> Opacity | None:
    if cutoff is not None and cutoff > 1:
        return Opacity(np.zeros((1, 1), np.uint8), wrap, 1.0)  # invisible
    image = np.full((1, 1), 255, np.uint8) if alpha is None else alpha
    scaled = np.asarray(np.round(np.arange(256) * factor), np.uint8)[image]
    min_alpha = int(scaled.min())
    if min_alpha >= _OPAQUE or (cutoff is not None and min_alpha >= 255 * cutoff):
        return None
    if int(scaled.max()) == min_alpha:
        scaled = scaled[:1, :1]
    return Opacity(np.ascontiguousarray(scaled), wrap, cutoff)


def _is_invisible(opacity: Opacity) -> bool:
    """True if no texel passes the alpha test."""
    threshold = 1 if opacity.cutoff is None else 255 * opacity.cutoff
    return int(opacity.alpha.max()) < threshold
