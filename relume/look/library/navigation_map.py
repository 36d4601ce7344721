"""Sun's navigation maps: Cook–Torrance materials in the plane of Fresnel reflectance and roughness (Sun 2007, 4.2).

Every point is a material: the colors and parameters of its triangle's corners, with barycentric interpolation. The
roughness axis is logarithmic, because most fits have narrow highlights. Two tables of fits to MERL: Ngan 2005, as in
the paper's figure 7, with metals of extinction k > 0; and Löw 2012, all with k = 0.

A reflectance F0 is reached by any η from 1 to that of the dielectric, (1 + √F0)/(1 − √F0), each with its own k. The
interpolated number is the dielectric fraction t, at which η = 1 + t (η_dielectric − 1), so that every point of a map
has its F0 and k² ≥ 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cache
from typing import Any, Literal

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from scipy.spatial import Delaunay

from relume.core.errors import ParameterError
from relume.look.library.materials import Preset, make_preset_terms, presets

F64 = NDArray[np.float64]

MapTable = Literal["ngan", "low"]
_PRESET_TABLES: dict[MapTable, str] = {"ngan": "ngan_cooktorrance", "low": "low_cooktorrance_E2"}


@dataclass(frozen=True)
class NavigationMap:
    """Materials as points of the plane, and a triangulation.

    Attributes:
        f0: reflectance at normal incidence. sigma: roughness of the highlight.
        triangles: indices of presets, counterclockwise in (f0, log σ).
        numbers: interpolated numbers of each material: diffuse RGB, highlight RGB, dielectric fraction.
    """

    presets: tuple[Preset, ...]
    f0: Shaped[F64, " materials"]
    sigma: Shaped[F64, " materials"]
    triangles: Shaped[NDArray[np.int64], "triangles 3"]
    numbers: Shaped[F64, "materials 7"] = field(repr=False)
    _corners: F64 = field(repr=False)

    def at(self, f0: float, sigma: float) -> list[dict[str, Any]]:
        """Return the terms at a point; a point outside the convex hull is moved to the nearest one on it.

        Raises:
            ParameterError: a number is not finite, or σ is not positive.
        """
        if not (math.isfinite(f0) and math.isfinite(sigma) and sigma > 0):
            raise ParameterError("point", (f0, sigma), "f0 and σ as finite numbers, with σ above zero")
        position, numbers = self.interpolate(np.array([f0, math.log(sigma)]))
        ior, extinction = conductor(float(position[0]), float(numbers[6]))
        return make_preset_terms("cook_torrance", [*map(float, numbers[:6]), math.exp(position[1]), ior, extinction])

    def interpolate(self, point: Shaped[F64, " 2"]) -> tuple[Shaped[F64, " 2"], Shaped[F64, " 7"]]:
        """Return the position on the map nearest to a point (f0, log σ), and the interpolated `numbers` there."""
        corners, weights = self._barycentric(point)
        return weights @ self._corners[corners], weights @ self.numbers[corners]

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


def reflectance(ior: float, extinction: float = 0.0) -> float:
    """Reflectance at normal incidence for a refractive index and extinction."""
    return ((ior - 1) ** 2 + extinction**2) / ((ior + 1) ** 2 + extinction**2)


def dielectric_fraction(ior: float, extinction: float) -> float:
    """Return t of a refractive index η ≥ 1: 0 at η = 1, 1 without extinction."""
    dielectric = _dielectric_ior(reflectance(ior, extinction))
    return 1.0 if dielectric == 1 else min((ior - 1) / (dielectric - 1), 1.0)


def conductor(f0: float, fraction: float) -> tuple[float, float]:
    """Return η and k with a reflectance below 1 at normal incidence and a dielectric fraction."""
    ior = 1 + fraction * (_dielectric_ior(f0) - 1)
    extinction2 = (f0 * (ior + 1) ** 2 - (ior - 1) ** 2) / (1 - f0)
    # rounding leaves 1e-16 of a dielectric's k²
    return ior, math.sqrt(extinction2) if extinction2 > 1e-12 else 0.0


def _dielectric_ior(f0: float) -> float:
    root = math.sqrt(f0)
    return (1 + root) / (1 - root)


def _numbers(preset: Preset) -> list[float]:
    diffuse, highlight = preset.terms
    params = highlight["params"]
    return [*diffuse["color"], *highlight["color"], dielectric_fraction(params["ior"], params["extinction"])]


@cache
def navigation_map(table: MapTable) -> NavigationMap:
    """Return the map of a table of the library's Cook–Torrance materials."""
    prefix = _PRESET_TABLES[table] + "/"
    map_presets = tuple(preset for preset in presets() if preset.id.startswith(prefix))
    params = [preset.terms[1]["params"] for preset in map_presets]
    f0 = np.array([reflectance(p["ior"], p["extinction"]) for p in params])
    sigma = np.array([p["sigma"] for p in params])
    corners = np.column_stack([f0, np.log(sigma)])
    # scaled to equal axes: Delaunay maximizes the smallest angle
    triangles = Delaunay(corners / np.ptp(corners, axis=0)).simplices.astype(np.int64)
    a, b, c = (corners[triangles[:, k]] for k in range(3))
    orientation = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    triangles[orientation < 0] = triangles[orientation < 0][:, [0, 2, 1]]
    numbers = np.array([_numbers(preset) for preset in map_presets])
    return NavigationMap(map_presets, f0, sigma, triangles, numbers, corners)
