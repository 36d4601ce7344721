"""Sun's navigation map: Cook–Torrance materials in the plane of Fresnel reflectance and roughness (Sun 2007, 4.2).

Every point is a material: the colors and parameters of its triangle's corners, with barycentric interpolation. The
roughness axis is logarithmic, because most fits have narrow highlights.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from scipy.spatial import Delaunay

from relume.core.errors import ParameterError
from relume.look.library.materials import Preset, make_preset_terms, presets

F64 = NDArray[np.float64]

_TABLE = "low_cooktorrance_E2"  # uses the term's own Fresnel curve and has all hundred materials


@dataclass(frozen=True)
class NavigationMap:
    """Materials as points of the plane, and a triangulation.

    Attributes:
        f0: reflectance at normal incidence. sigma: roughness of the highlight.
        triangles: indices of presets, counterclockwise in (f0, log σ).
    """

    presets: tuple[Preset, ...]
    f0: Shaped[F64, " materials"]
    sigma: Shaped[F64, " materials"]
    triangles: Shaped[NDArray[np.int64], "triangles 3"]
    _corners: F64 = field(repr=False)

    def at(self, f0: float, sigma: float) -> list[dict[str, Any]]:
        """Return the terms at a point; a point outside the convex hull is moved to the nearest one on it.

        Raises:
            ParameterError: a number is not finite, or σ is not positive.
        """
        if not (math.isfinite(f0) and math.isfinite(sigma) and sigma > 0):
            raise ParameterError("point", (f0, sigma), "f0 and σ as finite numbers, with σ above zero")
        corners, weights = self._barycentric(np.array([f0, math.log(sigma)]))
        position = weights @ self._corners[corners]
        rows = np.array([_numbers(self.presets[k]) for k in corners])
        colors = weights @ rows[:, :6]
        return make_preset_terms(
            "cook_torrance", [*map(float, colors), math.exp(position[1]), ior_from_reflectance(float(position[0])), 0.0]
        )

    def _barycentric(self, point: F64) -> tuple[NDArray[np.int64], F64]:
        """Corners and weights in the triangle that contains a point, or at the nearest point of the hull."""
        corners = self._corners[self.triangles]
        a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
        edges = np.stack([b - a, c - a], axis=2)
        uv = np.linalg.solve(edges, (point - a)[..., None])[..., 0]
        weights = np.column_stack([1.0 - uv.sum(axis=1), uv])
        inside = weights.min(axis=1)
        best = int(np.argmax(inside))
        if inside[best] >= 0:
            return self.triangles[best], weights[best]
        return self._nearest(point)

    def _nearest(self, point: F64) -> tuple[NDArray[np.int64], F64]:
        """Nearest point on any edge, which is on the hull if the point is outside."""
        pairs = np.concatenate([self.triangles[:, [0, 1]], self.triangles[:, [1, 2]], self.triangles[:, [2, 0]]])
        start, along = self._corners[pairs[:, 0]], self._corners[pairs[:, 1]] - self._corners[pairs[:, 0]]
        fraction = np.clip(np.einsum("ec,ec->e", point - start, along) / np.einsum("ec,ec->e", along, along), 0.0, 1.0)
        best = int(np.argmin(np.linalg.norm(start + fraction[:, None] * along - point, axis=1)))
        return pairs[best], np.array([1.0 - fraction[best], fraction[best]])


def reflectance_from_ior(ior: float) -> float:
    """Reflectance at normal incidence for a refractive index of at least 1."""
    return float(((ior - 1) / (ior + 1)) ** 2)


def ior_from_reflectance(f0: float) -> float:
    """Refractive index for a reflectance at normal incidence below 1."""
    root = math.sqrt(f0)
    return (1 + root) / (1 - root)


def _numbers(preset: Preset) -> list[float]:
    diffuse, highlight = preset.terms
    return [*diffuse["color"], *highlight["color"], *highlight["params"].values()]


@cache
def navigation_map() -> NavigationMap:
    """Return the map of the library's Cook–Torrance materials."""
    map_presets = tuple(preset for preset in presets() if preset.id.startswith(_TABLE + "/"))
    params = [preset.terms[1]["params"] for preset in map_presets]
    f0 = np.array([reflectance_from_ior(p["ior"]) for p in params])
    sigma = np.array([p["sigma"] for p in params])
    corners = np.column_stack([f0, np.log(sigma)])
    # scaled to equal axes: Delaunay maximizes the smallest angle
    triangles = Delaunay(corners / np.ptp(corners, axis=0)).simplices.astype(np.int64)
    a, b, c = (corners[triangles[:, k]] for k in range(3))
    orientation = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    triangles[orientation < 0] = triangles[orientation < 0][:, [0, 2, 1]]
    return NavigationMap(map_presets, f0, sigma, triangles, corners)
