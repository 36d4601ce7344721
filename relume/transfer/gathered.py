"""Light that arrives by reflection, as the projector takes it: gather rays, each with the radiance of the cell it hits.

R(x) = Σ_r w_r L(link_r) q(x, ω_r) Π_f curve_f(angle_f(x, ω_r)),   w_r = cos θi over the density of rays
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from relume.brdf.term import Term
from relume.light.bounces import bounced, irradiance
from relume.light.triangles import TriangleLights
from relume.trace.cell_tree import NO_CELL
from relume.trace.gather_rays import Pattern
from relume.transfer.ray_kernel import list_rays, project_rays

if TYPE_CHECKING:
    from relume.transfer.projector import Contraction, Receivers

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


@dataclass(frozen=True)
class GatherRays:
    """Rays of n points.

    Attributes:
        links: cell that each hits. (n, rays) uint16
        numbers: of the points among all that share the pattern. (n,) uint32
        radiance: of cells, from `CellLight.radiance`. (NO_CELL + 1, 3) float32
    """

    links: NDArray[np.uint16]
    pattern: Pattern
    numbers: NDArray[np.uint32]
    radiance: F32


class RayProjector:
    """Adds the rays of points to what a projector has made of its lights; holds the scratch memory of one thread.

    Args:
        capacity: points of the largest range.
    """

    def __init__(
        self,
        term: Term,
        contraction: Contraction,
        points: Receivers,
        rays: GatherRays,
        capacity: int,
    ) -> None:
        self._term, self._contraction, self._points, self._rays = term, contraction, points, rays
        self._radiance = rays.radiance * contraction.constant
        self._first = np.empty(capacity + 1, np.int64)
        self._wi, self._wo, self._power = np.empty((3, 3, capacity * rays.links.shape[1]), np.float32)

    def add(self, start: int, stop: int, out: F32) -> None:
        """Add points [start, stop) to `out`, laid out as `project_rays` has it."""
        c, points, rays = self._contraction, self._points, self._rays
        first, wi, wo, power = self._first, self._wi, self._wo, self._power
        num = list_rays(
            points.normal, points.tangent, points.wo, rays.links, rays.pattern, rays.numbers, self._radiance,
            start, stop, first, wi, wo, power,
        )  # fmt: skip
        shading = self._term.quotients(*wi[:, :num], *wo[:, :num])
        project_rays(
            first, wi, wo, power, shading,
            c.kinds, c.axes, c.num_bands, c.bands, c.num_rows, c.settings, c.setting_of, c.active, out,
        )  # fmt: skip
