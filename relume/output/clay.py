"""Clay picture: the shape of a scene in neutral gray, by one light at the camera and ambient occlusion."""

from __future__ import annotations

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.color import srgb_encode
from relume.image_io.downsample import downsample
from relume.raytrace.alpha_filter import STOP_AT_PARTIAL
from relume.raytrace.camera_rays import camera_directions, near_distances, trace_rays
from relume.raytrace.interior import sphere_directions
from relume.raytrace.scene_buffers import SceneBuffers
from relume.scene.model import Camera

F32 = NDArray[np.float32]

BACKGROUND, ALBEDO = 0.02, 0.55  # linear
LIGHT, AMBIENT = 0.6, 0.4  # irradiance of a surface that faces the light and is unoccluded: 1
TO_LIGHT = np.array([-0.35, 0.45, 1.0]) / np.sqrt(1.325)
"""Direction of the light in the axes of the camera: behind it, above on the left."""
_SUPERSAMPLING, _PATTERNS = 2, 4  # samples per pixel and axis; sets of occlusion rays, of the pixels in a square
_RAYS_PER_SAMPLE, _RADIUS = 2, 0.15  # occlusion rays; their reach as a fraction of the distance from the camera
_BAND_SAMPLES = 1 << 18  # traced at once: bounds the memory


def clay_image(
    geometry: SceneBuffers, camera: Camera, size: tuple[int, int]
) -> Shaped[NDArray[np.uint8], "height width"]:
    """Render sRGB gray values of opaque surfaces of one reflectance.

    Args:
        geometry: the scene. camera: any. size: width and height in pixels.
    """
    width, height = (_SUPERSAMPLING * side for side in size)
    rows = max(1, _BAND_SAMPLES // width)
    bands = [
        _radiance(geometry, camera, (width, height), row, min(row + rows, height)) for row in range(0, height, rows)
    ]
    gray = downsample(np.concatenate(bands).reshape(height, width, 1), size)[..., 0]
    return np.asarray(np.rint(255 * srgb_encode(gray)), np.uint8)


def _radiance(geometry: SceneBuffers, camera: Camera, size: tuple[int, int], start: int, stop: int) -> F32:
    """Reflected radiance at the samples of the rows [start, stop)."""
    y, x = np.divmod(np.arange(start * size[0], stop * size[0], dtype=np.int64), size[0])
    directions = camera_directions(camera, size, (x + 0.5).astype(np.float32), (y + 0.5).astype(np.float32))
    position, near = camera.to_world[:3, 3].astype(np.float32), near_distances(camera, directions)
    hits = trace_rays(geometry.embree, position, directions, STOP_AT_PARTIAL, near)
    visible = np.flatnonzero(hits.face >= 0)
    face, distance, incoming = hits.face[visible], hits.distance[visible], directions[visible]
    normal = geometry.smooth_normals(face, hits.uv[visible])
    normal = np.copysign(1, -np.einsum("nc,nc->n", normal, incoming))[:, None] * normal  # of the visible side
    origin = position + distance[:, None] * incoming
    to_light = (camera.to_world[:3, :3] @ TO_LIGHT).astype(np.float32)
    irradiance = LIGHT * np.maximum(0, normal @ to_light)
    pattern = _pattern(x[visible], y[visible])
    irradiance += AMBIENT * (1 - _occlusion(geometry, origin, normal, pattern, _RADIUS * distance))
    gray = np.full(len(directions), BACKGROUND, np.float32)
    gray[visible] = ALBEDO * irradiance
    return gray


def _pattern(x: NDArray[np.int64], y: NDArray[np.int64]) -> NDArray[np.int64]:
    """Index of the occlusion rays of a sample: those of a pixel are evenly distributed over all."""
    (pixel_x, sample_x), (pixel_y, sample_y) = np.divmod(x, _SUPERSAMPLING), np.divmod(y, _SUPERSAMPLING)
    return np.asarray(pixel_x % 2 + 2 * (pixel_y % 2) + _PATTERNS * (sample_x + _SUPERSAMPLING * sample_y))


def _occlusion(
    geometry: SceneBuffers, origin: F32, normal: F32, pattern: NDArray[np.int64], radius: Shaped[F32, " n"]
) -> Shaped[F32, " n"]:
    """Ambient occlusion: mean of 1 − distance / radius over cosine-distributed rays that hit a surface within it."""
    num_patterns = _PATTERNS * _SUPERSAMPLING**2
    sphere = sphere_directions(_RAYS_PER_SAMPLE * num_patterns)
    # above the facets of smooth surfaces, and the rounding of the hits
    height = np.float32(1e-3) * radius + np.float32(2**-20) * np.abs(origin).max(axis=1)
    lifted = origin + height[:, None] * normal
    occlusion = np.zeros(len(origin), np.float32)
    for ray in range(_RAYS_PER_SAMPLE):
        # cosine-distributed: the normal plus a point on the unit sphere
        directions = normal + np.float32(0.999) * sphere[pattern + num_patterns * ray]
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        hits = trace_rays(geometry.embree, lifted, directions, STOP_AT_PARTIAL)
        occlusion += np.maximum(0, 1 - hits.distance / radius) / _RAYS_PER_SAMPLE
    return occlusion
