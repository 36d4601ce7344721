"""Coverage (alpha) of every pixel, cached and updated where shadows change."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from scipy.sparse import csr_array

from relume.live.fixed_camera.material_image import MaterialImage
from relume.views.view import View

F32 = NDArray[np.float32]


class Coverage:
    """Coverage is 1 on surfaces, 0 on the background, and `shadow_opacity` per sample, (n,), on shadow catchers.

    A shadow catcher is evaluated again after its radiance has been written.
    """

    def __init__(self, view: View, shadow_opacity: Callable[[MaterialImage], F32]) -> None:
        self._view, self._shadow_opacity = view, shadow_opacity
        self._samples = np.ones(view.num_view_samples, np.float32)
        self._samples[view.num_surface_samples :] = 0
        shape = view.width * view.height, view.num_view_samples
        self._pixel_weights = csr_array((view.throughput.mean(axis=1), view.order, view.first), shape=shape)
        self._num_composed: dict[int, int] = {}
        self._pixels: F32 | None = None

    def pixels(self, materials: Iterable[MaterialImage]) -> Shaped[F32, "height width"]:
        """Return the coverage of the displayed materials, float32."""
        for material in materials:
            if self._num_composed.get(material.index, 0) != material.num_composed:
                self._num_composed[material.index] = material.num_composed
                self._update(material)
        if self._pixels is None:
            # glass covers nothing, but attenuates the background
            coverage = np.clip(1 - self._pixel_weights @ (1 - self._samples), 0, 1)
            self._pixels = coverage.reshape(self._view.height, self._view.width)
        return self._pixels

    def _update(self, material: MaterialImage) -> None:
        coverage = self._samples[self._view.rows(material.index)]
        if material.is_shadow_catcher:
            coverage[:] = self._shadow_opacity(material)
            self._pixels = None
        elif not (coverage == 1).all():
            coverage[:] = 1
            self._pixels = None
