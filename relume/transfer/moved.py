"""Local lights that were moved: what they give straight to a picture, evaluated anew each frame.

Shadows are traced for the place where a light is now, for the whole view at once, and kept for no longer than it is
there. Terms that scatter evenly need no more of a light than what arrives; others list its rays.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from relume.look import LightGeometry
from relume.parallel import for_shares
from relume.trace.rough_light import RoughLight
from relume.transfer.compose import add_even
from relume.transfer.contraction import contract
from relume.transfer.light import Light, Source
from relume.transfer.local import Points
from relume.transfer.material_image import MaterialImage
from relume.transfer.ray_projector import RayProjector
from relume.transfer.receivers import LocalRays, Receivers
from relume.transfer.shade import Shaded, shaded_bytes
from relume.transfer.term_image import TermImage
from relume.transfer.view_images import ViewImages

F32 = NDArray[np.float32]


@dataclass(frozen=True)
class _Lit:
    """Samples of a view or of a material, read once. receivers: of those of a material."""

    points: Points
    receivers: Receivers | None = None

    @property
    def num_bytes(self) -> int:
        """Memory it holds."""
        frames = 0 if self.receivers is None else 3 * self.receivers.normal.nbytes
        return int(2 * self.points.position.nbytes + self.points.numbers.nbytes + frames)


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
            out -= self._before(material, image, _alone(before, gone))
        if come:
            self._add_now(material, image, come, out)

    def _before(self, material: MaterialImage, image: TermImage, light: Light) -> F32:
        """What comes straight from lights that stood still, as exact as in the picture that was shaded; the same in
        every frame, and so kept."""
        images = self._images
        key = (*images.key_of_image(material, image, light), "straight")

        def shaded() -> Shaded:
            return self._shaded(material, image, images.local_rays(material.index, light))

        return images.cache.get(key, Shaded, shaded_bytes(material.num_samples), shaded).image

    def _add_now(self, material: MaterialImage, image: TermImage, come: list[Source], out: F32) -> None:
        contraction, rows = contract(image.term, image.target, None), self._images.view.rows(material.index)
        lights = [(source, self._roughly(source.geometry)) for source in come]
        if image.term.is_even and contraction.kinds.size == 0:
            upright = image.term.quotients(*np.array([0, 0, 1, 0, 0, 1], np.float32))
            for source, light in lights:
                add_even(light.arriving[rows], contraction.constant * upright * source.gain, out)
            return
        rays = [
            self._images.transfer.local.rough_rays(source, self._lit(material).points, light.visible[rows])
            for source, light in lights
        ]
        out += self._shaded(material, image, rays).image

    def _roughly(self, geometry: LightGeometry) -> RoughLight:
        if geometry not in self._now:
            present = {source.geometry for source in self._images.light.local}
            self._now = {known: light for known, light in self._now.items() if known in present}
            self._now[geometry] = self._images.transfer.local.roughly(geometry, self._all_points())
        return self._now[geometry]

    def _shaded(self, material: MaterialImage, image: TermImage, rays: list[LocalRays]) -> Shaded:
        """What rays bring a term, in the threads of frames."""
        receivers = self._lit(material).receivers
        assert receivers is not None
        points, contraction = replace(receivers, rays=rays), contract(image.term, image.target, None)
        rows = np.zeros((material.num_samples, 3, 1), np.float32)

        def add(start: int, stop: int) -> None:
            RayProjector(image.term, contraction, points, stop - start).add(start, stop, rows[start:stop])

        for_shares(add, len(rows))
        return Shaded.of(rows[:, :, 0])

    def _lit(self, material: MaterialImage) -> _Lit:
        view, index = self._images.view, material.index
        key, num_bytes = (self._images.transfer.key, view.name, index, "lit"), material.num_samples * 64

        def read() -> _Lit:
            return _Lit(view.points(index), view.receivers(index, is_lit=False))

        return self._images.cache.get(key, _Lit, num_bytes, read)

    def _all_points(self) -> Points:
        """Those of the view; of samples that are seen from behind the normals are nothing, and no light arrives."""
        view = self._images.view

        def read() -> _Lit:
            points = view.all_points()
            return _Lit(replace(points, normal=points.normal * (view.cos_theta_o > 0)[:, None].astype(np.float32)))

        key, num_bytes = (self._images.transfer.key, view.name, "lit"), view.num_surface_samples * 28
        return self._images.cache.get(key, _Lit, num_bytes, read).points


def _alone(light: Light, local: tuple[Source, ...]) -> Light:
    """Some local lights, as they come straight."""
    dark = light._replace(environment_gain=(0.0, 0.0, 0.0), reflectances=(), local=local)
    return dark._replace(paths=light.paths.without_reflections())
