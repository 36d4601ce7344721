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

from relume.color import luminance, srgb_encode
from relume.look import EnvironmentKey, Look
from relume.look.model import BackgroundLook, Rgb
from relume.picture.background.coverage import Coverage
from relume.picture.background.unshadowed import Unshadowed
from relume.picture.light import Light, Source
from relume.picture.material_image import MaterialImage
from relume.picture.mirrors import rectangles_of
from relume.picture.view_images import ViewImages

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_MAP = BackgroundLook(kind="map", color=(0, 0, 0), blur=0)
MOST_SHARE = 8.0  # times what is behind: where next to nothing but reflected light arrives there is no measure
_LEAST_GAIN = 1e-12  # what is not the environment's is divided by its gain, which multiplies the finished picture


class _Shown(NamedTuple):
    """All that what is behind depends on.

    Attributes:
        factor: multiplies the map, or the colour, for the gain of the finished picture is yet to.
        lamps: that shine before it in mirrors.
    """

    background: BackgroundLook
    environment: EnvironmentKey
    factor: tuple[float, ...]
    is_direct: bool
    lamps: tuple[Source, ...]


class Backdrop:
    """Of one picture; what it was last is kept, for most edits leave it as it is."""

    def __init__(self, images: ViewImages) -> None:
        self._images, self._view = images, images.view
        self._shown: _Shown | None = None
        self._unshadowed: dict[int, Unshadowed] = {}
        self._open: dict[int, tuple[Hashable, F32]] = {}
        self._coverage: dict[bool, Coverage] = {}
        self.is_transparent = False

    @staticmethod
    def gain_of(gain: Rgb, background: BackgroundLook) -> F64:
        """What multiplies the finished picture: never nothing before a colour, which is seen where no light is."""
        return np.asarray(np.maximum(np.array(gain), _LEAST_GAIN if background.kind == "color" else 0.0))

    def follow(self, look: Look, light: Light, gain: F64, radiance: F32) -> bool:
        """Bring the samples of the background and the factors of catchers to a look.

        Args:
            light: that the picture shows. gain: from `gain_of`.
            radiance: of every view sample, before the gain. (3, samples) float32, written
        Returns:
            Whether samples of the background are new.
        """
        background = look.background
        factor = tuple(1 / gain) if background.kind == "color" else light.environment_gain
        lamps = self._images.mirrors.lamps(light)
        shown = _Shown(background, light.environment, factor, light.paths.direct, rectangles_of(light))
        for name, material in self._images.by_name.items():
            if material.num_samples and look.materials[name].catcher:
                self._catch(material, shown, light)
            else:
                material.set_factor(None, None, None, None)
        if shown == self._shown:
            return False
        self._shown, self.is_transparent = shown, background.kind == "transparent"
        first, mirrored = self._view.num_surface_samples, self._view.mirrored
        radiance[:, first:] = self._behind(shown, None).T if shown.is_direct else 0
        if mirrored is not None and shown.is_direct:  # mirrors show the light, whatever is put behind
            among = mirrored.within(slice(first, self._view.num_view_samples))
            seen, light_itself = mirrored.sample[among], shown._replace(background=_MAP, factor=light.environment_gain)
            radiance[:, seen] = self._behind(light_itself, None)[seen - first].T
            if lamps is not None:
                radiance[:, seen] += lamps[:, among]
        return True

    def alpha(self, *, for_display: bool) -> F32:
        """How much every pixel hides of what is put behind the picture. (height, width) float32

        Args:
            for_display: the picture will be laid over display values (sRGB), where a shadow that leaves half of the
                light leaves three quarters of the value; else over linear ones.
        """
        if for_display not in self._coverage:
            hidden = self._hidden_from_display if for_display else self._hidden
            self._coverage[for_display] = Coverage(self._view, hidden)
        return self._coverage[for_display].pixels(self._images.by_name.values())

    def _hidden_from_display(self, material: MaterialImage) -> F32:
        return np.asarray(1 - srgb_encode(1 - self._hidden(material)), np.float32)

    def _hidden(self, material: MaterialImage) -> F32:
        """The share of light that does not arrive at samples of a catcher. (n,) float32"""
        is_direct = self._shown is None or self._shown.is_direct
        arriving = material.terms[0].displayed.image.transpose(1, 0, 2).reshape(3, -1)[:, : material.num_samples]
        unhidden = self._open[material.index][1].T
        share = np.divide(arriving, unhidden, out=np.full_like(unhidden, is_direct), where=unhidden > 0)
        return np.asarray(1 - luminance(np.clip(share, 0, 1).T), np.float32)

    def _catch(self, material: MaterialImage, shown: _Shown, light: Light) -> None:
        index = material.index
        if index not in self._unshadowed:
            self._unshadowed[index] = Unshadowed(self._images, material)
        of_light, unhidden = self._unhidden(material, light)
        if material.factor_key != (shown, of_light):
            behind = self._behind(shown, index)
            is_lit = unhidden > 0
            factor = np.divide(behind, unhidden, out=np.zeros_like(unhidden), where=is_lit)
            shows_unlit = shown.is_direct and not is_lit.all()
            unlit = np.where(is_lit, np.float32(0), behind).T if shows_unlit else None
            most = np.ascontiguousarray(MOST_SHARE * behind.T, np.float32)
            material.set_factor((shown, of_light), np.ascontiguousarray(factor.T), most, unlit)

    def _unhidden(self, material: MaterialImage, light: Light) -> tuple[Hashable, F32]:
        """What tells a light from others here, and the image in it if nothing stood on the catcher, (n, 3): as rough as
        what is displayed, which is left as it was where another light is being made."""
        live, known = material.terms[0], self._open.get(material.index)
        is_rough, is_kept = not live.displayed.is_firm, live.displayed.light not in (None, light)
        key = light.environment, light.environment_gain, light.local, is_rough
        if known is None or (known[0] != key and not is_kept):
            known = key, self._unshadowed[material.index].image(light, is_preview=is_rough)
            self._open[material.index] = known
        return known

    def _behind(self, shown: _Shown, material: int | None) -> F32:
        """Radiance behind samples of a material, of the background where None, over the gain. (n, 3) float32"""
        background, factor = shown.background, np.array(shown.factor)
        first, stop = self._view.num_surface_samples, self._view.num_view_samples
        rows = slice(first, stop) if material is None else self._view.rows(material)
        if background.kind in ("color", "transparent"):
            color = background.color if background.kind == "color" else (0.0, 0.0, 0.0)
            return np.tile((np.array(color) * factor).astype(np.float32), (rows.stop - rows.start, 1))
        blur = background.blur if background.kind == "blurred" else 0.0
        images = self._images
        place = (self._view.name, None) if material is None else self._view.place(material)
        key = images.transfer.key, "behind surfaces", *place, shown.environment, blur
        seen = images.cache.passing.keep(key, lambda: self._map(shown.environment, material, blur))
        return np.asarray(seen * factor, np.float32)

    def _map(self, environment: EnvironmentKey, material: int | None, blur: float) -> F32:
        transfer, view = self._images.transfer, self._view
        if material is not None:
            return transfer.seen_in(environment, self._unshadowed[material].directions, blur)
        if not blur:
            return transfer.background_in(environment, view)
        return transfer.seen_in(environment, view.background_directions(), blur)
