"""What the eye sees behind the surfaces of a view, and on a ground that only catches shadows.

A catcher shows, sample by sample, what lies behind it times what arrives there over what would arrive if nothing but
the ground were there; where nothing would, nothing is hidden. What arrives is the image of a white diffuse term, so
that all that keeps images near their look holds for it too; the rest is a factor on it.
"""

from __future__ import annotations

from collections.abc import Hashable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.core.color import luminance, srgb_encode
from relume.live.fixed_camera.background.coverage import Coverage
from relume.live.fixed_camera.background.unoccluded_light import UnoccludedLight
from relume.live.fixed_camera.illumination import Illumination, LightSource
from relume.live.fixed_camera.material_image import MaterialImage
from relume.live.fixed_camera.mirror_samples import lit_rectangles
from relume.live.fixed_camera.view_images import ViewImages
from relume.look import EnvironmentKey, Look
from relume.look.model import BackgroundLook, Rgb

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_MAP = BackgroundLook(kind="map", color=(0, 0, 0), blur=0)
MAX_CATCHER_RATIO = 8.0  # times what is behind: where next to nothing but reflected light arrives there is no measure
_MIN_GAIN = 1e-12  # what is not the environment's is divided by its gain, which multiplies the finished picture


class _BackgroundState(NamedTuple):
    """All that what is behind depends on.

    Attributes:
        factor: multiplies the map, or the colour, for the gain of the finished picture is yet to.
        mirror_emitters: that shine before it in mirrors.
    """

    background: BackgroundLook
    environment: EnvironmentKey
    factor: tuple[float, ...]
    is_direct: bool
    mirror_emitters: tuple[LightSource, ...]


class Background:
    """Of one picture; what it was last is kept, for most edits leave it as it is."""

    def __init__(self, images: ViewImages) -> None:
        self._images, self._view = images, images.view
        self._state: _BackgroundState | None = None
        self._unoccluded_lights: dict[int, UnoccludedLight] = {}
        self._unoccluded_images: dict[int, tuple[Hashable, F32]] = {}
        self._coverage: dict[bool, Coverage] = {}
        self.is_transparent = False

    @staticmethod
    def clamped_gain(gain: Rgb, background: BackgroundLook) -> F64:
        """What multiplies the finished picture: never nothing before a colour, which is seen where no light is."""
        return np.asarray(np.maximum(np.array(gain), _MIN_GAIN if background.kind == "color" else 0.0))

    def update(self, look: Look, light: Illumination, gain: F64, radiance: F32) -> bool:
        """Bring the samples of the background and the factors of catchers to a look.

        Args:
            light: that the picture shows. gain: from `clamped_gain`.
            radiance: of every view sample, before the gain. (3, samples) float32, written
        Returns:
            Whether samples of the background are new.
        """
        background = look.background
        factor = tuple(1 / gain) if background.kind == "color" else light.environment_gain
        emitter_radiance = self._images.mirrors.mirror_emitters(light)
        state = _BackgroundState(background, light.environment, factor, light.paths.direct, lit_rectangles(light))
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
        if mirrored is not None and state.is_direct:  # mirrors show the light, whatever is put behind
            selection = mirrored.restrict_to(slice(first, self._view.num_view_samples))
            samples, unblurred_state = (
                mirrored.sample[selection],
                state._replace(background=_MAP, factor=light.environment_gain),
            )
            radiance[:, samples] = self._background_radiance(unblurred_state, None)[samples - first].T
            if emitter_radiance is not None:
                radiance[:, samples] += emitter_radiance[:, selection]
        return True

    def alpha(self, *, for_display: bool) -> F32:
        """How much every pixel hides of what is put behind the picture. (height, width) float32

        Args:
            for_display: the picture will be laid over display values (sRGB), where a shadow that leaves half of the
                light leaves three quarters of the value; else over linear ones.
        """
        if for_display not in self._coverage:
            catcher_opacity = self._display_shadow_opacity if for_display else self._shadow_opacity
            self._coverage[for_display] = Coverage(self._view, catcher_opacity)
        return self._coverage[for_display].pixels(self._images.by_name.values())

    def _display_shadow_opacity(self, material: MaterialImage) -> F32:
        return np.asarray(1 - srgb_encode(1 - self._shadow_opacity(material)), np.float32)

    def _shadow_opacity(self, material: MaterialImage) -> F32:
        """The share of light that does not arrive at samples of a catcher. (n,) float32"""
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
        """What tells a light from others here, and the image in it if nothing stood on the catcher, (n, 3): as rough as
        what is displayed, which is left as it was where another light is being made."""
        live, cached = material.terms[0], self._unoccluded_images.get(material.index)
        is_preview, is_light_changing = not live.displayed.is_converged, live.displayed.light not in (None, light)
        key = light.environment, light.environment_gain, light.local, is_preview
        if cached is None or (cached[0] != key and not is_light_changing):
            cached = key, self._unoccluded_lights[material.index].image(light, is_preview=is_preview)
            self._unoccluded_images[material.index] = cached
        return cached

    def _background_radiance(self, state: _BackgroundState, material: int | None) -> F32:
        """Radiance behind samples of a material, of the background where None, over the gain. (n, 3) float32"""
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
