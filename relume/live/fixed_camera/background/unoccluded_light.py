"""Incident light at the samples of a material without other geometry: no occlusion, no indirect light."""

from __future__ import annotations

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.live.fixed_camera.illumination import Illumination, direct_environment
from relume.live.fixed_camera.material_image import MaterialImage
from relume.live.fixed_camera.protocols import LightQuality
from relume.live.fixed_camera.view_images import ViewImages
from relume.look import BAKED_ENVIRONMENT, LightGeometry
from relume.operators.shade import shade

F32 = NDArray[np.float32]


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
            if geometry.kind != "mesh":
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
