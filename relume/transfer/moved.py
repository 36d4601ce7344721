"""Local lights that were moved: what they give straight to a picture, evaluated anew each frame.

Shadows are traced for the place where a light is now and kept nowhere: it will be elsewhere in the next frame. A light
that has an extent is seen through few samples meanwhile.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from relume.parallel import for_shares
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

ROUGH_SAMPLES = 4  # of a light that has an extent


@dataclass(frozen=True)
class _Lit:
    """A material's samples, read once."""

    points: Points
    receivers: Receivers

    @property
    def num_bytes(self) -> int:
        """Memory it holds."""
        return int(5 * self.points.position.nbytes + self.points.numbers.nbytes)


class MovedLights:
    """Of the terms of one view."""

    def __init__(self, images: ViewImages) -> None:
        self._images = images
        self._rays: dict[int, tuple[Light, list[LocalRays]]] = {}  # of each material, for all its terms

    def change(self, material: MaterialImage, image: TermImage, before: Light, after: Light) -> F32 | None:
        """What comes straight to a term's samples from lights that were not there before, less what came from those
        that are not there any more; None where there are no such lights. (tiles, 3, samples)"""
        come = tuple(source for source in after.local if source not in before.local)
        gone = tuple(source for source in before.local if source not in after.local)
        if not (after.paths.direct and (come or gone)):
            return None
        change = self._now(material, image, _alone(after, come)) if come else np.zeros_like(image.image)
        return change - self._before(material, image, _alone(before, gone)) if gone else change

    def _now(self, material: MaterialImage, image: TermImage, light: Light) -> F32:
        known, rays = self._rays.get(material.index, (None, []))
        if known != light:
            local = self._images.transfer.local
            rays = local.all_rays(light, self._lit(material).points, num_samples=ROUGH_SAMPLES)
            self._rays[material.index] = light, rays
        return self._shaded(material, image, rays).image

    def _before(self, material: MaterialImage, image: TermImage, light: Light) -> F32:
        """As exact as in the picture that was shaded; the same in every frame, and so kept."""
        images = self._images
        key = (*images.key_of_image(material, image, light), "straight")

        def shaded() -> Shaded:
            return self._shaded(material, image, images.local_rays(material.index, light))

        return images.cache.get(key, Shaded, shaded_bytes(material.num_samples), shaded).image

    def _shaded(self, material: MaterialImage, image: TermImage, rays: list[LocalRays]) -> Shaded:
        """What rays bring a term, in the threads of frames."""
        points = replace(self._lit(material).receivers, rays=rays)
        contraction = contract(image.term, image.target, None)
        rows = np.zeros((material.num_samples, 3, 1), np.float32)

        def add(start: int, stop: int) -> None:
            RayProjector(image.term, contraction, points, stop - start).add(start, stop, rows[start:stop])

        for_shares(add, len(rows))
        return Shaded.of(rows[:, :, 0])

    def _lit(self, material: MaterialImage) -> _Lit:
        view, index = self._images.view, material.index
        key = (self._images.transfer.key, view.name, index, "lit")
        num_bytes = material.num_samples * 64

        def read() -> _Lit:
            return _Lit(view.points(index), view.receivers(index, is_lit=False))

        return self._images.cache.get(key, _Lit, num_bytes, read)


def _alone(light: Light, local: tuple[Source, ...]) -> Light:
    """Some local lights, as they come straight."""
    dark = light._replace(environment_gain=(0.0, 0.0, 0.0), reflectances=(), local=local)
    return dark._replace(paths=light.paths.without_reflections())
