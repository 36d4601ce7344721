"""Local lights that were moved: what they give straight to a picture, evaluated anew each frame.

Shadows are traced for the place where a light is now, for the whole view at once, and kept for no longer than it is
there. Terms that scatter evenly need no more of a light than what arrives; others list its rays.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from relume.look import LightGeometry
from relume.parallel import for_shares
from relume.trace.local_shadows import arriving
from relume.trace.rough_light import RoughLight
from relume.transfer.compose import add_even
from relume.transfer.contraction import contract
from relume.transfer.light import Light, Source, straight_from
from relume.transfer.local import Points
from relume.transfer.material_image import MaterialImage
from relume.transfer.ray_projector import RayProjector
from relume.transfer.receivers import LocalRays, Receivers
from relume.transfer.shade import Shaded, shaded_bytes
from relume.transfer.term_image import TermImage
from relume.transfer.view_images import ViewImages

F32 = NDArray[np.float32]
Found = TypeVar("Found", Points, Receivers)


@dataclass(frozen=True)
class _Read:
    """Points of a view, or a material's samples as receivers, read once."""

    found: Points | Receivers
    num_bytes: int


class MovedLights:
    """Of the terms of one view."""

    def __init__(self, images: ViewImages) -> None:
        self._images = images
        self._now: dict[LightGeometry, RoughLight] = {}

    def add_change(self, material: MaterialImage, image: TermImage, before: Light, after: Light, out: F32) -> None:
        """Add what comes straight to a term's samples from lights that were not there before, and take off what came
        from those that are not there any more.

        Args:
            out: shaped like the term's image.
        """
        if not after.paths.direct:
            return
        gone = tuple(source for source in before.local if source not in after.local)
        come = [source for source in after.local if source not in before.local]
        if gone:
            out -= self._before(material, image, straight_from(before, gone))
        if come:
            self._add_now(material, image, come, out)

    def _before(self, material: MaterialImage, image: TermImage, light: Light) -> F32:
        """What comes straight from lights that stood still, as exact as in the picture that was shaded; the same in
        every frame, and so kept. Where a hand took its time it was made before (`Mixer.held_need`)."""
        images = self._images
        key = images.key_of_image(material, image, light)

        def shaded() -> Shaded:
            rays, factor = images.local_rays(material.index, light), _even_factor(image)
            if factor is None:
                return self._shaded(material, image, rays)
            found, normal = np.zeros_like(image.image), self._points().normal[images.view.rows(material.index)]
            for of_light in rays:
                seen = of_light.position, normal, of_light.numbers, of_light.visible
                add_even(arriving(of_light.light, of_light.pattern, *seen), factor * of_light.gain, found)
            return Shaded(found)

        return images.cache.get(key, Shaded, shaded_bytes(material.num_samples), shaded).image

    def _add_now(self, material: MaterialImage, image: TermImage, come: list[Source], out: F32) -> None:
        factor, rows = _even_factor(image), self._images.view.rows(material.index)
        lights = [(source, self._roughly(source.geometry)) for source in come]
        if factor is not None:
            for source, light in lights:
                add_even(light.arriving[rows], factor * source.gain, out)
            return
        whole, local = self._points(), self._images.transfer.local
        points = Points(whole.position[rows], whole.normal[rows], whole.numbers[rows])
        rays = [local.rough_rays(source, points, light.visible[rows]) for source, light in lights]
        out += self._shaded(material, image, rays).image

    def _roughly(self, geometry: LightGeometry) -> RoughLight:
        if geometry not in self._now:
            present = {source.geometry for source in self._images.light.local}
            self._now = {known: light for known, light in self._now.items() if known in present}
            self._now[geometry] = self._images.transfer.local.roughly(geometry, self._points())
        return self._now[geometry]

    def _shaded(self, material: MaterialImage, image: TermImage, rays: list[LocalRays]) -> Shaded:
        """What rays bring a term, in the threads of frames."""
        points, contraction = replace(self._receivers(material), rays=rays), contract(image.term, image.target, None)
        rows = np.zeros((material.num_samples, 3, 1), np.float32)

        def add(start: int, stop: int) -> None:
            RayProjector(image.term, contraction, points, stop - start).add(start, stop, rows[start:stop])

        for_shares(add, len(rows))
        return Shaded.of(rows[:, :, 0])

    def _receivers(self, material: MaterialImage) -> Receivers:
        view, index = self._images.view, material.index

        def read() -> Receivers:
            return view.receivers(index, is_lit=False)

        return self._kept(("receivers", index), read, material.num_samples * 36)

    def _points(self) -> Points:
        """Those of the view; of samples that are seen from behind the normals are nothing, and no light arrives."""
        view = self._images.view

        def read() -> Points:
            points = view.all_points()
            return replace(points, normal=points.normal * (view.cos_theta_o > 0)[:, None].astype(np.float32))

        return self._kept(("points",), read, view.num_surface_samples * 28)

    def _kept(self, name: tuple[Hashable, ...], read: Callable[[], Found], num_bytes: int) -> Found:
        key = (self._images.transfer.key, self._images.view.name, *name)
        found: Any = self._images.cache.get(key, _Read, num_bytes, lambda: _Read(read(), num_bytes)).found
        return found  # type: ignore[no-any-return]


def _even_factor(image: TermImage) -> NDArray[np.float64] | None:
    """What a term makes of all light that arrives; None where it asks where that comes from. (3,)"""
    contraction = contract(image.term, image.target, None)
    if not image.term.is_even or contraction.kinds.size:
        return None
    upright = image.term.quotients(*np.array([0, 0, 1, 0, 0, 1], np.float32))
    return np.asarray(contraction.constant * upright, np.float64)
