"""A view whose eye moves: a name, and where it begins."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relume.scene.model import Camera

F64 = NDArray[np.float64]


@dataclass(frozen=True)
class FreeView:
    """Where a moving eye begins, and how large its picture is at first, pixels.

    Attributes:
        bounds: the lowest and the highest corner of what there is to see, metres. (3,) each
    """

    camera: Camera
    width: int
    height: int
    bounds: tuple[F64, F64]

    @property
    def name(self) -> str:
        """The name of its camera."""
        return self.camera.name
