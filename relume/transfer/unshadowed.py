"""What would arrive at the samples of a material if nothing else were there: nothing hidden, nothing reflected."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relume.light.triangles import TriangleLights
from relume.look import BAKED_ENVIRONMENT, LightGeometry
from relume.transfer.light import Light
from relume.transfer.material_image import MaterialImage
from relume.transfer.receivers import Receivers
from relume.transfer.shade import shade
from relume.transfer.stored import read_traced_directions
from relume.transfer.view_images import ViewImages

F32 = NDArray[np.float32]


class Unshadowed:
    """Of a material whose samples face few ways, as those of a level ground do.

    Attributes:
        directions: unit, in which the camera sees its samples. (n, 3)
    """

    def __init__(self, images: ViewImages, material: MaterialImage) -> None:
        self._transfer, self._material = images.transfer, material
        self._points = images.view.points(material.index)
        self.directions = images.view.directions_to(material.index)
        self._normals, of_normal = np.unique(self._points.normal, axis=0, return_inverse=True)
        self._of_normal = of_normal.ravel()
        above = self._normals @ read_traced_directions(images.transfer.store).T > 0
        self._seen = np.packbits(above, axis=1, bitorder="little")
        self._arriving: dict[LightGeometry, F32] = {}

    def image(self, light: Light, *, roughly: bool) -> F32:
        """The image of the material's first term, which is diffuse, under a light whose way is free.

        Surfaces that shine are among what is not there.

        Args:
            roughly: from a small map where another environment than the baked one must be weighed.
        Returns:
            (n, 3) float32
        """
        straight = light._replace(paths=light.paths._replace(direct=True).without_reflections())
        is_weighed = roughly and light.environment != BAKED_ENVIRONMENT
        find = self._transfer.rough_lights_of if is_weighed else self._transfer.lights_of
        image = self._from_triangles(find(straight))[self._of_normal]
        shining = [(geometry, gain) for geometry, gain in light.local if geometry.kind != "mesh"]
        known = self._arriving
        self._arriving = {
            geometry: known[geometry] if geometry in known else self._transfer.local.unhidden(geometry, self._points)
            for geometry, _ in shining
        }
        for geometry, gain in shining:
            image += np.outer(self._arriving[geometry], np.array(gain, np.float32) / np.float32(np.pi))
        return np.asarray(image, np.float32)

    def _from_triangles(self, lights: TriangleLights) -> F32:
        """Of the environment, for each of the normals. (normals, 3) float32"""
        if lights.num_lights == 0:
            return np.zeros((len(self._normals), 3), np.float32)
        term = self._material.terms[0]
        points = Receivers(self._normals, _across(self._normals), self._normals, self._seen)
        shaded = shade(term.term, term.target, lights, points, lambda share: None, lambda: False)
        return shaded.rows(len(self._normals))


def _across(normals: F32) -> F32:
    """Some unit vector across each. (n, 3) float32"""
    axes = np.where(np.abs(normals[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 0.0, 1.0]])
    across = np.cross(axes, normals)
    return np.asarray(across / np.linalg.norm(across, axis=1, keepdims=True), np.float32)
