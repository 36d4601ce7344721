"""Gather cells, and what they send out: the light that gather rays bring back from the surfaces they hit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relume.light.bounces import bounced, irradiance
from relume.light.triangles import TriangleLights
from relume.trace.cell_tree import NO_CELL

F32 = NDArray[np.float32]

# of light between white walls 1e-3 is left after 22 bounces, where they reflect 0.73
NUM_BOUNCES = 24


Reflectances = tuple[tuple[float, ...], ...]
"""Of each material, from `relume.brdf.albedo.reflectances_of`."""


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

    def reflectance(self, reflectances: Reflectances) -> F32:
        """Diffuse reflectance of every cell, never above one. (C, 3) float32"""
        plain, *textured = np.array(reflectances).reshape(-1, 3, 3)[self.material].transpose(1, 0, 2)
        for of_texture, multiplier in zip(textured, self.textures, strict=True):
            plain += of_texture * multiplier
        return np.asarray(np.clip(plain, 0.0, 1.0), np.float32)

    def radiance(self, lights: TriangleLights, reflectances: Reflectances, num_bounces: int = NUM_BOUNCES) -> F32:
        """What every cell sends out; row `NO_CELL` is black.

        Args:
            num_bounces: reflections between cells; none leaves what they reflect of the lights themselves.
        Returns:
            (NO_CELL + 1, 3) float32
        """
        points, of_points = self.normal.reshape(-1, 3), self.visible.reshape(self.normal[..., 0].size, -1)
        arriving = irradiance(points, of_points, lights).reshape(self.normal.shape).mean(axis=1, dtype=np.float64)
        reflectance = self.reflectance(reflectances)
        direct = (reflectance / np.pi * arriving).astype(np.float32)
        radiance = np.zeros((NO_CELL + 1, 3), np.float32)
        radiance[: len(direct)] = bounced(self.links, reflectance, direct, num_bounces)
        return radiance
