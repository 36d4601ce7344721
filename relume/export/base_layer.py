"""Base color, metalness and specular of a surface from its albedo L and its reflectances F(x) = f0 and f90.

    dielectric  L = b (1 − R),  f0 = s min(c f, 1),  f90 = s
    metal       L = 0,          f0 = b,              f90 = 1
    blend       L = b (1 − m) (1 − R),  f0 = mix(0.04, b, m),  f90 = 1

with base color b, metalness m, specular s and its color c, reflectance f of the index of refraction, and the mean
reflectance R of the dielectric: the inverse of `relume.scene_io.surfaces.make_material`. Glass transmits a fraction t
of the light of its diffuse layer: L = b (1 − t) (1 − R), and its tint is b t.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.brdf.fresnel import normal_reflectance
from relume.export.export_images import ExportImages, color_image, resized, rgb
from relume.images.base_color import DIELECTRIC, diffuse_fraction, solve_base_color
from relume.scene.model import Glass, Texture
from relume.scene.texture_encoding import ROWS_PER_BATCH, decode, encode_rows, mean_value
from relume.scene_io.surfaces.blend import lerp
from relume.scene_io.surfaces.surface_images import ImageInput
from relume.scene_io.surfaces.surface_parameters import SurfaceParameters
from relume.scene_io.surfaces.to_terms import PbrSurface, dielectric_reflectance

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_BLACK = 1e-4
_PLAIN_F0 = 0.2  # about that of gems; higher ones are partly metal if they can
_MAX_F0 = 0.36  # of an index of refraction of 4
_TOLERANCE = 0.01  # of a blend
_WHITE_TOLERANCE = 0.02
_GRAY_TOLERANCE = 1e-4
_MIN_COLOR = 0.01  # difference of the channels of an albedo that tells its color
_BLACK_DIELECTRIC_F0 = 0.08  # of an index of refraction of 1.8


@dataclass(frozen=True)
class Maps:
    """Textures that multiply the diffuse layer and the highlight; None for uniform ones."""

    diffuse: Texture | None = None
    specular: Texture | None = None

    def means(self) -> tuple[F64, F64]:
        """Mean of each map, ones without it."""
        diffuse, specular = (np.ones(3) if t is None else mean_value(t) for t in (self.diffuse, self.specular))
        return diffuse, specular


def base_layer(surface: PbrSurface, maps: Maps, glass: Glass | None, images: ExportImages, name: str) -> dict[str, Any]:
    """Return the parameters of the base layer, of `SurfaceParameters`.

    Args:
        surface: at the mean of its maps; `specular_reflectance` is 0. maps: its textures.
        glass: None for an opaque surface. images: gets the base color and other images. name: of the material.
    """
    uniform = _uniform_layer(surface, glass)
    if maps.diffuse is None and maps.specular is None:
        return uniform
    diffuse_mean, specular_mean = maps.means()
    albedo, f0 = surface.diffuse / np.maximum(diffuse_mean, 1e-6), surface.f0 / np.maximum(specular_mean, 1e-6)
    builder = _TexturedLayer(uniform, albedo, f0, surface.f90, maps, images, name)
    if maps.specular is None or surface.f0.max() < _BLACK:
        return builder.plain(maps.diffuse, np.array(uniform["base_color"]) / np.maximum(diffuse_mean, 1e-6))
    if uniform["metallic"] == 1:
        return builder.plain(maps.specular, f0)
    return builder.blended()


def pbr_surface(parameters: SurfaceParameters) -> PbrSurface:
    """Return the surface that parameters without images mean."""
    metallic, specular = float(parameters.metallic), float(parameters.specular)  # type: ignore[arg-type]
    base, color = np.array(parameters.base_color), np.array(parameters.specular_color)
    dielectric = np.minimum(normal_reflectance(parameters.ior) * color, 1)
    reflectance = dielectric_reflectance(float(dielectric.max()) * specular, specular)
    albedo = base * (1 - metallic) * (1 - float(parameters.transmission))  # type: ignore[arg-type]
    f0, f90 = lerp(specular * dielectric, base, metallic), lerp(specular, 1, metallic)
    return PbrSurface(albedo, f0, f90, float(parameters.roughness), reflectance)  # type: ignore[arg-type]


def _uniform_layer(surface: PbrSurface, glass: Glass | None) -> dict[str, Any]:
    albedo, f0, f90 = surface.diffuse, surface.f0, min(surface.f90, 1.0)
    is_white_at_grazing = f90 > 1 - _WHITE_TOLERANCE
    if glass is None and albedo.max() < _BLACK and is_white_at_grazing and not _is_black_dielectric(f0):
        return {"base_color": rgb(f0), "metallic": 1.0}
    if glass is None and (blend := _colored_blend(albedo, f0, f90)) is not None:
        return blend
    if glass is None and is_white_at_grazing and (f0 / f90).max() > _PLAIN_F0:
        base, metallic = _solve_blend(albedo, f0)
        if _blend_error(albedo, f0, base, metallic) < _TOLERANCE:
            return {"base_color": rgb(base), "metallic": float(metallic[0])}
    return _dielectric_layer(albedo, f0, f90, glass)


def _is_black_dielectric(f0: F64) -> bool:
    """True for the gray reflectance of plastics and glass; no metal is as dark."""
    return bool(np.ptp(f0) < _GRAY_TOLERANCE and f0.max() < _BLACK_DIELECTRIC_F0)


def _colored_blend(albedo: F64, f0: F64, f90: float) -> dict[str, Any] | None:
    """The blend of a metal and a dielectric with white specular color, if the albedo has a color and it is one.

    With f90 = m + (1 - m) s, f0 = A + B L over the channels, A = (1 - m) s f and B = m / ((1 - m)(1 - R)), where
    R = s (f + (1 - f) r) with the constant r of `dielectric_reflectance`; so m is linear in A and B.
    """
    deviation = albedo - albedo.mean()
    if np.ptp(albedo) < _MIN_COLOR or f90 <= 0:
        return None
    slope = float(deviation @ f0 / (deviation @ deviation))
    offset = float(f0.mean() - slope * albedo.mean())
    rise = dielectric_reflectance(0.0, 1.0)
    metallic = slope * (1 - offset - (f90 - offset) * rise) / (1 + slope * (1 - rise))
    metallic = 0.0 if abs(metallic) < _GRAY_TOLERANCE else metallic
    weight = f90 - metallic  # (1 - m) s
    is_blend = np.abs(offset + slope * albedo - f0).max() < _GRAY_TOLERANCE and 0 <= metallic < min(1, f90)
    if not is_blend or not 0 <= offset <= _MAX_F0 * weight:
        return None
    base = albedo / (1 - metallic - dielectric_reflectance(offset, weight))
    ior = index_of_refraction(offset / weight)
    layer = {"base_color": rgb(np.minimum(base, 1)), "metallic": metallic}
    return layer | {"specular": weight / (1 - metallic), "ior": ior} if base.max() < 1 + _GRAY_TOLERANCE else None


def _dielectric_layer(albedo: F64, f0: F64, f90: float, glass: Glass | None) -> dict[str, Any]:
    relative = f0 / f90 if f90 > 0 else np.zeros(3)
    f = min(float(relative.max()), _MAX_F0) if glass is None else normal_reflectance(glass.ior)
    color = relative / f if f > 0 else np.ones(3)
    reflectance = dielectric_reflectance(min(float(relative.max()), 1.0) * f90, f90)
    base = albedo / max(1 - reflectance, _BLACK)  # of a mirror that is white at all angles
    layer = {
        "specular": f90,
        "specular_color": rgb(color),
        "ior": index_of_refraction(f) if glass is None else glass.ior,
    }
    if glass is None:
        return layer | {"base_color": rgb(np.minimum(base, 1)), "metallic": 0.0}
    total = base + glass.tint
    transmission = float(np.sum(glass.tint) / max(total.sum(), 1e-30)) if any(glass.tint) else 0.0
    return layer | {"base_color": rgb(np.minimum(total, 1)), "metallic": 0.0, "transmission": transmission}


class _TexturedLayer:
    """Base layer with images. uniform: at the mean of the maps. albedo, f0: factors of the maps."""

    def __init__(
        self, uniform: dict[str, Any], albedo: F64, f0: F64, f90: float, maps: Maps, images: ExportImages, name: str
    ) -> None:
        self._uniform, self._albedo, self._f0, self._f90 = uniform, albedo, f0, min(f90, 1.0)
        self._maps, self._images, self._name = maps, images, name
        textures = [texture for texture in (maps.diffuse, maps.specular) if texture is not None]
        height, width = (max(texture.pixels.shape[axis] for texture in textures) for axis in (0, 1))
        self._size = height, width
        self._wrap = textures[0].wrap

    def plain(self, texture: Texture | None, factor: F64) -> dict[str, Any]:
        """The uniform layer with a texture times a factor as base color."""
        if texture is None:
            return self._uniform
        return self._uniform | {"base_color": color_image(self._images, f"{self._name} base color", texture, factor)}

    def blended(self) -> dict[str, Any]:
        """A blend of dielectric and metal per texel if it has these reflectances; else their colors per texel."""
        if self._is_blend():
            base = self._color_image("base color", lambda rows: self._blend(rows)[0])
            return {"base_color": base, "metallic": self._metallic_image()}
        highest = np.max([self._values(rows)[1].max(axis=(0, 1)) for rows in self._batches()], axis=0)
        highest = np.maximum(highest, 1e-6)
        tint = self._color_image("specular color", lambda rows: self._values(rows)[1] / highest)
        specular_color = replace(tint, factor=rgb(highest / max(self._f90 * DIELECTRIC, 1e-6)))
        base = self._color_image("base color", self._dielectric_base)
        dielectric = {"metallic": 0.0, "specular": self._f90, "ior": 1.5}
        return self._uniform | dielectric | {"base_color": base, "specular_color": specular_color}

    def _is_blend(self) -> bool:
        if self._f90 < 1 - _WHITE_TOLERANCE or "transmission" in self._uniform:
            return False
        return all(_blend_error(*self._values(rows), *self._blend(rows)) < _TOLERANCE for rows in self._batches())

    def _blend(self, rows: slice) -> tuple[F64, F64]:
        return _solve_blend(*self._values(rows))

    def _dielectric_base(self, rows: slice) -> F32:
        albedo, f0 = self._values(rows)
        reflectance = dielectric_reflectance(np.minimum(f0.max(axis=-1, keepdims=True), 1), np.float32(self._f90))
        return np.asarray(np.clip(albedo / (1 - reflectance), 0, 1), np.float32)

    def _batches(self) -> Iterator[slice]:
        return (slice(start, start + ROWS_PER_BATCH) for start in range(0, self._size[0], ROWS_PER_BATCH))

    def _values(self, rows: slice) -> tuple[F32, F32]:
        """Albedo and f0 of texels."""
        pairs = (self._albedo, self._maps.diffuse), (self._f0, self._maps.specular)
        albedo, f0 = (
            np.broadcast_to(np.float32(factor), (1, 1, 3)) if texture is None else self._decoded(texture, rows) * factor
            for factor, texture in pairs
        )
        return albedo.astype(np.float32), f0.astype(np.float32)

    def _decoded(self, texture: Texture, rows: slice) -> F32:
        return decode(resized(texture.pixels, self._size)[rows], texture.encoding)

    def _color_image(self, label: str, values: Callable[[slice], F64 | F32]) -> ImageInput:
        def make_pixels() -> NDArray[np.uint8]:
            return encode_rows(
                lambda rows: np.asarray(values(rows), np.float32), self._size, np.ones(3), self._wrap
            ).pixels

        file = self._images.add(f"{self._name} {label}", (label, *self._key()), make_pixels)
        return ImageInput(file, is_srgb=True, wrap=self._wrap)

    def _metallic_image(self) -> ImageInput:
        def make_pixels() -> NDArray[np.uint8]:
            rows = [np.rint(255 * self._blend(rows)[1]).astype(np.uint8) for rows in self._batches()]
            return np.concatenate(rows)

        file = self._images.add(f"{self._name} metalness", ("metalness", *self._key()), make_pixels)
        return ImageInput(file, channel="r", wrap=self._wrap)

    def _key(self) -> tuple[Any, ...]:
        return id(self._maps.diffuse), id(self._maps.specular), tuple(self._albedo), tuple(self._f0), self._f90


def _solve_blend(albedo: NDArray[Any], f0: NDArray[Any]) -> tuple[F64, F64]:
    """Base color and metalness of reflectances. (..., 3) -> (..., 3), (..., 1)"""
    diffuse = albedo / diffuse_fraction(np.full(3, DIELECTRIC))
    base = solve_base_color(diffuse, f0)
    total = np.maximum(base.sum(axis=-1, keepdims=True), 1e-6)
    return base, np.clip(1 - diffuse.sum(axis=-1, keepdims=True) / total, 0, 1)


def _blend_error(albedo: NDArray[Any], f0: NDArray[Any], base: F64, metallic: F64) -> float:
    """Largest difference of the reflectances of a blend."""
    diffuse = base * (1 - metallic) * diffuse_fraction(np.full(3, DIELECTRIC))
    return float(max(np.abs(diffuse - albedo).max(), np.abs(lerp(DIELECTRIC, base, metallic) - f0).max()))


def index_of_refraction(reflectance: float) -> float:
    """Index of refraction of a reflectance at normal incidence."""
    root = sqrt(reflectance)
    return round((1 + root) / (1 - root), 6)
