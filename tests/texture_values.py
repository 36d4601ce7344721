"""Values of textures, whatever the type of their pixels."""

from __future__ import annotations

import numpy as np

from relume.scene.model import Texture
from relume.scene.texture_encoding import decode_rows


def get_texture_values(texture: Texture) -> np.ndarray:
    """Linear RGB, or normals. (height, width, 3) float32"""
    return np.concatenate(list(decode_rows(texture)))
