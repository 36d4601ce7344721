"""How much every pixel of a view hides of what is put behind the picture: kept, and made anew where a shadow is."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from relume.picture.material_image import MaterialImage
from relume.views.view import View

F32 = NDArray[np.float32]


class Coverage:
    """Of surfaces one, of the background nothing, of catchers what `hidden_by` says of their samples, (n,).

    Catchers are asked about again once their radiance has been written anew.
    """

    def __init__(self, view: View, hidden_by: Callable[[MaterialImage], F32]) -> None:
        self._view, self._hidden_by = view, hidden_by
        self._samples = np.ones(view.num_view_samples, np.float32)
        self._samples[view.num_surface_samples :] = 0
        shape = view.width * view.height, view.num_view_samples
        self._shares = csr_array((view.gains.mean(axis=1), view.order, view.first), shape=shape)
        self._seen: dict[int, int] = {}
        self._pixels: F32 | None = None

    def pixels(self, materials: Iterable[MaterialImage]) -> F32:
        """As the materials are shown now. (height, width) float32"""
        for material in materials:
            if self._seen.get(material.index, 0) != material.num_composed:
                self._seen[material.index] = material.num_composed
                self._follow(material)
        if self._pixels is None:
            whole = np.clip(
                1 - self._shares @ (1 - self._samples), 0, 1
            )  # glass hides nothing, but dims what is behind
            self._pixels = whole.reshape(self._view.height, self._view.width)
        return self._pixels

    def _follow(self, material: MaterialImage) -> None:
        own = self._samples[self._view.rows(material.index)]
        if material.is_caught:
            own[:] = self._hidden_by(material)
            self._pixels = None
        elif not (own == 1).all():
            own[:] = 1
            self._pixels = None
