"""Gather cells, and what they send out: the light that gather rays bring back from the surfaces they hit."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from relume.brdf.albedo import Reflectances
from relume.light.triangles import TriangleLights
from relume.methods.bounces import bounce, bounced, irradiance, preview_bounced
from relume.trace.cell_tree import NO_CELL

F32 = NDArray[np.float32]

_FEW = 16  # one ray in so many is enough for a moving hand, but for the first bounce


@dataclass(frozen=True)
class CellLight:
    """The gather cells of a bake, and what they send out under any light and look; shared by all its pictures.

    Attributes:
        normal: of the points that stand for them. (C, points a cell, 3) float32
        visible: lights that those points see. (C, points a cell, bytes) uint8
        links: of their gather rays. (C, rays) uint16
        material: index into the scene's materials. (C,) uint16
        textures: multipliers of each of `relume.brdf.albedo.TEXTURES`. (2, C, 3) float32
    """

    normal: F32
    visible: NDArray[np.uint8]
    links: NDArray[np.uint16]
    material: NDArray[np.uint16]
    textures: F32

    @cached_property
    def _few_links(self) -> NDArray[np.uint16]:
        """Other rays for each of the cells beside each other: a stretch of the pattern would see one side alone."""
        cell, num = np.arange(self.num_cells)[:, None], max(1, self.links.shape[1] // _FEW)
        return np.ascontiguousarray(self.links[cell, (cell % _FEW + _FEW * np.arange(num)) % self.links.shape[1]])

    @property
    def num_cells(self) -> int:
        """C."""
        return len(self.material)

    def reflectance(self, reflectances: Reflectances) -> F32:
        """Reflectance of every cell, never above one. (C, 3) float32"""
        plain, *textured = np.array(reflectances).reshape(-1, 3, 3)[self.material].transpose(1, 0, 2)
        for of_texture, multiplier in zip(textured, self.textures, strict=True):
            plain += of_texture * multiplier
        return np.asarray(np.clip(plain, 0.0, 1.0), np.float32)

    def irradiance(self, lights: TriangleLights) -> F32:
        """What comes to every cell from the lights themselves, the mean over its points. (C, 3) float32"""
        points, of_points = self.normal.reshape(-1, 3), self.visible.reshape(-1, self.visible.shape[2])
        arriving = irradiance(points, of_points, lights).reshape(self.normal.shape)
        return np.asarray(arriving.mean(axis=1, dtype=np.float64), np.float32)

    def radiance(self, irradiance: F32, reflectance: F32, first: int, last: int, *, is_preview: bool = False) -> F32:
        """What every cell sends out of light that surfaces have reflected `first` to `last` times, its own included.

        Args:
            irradiance, reflectance: from the methods of these names. (C, 3) float32 each
            first: at least 1. last: not less.
            is_preview: a hundredth may be wrong, in a fifth of the time.
        Returns:
            Row `NO_CELL` is black. (NO_CELL + 1, 3) float32
        """
        sent = (reflectance / np.pi * irradiance).astype(np.float32)
        for _ in range(first - 1):
            sent = bounce(self.links, reflectance, sent)
        radiance = np.zeros((NO_CELL + 1, 3), np.float32)
        if is_preview:
            radiance[: len(sent)] = preview_bounced(self.links, self._few_links, reflectance, sent, last - first)
        else:
            radiance[: len(sent)] = bounced(self.links, reflectance, sent, last - first)
        return radiance
