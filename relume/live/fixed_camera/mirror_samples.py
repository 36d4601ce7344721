"""Mirrors in an image: the weights of samples that are visible in them, and lights that only mirrors show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.specular_reflectance import specular_terms
from relume.camera.ray_paths import NO_MIRROR
from relume.lights.surface_hits import has_surface
from relume.live.fixed_camera.illumination import Illumination, LightSource
from relume.live.fixed_camera.protocols import LocalLightTransport
from relume.look import LightGeometry
from relume.views.mirror_samples import MirrorSamples
from relume.views.view import View

F32 = NDArray[np.float32]
Documents = Sequence[Mapping[str, Any]]


def lit_surfaces(light: Illumination) -> tuple[LightSource, ...]:
    """Return the lights with a surface, other than meshes, that emit direct light."""
    return tuple(source for source in light.local if has_surface(source.geometry) and light.paths.direct)


class MirrorFactors:
    """The mirrors of one image.

    Attributes:
        gains: factor on the radiance of each sample for its pixel, in the view's order; see `View.throughput`.
        materials: those with visible mirror reflections.
    """

    def __init__(self, view: View) -> None:
        self._mirror_samples, self._documents = view.mirrored, dict[int, Documents | None]()
        self.gains = view.throughput if view.mirrored is None else view.throughput.copy()
        chain = None if view.mirrored is None else view.mirrored.chain
        self._emitters: tuple[tuple[LightSource, ...], F32 | None] = (), None
        self._unit_radiance: dict[LightGeometry, F32] = {}
        self._specular_factors = None if chain is None else np.ones((*chain.material.shape, 3), np.float32)
        self.materials: list[int] = [] if chain is None else np.setdiff1d(chain.material, [NO_MIRROR]).tolist()

    def mirror_emitters(self, light: Illumination, local: LocalLightTransport) -> Shaped[F32, "3 m"] | None:
        """Return the radiance of lights between mirrors and the samples visible in them; None if there are none.

        The same array is returned while nothing changes. local: knows linked surfaces.
        """
        sources = lit_surfaces(light)
        if self._mirror_samples is not None and sources != self._emitters[0]:
            self._emitters = sources, self._emitter_radiance(self._mirror_samples, sources, local) if sources else None
        return self._emitters[1]

    def _emitter_radiance(
        self, mirror_samples: MirrorSamples, sources: Sequence[LightSource], local: LocalLightTransport
    ) -> Shaped[F32, "3 m"]:
        """Radiance of lights on the ray paths from mirrors to mirrored samples."""
        segments = mirror_samples.origin, mirror_samples.direction, mirror_samples.distance
        self._unit_radiance = {
            geometry: self._unit_radiance[geometry]
            if geometry in self._unit_radiance
            else local.surface_radiance_along(geometry, *segments)
            for geometry, _ in sources
        }
        radiance = np.zeros((3, len(mirror_samples.sample)), np.float32)
        for geometry, gain in sources:
            radiance += np.outer(np.array(gain, np.float32), self._unit_radiance[geometry])
        return radiance

    def update_emission(self, documents: Mapping[int, Documents | None]) -> list[int]:
        """Update mirrors to a look.

        Args:
            documents: terms of the mirror materials; None if their mirrors are not shown.
        Returns:
            The materials whose specular albedo has changed.
        """
        changed = [
            index for index in documents if index not in self._documents or documents[index] != self._documents[index]
        ]
        if self._mirror_samples is None or self._specular_factors is None or not changed:
            return []
        chain = self._mirror_samples.chain
        for index in changed:
            terms = self._documents[index] = documents[index]
            is_of_material = chain.material == index
            self._specular_factors[is_of_material] = (
                0
                if terms is None
                else specular_terms(terms, chain.cos_theta_i[is_of_material], chain.tint[is_of_material])
            )
        self.gains[self._mirror_samples.order_index] = self._mirror_samples.throughput * self._specular_factors.prod(
            axis=1
        )
        return changed
