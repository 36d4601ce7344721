"""Views as tables, for whoever has no OpenColorIO: the editor's shader.

The table has N³ nodes over s(x) = log(1 + G √x) / (2 log(1 + G)) of each channel, linear Rec. 709 after exposure: even
in roots near black, where displays have powers, and in stops above, with a node on 1, where many views bend. Light
above s⁻¹(1) = 121, seven stops over 1, is as bright as that. Between nodes goes tetrahedral interpolation: greys come
from greys alone (docs/adr/0026-ocio-and-exr.md).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
U16 = NDArray[np.uint16]

SIZE = 65
"""N, nodes of a channel."""

GAIN = 9.0
"""G, by which roots are multiplied before their logarithm."""

LAYOUT = f"roots {SIZE} {GAIN}"
"""Names the scale: browsers keep tables, those of another scale are others."""


def build_lut(apply_view: Callable[[F32], None]) -> U16:
    """The table of a view.

    Args:
        apply_view: turns linear light into display values, in place. (n, 3)
    Returns:
        Display values, 65535 for 1; red is the slowest. (N, N, N, 3) uint16
    """
    light = (np.expm1(2 * np.log1p(GAIN) * np.arange(SIZE) / (SIZE - 1)) / GAIN) ** 2
    nodes = np.stack(np.meshgrid(light, light, light, indexing="ij"), axis=-1).astype(np.float32)
    apply_view(nodes.reshape(-1, 3))
    return np.asarray(np.clip(np.nan_to_num(nodes), 0, 1) * 65535 + 0.5, np.uint16)
