"""A view of a free camera: its name and initial camera."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.scene.model import Camera

F64 = NDArray[np.float64]


@dataclass(frozen=True)
class FreeView:
    """The initial camera of a view, and its image size in pixels.

    Attributes:
        bounds: lowest and highest corner of the scene, meters.
    """

    camera: Camera
    width: int
    height: int
    bounds: tuple[Shaped[F64, " 3"], Shaped[F64, " 3"]]

    @property
    def name(self) -> str:
        """The name of its camera."""
        return self.camera.name
