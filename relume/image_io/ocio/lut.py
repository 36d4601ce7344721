"""LUTs of OpenColorIO views, for the editor's shader.

A LUT has N³ nodes over s(x) = log(1 + G √x) / (2 log(1 + G)) of each channel, linear Rec. 709 after exposure: uniform
in roots near black, where displays have power curves, and in stops above, with a node at 1, where many views bend.
Values above s⁻¹(1) = 121, seven stops over 1, are clamped to it. Interpolation is tetrahedral: grays depend on grays
alone (docs/adr/0026-ocio-and-exr.md).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
U16 = NDArray[np.uint16]

SIZE = 65
"""N, nodes per channel."""

GAIN = 9.0
"""G, factor of roots before the logarithm."""

LAYOUT = f"roots {SIZE} {GAIN}"
"""Identifies the scale: browsers cache LUTs by it."""


def build_lut(apply_view: Callable[[F32], None]) -> Shaped[U16, "N N N 3"]:
    """Build the LUT of a view.

    Args:
        apply_view: converts linear radiance to display values, in place. (n, 3)
    Returns:
        Display values, 65535 for 1; red varies slowest
    """
    light = (np.expm1(2 * np.log1p(GAIN) * np.arange(SIZE) / (SIZE - 1)) / GAIN) ** 2
    nodes = np.stack(np.meshgrid(light, light, light, indexing="ij"), axis=-1).astype(np.float32)
    apply_view(nodes.reshape(-1, 3))
    return np.asarray(np.clip(np.nan_to_num(nodes), 0, 1) * 65535 + 0.5, np.uint16)
