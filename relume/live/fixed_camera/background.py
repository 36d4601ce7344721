"""Background compositing, behind the surfaces of a view and on shadow catchers.

A shadow catcher shows, per sample, the background times the ratio of incident light with and without the objects. If
no light would arrive, nothing is occluded. The incident light is the image of a white diffuse term, so the update
strategies apply to it; the rest is a factor on that image.
"""

from __future__ import annotations

from collections.abc import Hashable
from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.color import luminance, srgb_encode
from relume.live.fixed_camera.coverage import Coverage
from relume.live.fixed_camera.illumination import Illumination, LightSource, direct_environment
from relume.live.fixed_camera.material_image import MaterialImage
from relume.live.fixed_camera.mirror_samples import lit_surfaces
from relume.live.fixed_camera.protocols import LightQuality
from relume.live.fixed_camera.view_images import ViewImages
from relume.look import BAKED_ENVIRONMENT, EnvironmentKey, LightGeometry, Look
from relume.look.model import BackgroundLook, Rgb
from relume.operators.shade import shade

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_MAP = BackgroundLook(kind="map", color=(0, 0, 0), blur=0)
MAX_CATCHER_RATIO = 8.0  # times the background; the ratio is unbounded if nearly all light is indirect
_MIN_GAIN = 1e-12  # a background color is divided by the gain, which multiplies the finished image


class _BackgroundState(NamedTuple):
    """Everything that the background depends on.

    Attributes:
        factor: multiplies the map or the color, before the gain of the finished image.
        mirror_emitters: lights that emit in front of the background in mirrors.
    """

    background: BackgroundLook
    environment: EnvironmentKey
    factor: tuple[float, ...]
    is_direct: bool
    mirror_emitters: tuple[LightSource, ...]


class Background:
    """The background of one image; it is recomputed only if its state changes, since most edits do not affect it."""

    def __init__(self, images: ViewImages) -> None:
        self._images, self._view = images, images.view
        self._state: _BackgroundState | None = None
        self._unoccluded_lights: dict[int, UnoccludedLight] = {}
        self._unoccluded_images: dict[int, tuple[Hashable, F32]] = {}
        self._coverage: dict[bool, Coverage] = {}
        self.is_transparent = False

    @staticmethod
    def clamped_gain(gain: Rgb, background: BackgroundLook) -> Shaped[F64, " 3"]:
        """Return the gain of the finished image; positive for a background color, which is visible without light."""
        return np.asarray(np.maximum(np.array(gain), _MIN_GAIN if background.kind == "color" else 0.0))

    def update(
        self, look: Look, light: Illumination, gain: Shaped[F64, " 3"], radiance: Shaped[F32, "3 samples"]
    ) -> bool:
        """Update the background samples and the factors of shadow catchers to a look.

        Args:
            light: the illumination of the image. gain: from `clamped_gain`.
            radiance: radiance of every view sample before the gain, float32. Background samples are written.
        Returns:
            True if background samples have changed.
        """
        background = look.background
        factor = tuple(1 / gain) if background.kind == "color" else light.environment_gain
        emitter_radiance = self._images.mirrors.mirror_emitters(light, self._images.transfer.local)
        state = _BackgroundState(background, light.environment, factor, light.paths.direct, lit_surfaces(light))
        for name, material in self._images.by_name.items():
            if material.num_samples and look.materials[name].shadow_catcher:
                self._update_catcher(material, state, light)
            else:
                material.set_factor(None, None, None, None)
        if state == self._state:
            return False
        self._state, self.is_transparent = state, background.kind == "transparent"
        first, mirrored = self._view.num_surface_samples, self._view.mirrored
        radiance[:, first:] = self._background_radiance(state, None).T if state.is_direct else 0
        if mirrored is not None and state.is_direct:  # mirrors reflect the light, not the background of the look
            selection = mirrored.restrict_to(slice(first, self._view.num_view_samples))
            samples, unblurred_state = (
                mirrored.sample[selection],
                state._replace(background=_MAP, factor=light.environment_gain),
            )
            radiance[:, samples] = self._background_radiance(unblurred_state, None)[samples - first].T
            if emitter_radiance is not None:
                radiance[:, samples] += emitter_radiance[:, selection]
        return True

    def alpha(self, *, for_display: bool) -> Shaped[F32, "height width"]:
        """Return the alpha of every pixel over a background that is composited later, float32.

        Args:
            for_display: the image will be composited with display values (sRGB), where a shadow that transmits half of
                the light keeps three quarters of the value; otherwise with linear values.
        """
        if for_display not in self._coverage:
            catcher_opacity = self._display_shadow_opacity if for_display else self._shadow_opacity
            self._coverage[for_display] = Coverage(self._view, catcher_opacity)
        return self._coverage[for_display].pixels(self._images.by_name.values())

    def _display_shadow_opacity(self, material: MaterialImage) -> F32:
        return np.asarray(1 - srgb_encode(1 - self._shadow_opacity(material)), np.float32)

    def _shadow_opacity(self, material: MaterialImage) -> F32:
        """Fraction of light that is occluded at the samples of a shadow catcher. (n,) float32"""
        is_direct = self._state is None or self._state.is_direct
        incident = material.terms[0].displayed.image.transpose(1, 0, 2).reshape(3, -1)[:, : material.num_samples]
        unoccluded = self._unoccluded_images[material.index][1].T
        ratio = np.divide(incident, unoccluded, out=np.full_like(unoccluded, is_direct), where=unoccluded > 0)
        return np.asarray(1 - luminance(np.clip(ratio, 0, 1).T), np.float32)

    def _update_catcher(self, material: MaterialImage, state: _BackgroundState, light: Illumination) -> None:
        index = material.index
        if index not in self._unoccluded_lights:
            self._unoccluded_lights[index] = UnoccludedLight(self._images, material)
        light_key, unoccluded = self._unoccluded_image(material, light)
        if material.factor_key != (state, light_key):
            background = self._background_radiance(state, index)
            is_lit = unoccluded > 0
            factor = np.divide(background, unoccluded, out=np.zeros_like(unoccluded), where=is_lit)
            has_unlit = state.is_direct and not is_lit.all()
            unlit = np.where(is_lit, np.float32(0), background).T if has_unlit else None
            max_radiance = np.ascontiguousarray(MAX_CATCHER_RATIO * background.T, np.float32)
            material.set_factor((state, light_key), np.ascontiguousarray(factor.T), max_radiance, unlit)

    def _unoccluded_image(self, material: MaterialImage, light: Illumination) -> tuple[Hashable, F32]:
        """Return the cache key of a light and the unoccluded image of a shadow catcher in it, (n, 3).

        It is as coarse as the displayed image, and remains unchanged while an image in another light is computed.
        """
        live, cached = material.terms[0], self._unoccluded_images.get(material.index)
        is_preview, is_light_changing = not live.displayed.is_converged, live.displayed.light not in (None, light)
        key = light.environment, light.environment_gain, light.local, is_preview
        if cached is None or (cached[0] != key and not is_light_changing):
            cached = key, self._unoccluded_lights[material.index].image(light, is_preview=is_preview)
            self._unoccluded_images[material.index] = cached
        return cached

    def _background_radiance(self, state: _BackgroundState, material: int | None) -> F32:
        """Radiance behind the samples of a material (None: of the background), divided by the gain. (n, 3) float32"""
        background, factor = state.background, np.array(state.factor)
        first, stop = self._view.num_surface_samples, self._view.num_view_samples
        rows = slice(first, stop) if material is None else self._view.rows(material)
        if background.kind in ("color", "transparent"):
            color = background.color if background.kind == "color" else (0.0, 0.0, 0.0)
            return np.tile((np.array(color) * factor).astype(np.float32), (rows.stop - rows.start, 1))
        blur = background.blur if background.kind == "blurred" else 0.0
        images = self._images
        sample_key = (self._view.name, None) if material is None else self._view.sample_key(material)
        key = images.transfer.key, "background", *sample_key, state.environment, blur
        radiance = images.cache.transient.get_value(key, lambda: self._map(state.environment, material, blur))
        return np.asarray(radiance * factor, np.float32)

    def _map(self, environment: EnvironmentKey, material: int | None, blur: float) -> F32:
        transfer, view = self._images.transfer, self._view
        if material is not None:
            return transfer.environment_along(environment, self._unoccluded_lights[material].directions, blur)
        if not blur:
            return transfer.background_in(environment, view)
        return transfer.environment_along(environment, view.background_directions(), blur)


class UnoccludedLight:
    """Unoccluded light on a material whose samples have few distinct normals, such as a level ground.

    Attributes:
        directions: unit directions in which the camera sees its samples. (n, 3)
    """

    def __init__(self, images: ViewImages, material: MaterialImage) -> None:
        self._images, self._transfer, self._material = images, images.transfer, material
        self._points = images.view.surface_points(material.index)
        self.directions = images.view.directions_to(material.index)
        _, first, normal_index = np.unique(self._points.normal, axis=0, return_index=True, return_inverse=True)
        self._distinct_normals = self._points.rows(first)
        self._normal_index = normal_index.ravel()

    def image(self, light: Illumination, *, is_preview: bool) -> Shaped[F32, "n 3"]:
        """Return the image of the material's first term, which is diffuse, under unoccluded light, float32.

        Emissive surfaces are left out with all other geometry.

        Args:
            is_preview: use a small map if the environment is not the baked one.
        """
        is_coarse = is_preview and light.environment != BAKED_ENVIRONMENT
        image = self._from_triangles(light, is_preview=is_coarse)[self._normal_index]
        for geometry, gain in light.local:
            if not geometry.material_emissions:
                image += np.outer(self._unoccluded(geometry), np.array(gain, np.float32) / np.float32(np.pi))
        return np.asarray(image, np.float32)

    def _unoccluded(self, geometry: LightGeometry) -> F32:
        transfer, view = self._transfer, self._images.view
        key = transfer.key, "unoccluded light", view.name, self._material.index, geometry
        return self._images.cache.transient.get_value(key, lambda: transfer.local.unoccluded(geometry, self._points))

    def _from_triangles(self, light: Illumination, *, is_preview: bool) -> F32:
        """Light from the environment for each distinct normal. (normals, 3) float32"""
        term = self._material.terms[0]
        quality = LightQuality.PREVIEW if is_preview else LightQuality.EXACT
        samples = self._transfer.unoccluded_samples(self._distinct_normals)
        incident = self._transfer.incident_light(samples, direct_environment(light), quality)
        return shade(term.term, term.target_bands, *incident, lambda share: None, lambda: False).rows(
            self._distinct_normals.num_points
        )
