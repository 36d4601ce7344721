"""What textures show, whatever their pixels are kept as."""

from __future__ import annotations

import numpy as np

from relume.scene.coding import rows_of
from relume.scene.model import Texture


def values_of(texture: Texture) -> np.ndarray:
    """Linear RGB, or normals. (height, width, 3) float32"""
    return np.concatenate(list(rows_of(texture)))
