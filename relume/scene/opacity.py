"""The opacity of an imported material: an image where it has one, one value where it has not."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relume.core.import_warnings import ImporterWarning, unsupported
from relume.scene.model import Opacity

_OPAQUE = 254  # of 255; below that lies what lossy images do to a white one


def make_opacity(
    alpha: NDArray[np.uint8] | None,
    wrap: tuple[str, str],
    factor: float,
    cutoff: float | None,
    label: str,
    warnings: list[ImporterWarning],
) -> Opacity | None:
    """Make a material's opacity; None where it is whole.

    Args:
        alpha: of its image, 255 where it is there; None where it has none. (height, width) uint8
        wrap: how the image continues. factor: multiplies it, within [0, 1].
        cutoff: share from which the surface is there; None where alpha is the share itself.
        label: names the material. warnings: gets a sentence where nothing of it is there.
    """
    opacity = _opacity(alpha, wrap, factor, cutoff)
    if opacity is not None and _is_invisible(opacity):
        warnings.append(unsupported(f"{label} is transparent everywhere, as the file says; nothing of it is seen"))
    return opacity


def _opacity(
    alpha: NDArray[np.uint8] | None, wrap: tuple[str, str], factor: float, cutoff: float | None
) -> Opacity | None:
    if cutoff is not None and cutoff > 1:
        return Opacity(np.zeros((1, 1), np.uint8), wrap, 1.0)  # nothing of it is there
    image = np.full((1, 1), 255, np.uint8) if alpha is None else alpha
    scaled = np.asarray(np.round(np.arange(256) * factor), np.uint8)[image]
    min_alpha = int(scaled.min())
    if min_alpha >= _OPAQUE or (cutoff is not None and min_alpha >= 255 * cutoff):
        return None
    if int(scaled.max()) == min_alpha:
        scaled = scaled[:1, :1]
    return Opacity(np.ascontiguousarray(scaled), wrap, cutoff)


def _is_invisible(opacity: Opacity) -> bool:
    """Tell whether nothing of the surface is there."""
    threshold = 1 if opacity.cutoff is None else 255 * opacity.cutoff
    return int(opacity.alpha.max()) < threshold
