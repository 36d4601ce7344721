"""Surfaces of the many lights of one source, as rays see them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.lights.local_lights import area_triangles
from relume.lights.surface_hits import surface_radiance
from relume.look import LightGeometry
from relume.raytrace.camera_rays import trace_rays
from relume.raytrace.embree import EmbreeScene
from relume.raytrace.scene_buffers import face_normals

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_MAX_HITS = 64  # of a ray
_STEP = np.float32(1 + 1e-5)  # from a hit to the start of the next ray


class SourceSurfaces(NamedTuple):
    """Triangles of the lights of a source, which emit on their front and occlude nothing.

    Attributes:
        embree: the triangles. normal: unit, of each. radiance: of each, over the emission of the source.
    """

    embree: EmbreeScene
    normal: Shaped[F32, "T 3"]
    radiance: Shaped[F32, " T"]

    @classmethod
    def build(cls, lights: Sequence[Mapping[str, Any]], center: Shaped[F64, " 3"], radius: float) -> SourceSurfaces:
        """Build the triangles of lights.

        Args:
            lights, center, radius: see `relume.lights.local_lights.source_triangles`.
        """
        corners, radiance = [], []
        for light in lights:
            geometry = LightGeometry(**{field: value for field, value in light.items() if field != "emission"})
            triangles, geometry = area_triangles(geometry, center, radius)
            corners.append(triangles.corners)
            radiance.append(np.full(len(triangles.corners), light["emission"][0] * surface_radiance(geometry)))
        positions = np.concatenate(corners).reshape(-1, 3)
        faces = np.arange(len(positions), dtype=np.uint32).reshape(-1, 3)
        embree = EmbreeScene.build(positions, faces)
        return cls(embree, face_normals(positions, faces), np.concatenate(radiance).astype(np.float32))

    def radiance_along(
        self, origins: Shaped[F32, "n 3"], directions: Shaped[F32, "n 3"], distances: Shaped[F32, " n"]
    ) -> Shaped[F32, " n"]:
        """Return the sum of the radiance of all lights along rays, over the emission of the source.

        Args:
            origins: meters. directions: unit. distances: at which the rays end, meters; infinite for no end.
        """
        total, start = np.zeros(len(origins), np.float32), np.zeros(len(origins), np.float32)
        rows = np.arange(len(origins))
        for _ in range(_MAX_HITS):
            hits = trace_rays(self.embree, origins[rows], directions[rows], start=start[rows])
            is_hit = (hits.face >= 0) & (hits.distance < distances[rows])
            rows, face = rows[is_hit], hits.face[is_hit]
            if not len(rows):
                break
            is_front = np.einsum("nc,nc->n", self.normal[face], directions[rows]) < 0
            total[rows] += np.where(is_front, self.radiance[face], np.float32(0))
            start[rows] = _STEP * hits.distance[is_hit]
        return total
