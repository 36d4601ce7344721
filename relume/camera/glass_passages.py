"""Glass in front of each pixel, counted along straight rays, to preview another color of it.

Refraction moves the passages of solids, but rarely changes their number.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.camera.refraction import MAX_GLASS_HITS
from relume.raytrace.alpha_filter import STOP_AT_OPAQUE
from relume.raytrace.barycentric import positions_on_faces
from relume.raytrace.camera_rays import camera_directions, near_distances, trace_rays
from relume.raytrace.scene_buffers import SceneBuffers
from relume.scene.model import Camera

F32 = NDArray[np.float32]


class GlassPassages(NamedTuple):
    """Glass along the rays through the centers of pixels.

    Attributes:
        num_surfaces: number of surfaces of glass that each ray passes, by material of the scene.
        length: of each ray inside solids, meters, by material of the scene.
    """

    num_surfaces: Mapping[int, Shaped[NDArray[np.uint8], " pixels"]]
    length: Mapping[int, Shaped[F32, " pixels"]]


def trace_passages(geometry: SceneBuffers, camera: Camera, size: tuple[int, int]) -> GlassPassages:
    """Count the glass in front of each pixel.

    Args:
        geometry: the triangles. camera: the camera. size: width and height in pixels.
    """
    alpha_test = geometry.embree.alpha_test
    assert alpha_test is not None  # callers have glass
    masks = alpha_test.alpha_masks
    glass = np.flatnonzero(masks.is_glass).tolist()
    num = size[0] * size[1]
    num_surfaces = {index: np.zeros(num, np.uint8) for index in glass}
    length = {index: np.zeros(num, np.float32) for index in glass}
    y, x = np.divmod(np.arange(num), size[0])
    directions = camera_directions(camera, size, (x + 0.5).astype(np.float32), (y + 0.5).astype(np.float32))
    origins, ray = np.tile(camera.to_world[:3, 3].astype(np.float32), (num, 1)), np.arange(num)
    if (start := near_distances(camera, directions)) is not None:
        origins += start[:, None] * directions
    for _ in range(MAX_GLASS_HITS):
        hits = trace_rays(geometry.embree, origins, directions[ray], np.repeat(STOP_AT_OPAQUE, len(ray)))
        material = np.where(hits.face >= 0, geometry.face_material[np.maximum(hits.face, 0)], -1)
        leaves = np.einsum("nc,nc->n", geometry.face_normals[np.maximum(hits.face, 0)], directions[ray]) > 0
        for index in glass:
            is_hit = material == index
            num_surfaces[index][ray[is_hit]] += 1
            if masks.rules[masks.material_rule[index], 5] > 1:  # a solid
                is_inside = is_hit & leaves
                length[index][ray[is_inside]] += hits.distance[is_inside]
        passes = np.isin(material, glass)
        if not passes.any():
            break
        ray = ray[passes]
        origins = positions_on_faces(geometry, hits.face[passes], hits.uv[passes], directions[ray])
    return GlassPassages(num_surfaces, length)
