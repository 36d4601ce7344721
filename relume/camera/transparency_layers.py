"""Transparency layers of camera rays: their hits behind glass and in mirrors.

A pixel has samples in layers: first hits, hits behind glass, and hits after a mirror. The transmittance of glass is
baked. The look decides how much a mirror reflects (`relume.brdf.specular`), so a bake stores the specular chain of each
sample.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.camera.ray_paths import RayPaths, SpecularChain
from relume.camera.refraction import MAX_GLASS_HITS, MAX_VISIBLE_GLASS, glass_surfaces, has_glass, refract
from relume.camera.specular_hits import MAX_MIRROR_BOUNCES, is_mirror_material, reflect_rays
from relume.raytrace.camera_rays import Hits, trace_rays
from relume.raytrace.scene_buffers import SceneBuffers
from relume.scene.model import Material

F32 = NDArray[np.float32]


# arrays of a layer with one row per ray
_ARRAYS = ("ray", "directions", "transmittance", "is_visible", "origins", "is_mirrored", "key", "frost")


class TransparencyLayer(NamedTuple):
    """Hits of camera rays that passed the same number of surfaces.

    Attributes:
        ray: index of the camera ray, ascending.
        hits: hits of the rays; distances are along the whole path.
        directions: directions of the last path segment, unit.
        transmittance: transmittance between the camera and the hit, without the reflectance of mirrors.
        is_visible: the surface itself is shown; false if the path only continues there.
        origins: origins of the last path segment: the camera, or the last surface that changed the direction.
        chain: mirrors on the path; None without mirrors.
        is_mirrored: the surface is a mirror, and another layer has its reflection.
        key: mesh index of the hit, −1 for the background; offset to distinguish paths over different mirrors, facets.
        frost: 1 + index of the material of the first frosted glass before the hit; 0 for none.
    """

    ray: Shaped[NDArray[np.int64], " n"]
    hits: Hits
    directions: Shaped[F32, "n 3"]
    transmittance: Shaped[F32, "n 3"]
    is_visible: Shaped[NDArray[np.bool_], " n"]
    origins: Shaped[F32, "n 3"]
    chain: SpecularChain | None
    is_mirrored: Shaped[NDArray[np.bool_], " n"]
    key: Shaped[NDArray[np.int64], " n"]
    frost: Shaped[NDArray[np.uint16], " n"]

    def rows(self, rows: NDArray[np.integer] | NDArray[np.bool_]) -> TransparencyLayer:
        """Select rays."""
        chain = None if self.chain is None else self.chain.rows(rows)
        selection = self._replace(hits=self.hits.rows(rows), chain=chain)
        return selection._replace(**{name: getattr(self, name)[rows] for name in _ARRAYS})

    @staticmethod
    def concatenate(layers: Sequence[TransparencyLayer], max_mirrors: int) -> TransparencyLayer:
        """Concatenate layers. max_mirrors: maximum number of mirrors on any path"""
        chains = [SpecularChain.padded(layer.chain, len(layer.ray), max_mirrors) for layer in layers]
        return TransparencyLayer(
            hits=Hits.concatenate([layer.hits for layer in layers]),
            chain=SpecularChain(*map(np.concatenate, zip(*chains, strict=True))),
            **{name: np.concatenate([getattr(layer, name) for layer in layers]) for name in _ARRAYS},
        )

    @property
    def visible(self) -> TransparencyLayer:
        """Select rays whose hit is shown."""
        return self.rows(self.is_visible)


def has_layers(materials: Sequence[Material]) -> bool:
    """True if camera rays continue at any material."""
    return has_glass(materials) or bool(is_mirror_material(materials).any())


def max_layers(materials: Sequence[Material]) -> int:
    """Maximum number of layers; reflections in mirrors may be behind glass."""
    glass, mirrors = has_glass(materials), bool(is_mirror_material(materials).any())
    return (
        2 * MAX_GLASS_HITS
        if glass and mirrors
        else MAX_GLASS_HITS
        if glass
        else 1 + MAX_MIRROR_BOUNCES
        if mirrors
        else 1
    )


def max_samples(materials: Sequence[Material]) -> int:
    """Maximum number of layers of a ray whose hits are shown."""
    has_glass_and_mirrors = has_glass(materials) and bool(is_mirror_material(materials).any())
    return 1 + MAX_VISIBLE_GLASS if has_glass(materials) and not has_glass_and_mirrors else max_layers(materials)


def trace_layers(
    geometry: SceneBuffers,
    materials: Sequence[Material],
    camera_position: F32,
    directions: Shaped[F32, "n 3"],
    alpha_sample: F32 | np.float32,
    pixel_angle: float = 0.0,
    *,
    traces_mirrors: bool = True,
    facets: Shaped[NDArray[np.float64], "n surfaces 2"] | None = None,
    start: Shaped[F32, " n"] | None = None,
) -> list[TransparencyLayer]:
    """Trace camera rays through glass and off mirrors.

    Args:
        geometry: the triangles. materials: materials of the scene.
        camera_position: origin of all rays (3,), or of each (n, 3). directions: unit. alpha_sample: see `trace_rays`.
        pixel_angle: angle of a pixel, radians, to filter textures on mirrors.
        traces_mirrors: add layers of reflections in mirrors.
        facets: two numbers in [0, 1) for each ray and successive glass surface, which choose the facets of frosted
            glass; None: glass is clear.
        start: where the camera rays begin, see `trace_rays`.
    Returns:
        First a layer of all rays; then the layers of continued rays.
    """
    num, glass, mirrors = len(directions), glass_surfaces(materials), is_mirror_material(materials)
    mirrors &= traces_mirrors
    num_keys, layer_limit = int(geometry.face_mesh.max(initial=0)) + 2, max_layers(materials)
    alpha_samples, layers = np.broadcast_to(alpha_sample, num), list[TransparencyLayer]()
    queue = deque([RayPaths.from_camera(camera_position, directions)])

    def fits() -> bool:
        return len(layers) + 1 + len(queue) < layer_limit  # plus one for the path in progress

    while queue:
        paths = queue.popleft()
        hits = trace_rays(geometry.embree, paths.origins, paths.directions, alpha_samples[paths.ray], start)
        start = None  # only camera rays begin at the near plane
        is_hit = hits.face >= 0
        face = np.maximum(hits.face, 0)
        material = geometry.face_material[face]
        is_visible, is_mirrored = np.ones(len(paths.ray), np.bool_), np.zeros(len(paths.ray), np.bool_)
        glass_rows = np.flatnonzero(is_hit & glass.is_glass[material])
        if len(glass_rows):
            num_surfaces = 0 if facets is None else facets.shape[1]
            chosen = None if facets is None else facets[paths.ray[glass_rows], paths.num_glass % num_surfaces]
            is_outer, refracted = refract(geometry, glass, paths, hits, glass_rows, chosen)
            is_visible[glass_rows] = is_outer & (paths.num_glass < MAX_VISIBLE_GLASS)
            if paths.num_glass + 1 < MAX_GLASS_HITS and fits():
                queue.append(refracted)
        mirror_rows = np.flatnonzero(is_hit & mirrors[material] & is_visible)
        if len(mirror_rows) and paths.num_mirrors < MAX_MIRROR_BOUNCES and fits():
            queue.append(reflect_rays(geometry, materials, paths, hits, mirror_rows, pixel_angle, num_keys))
            is_mirrored[mirror_rows] = True
        hits_from_camera = hits._replace(distance=hits.distance + paths.length)
        key = np.where(is_hit, geometry.face_mesh[face], -1) + paths.path_key * num_keys
        origins = np.broadcast_to(paths.origins, (len(paths.ray), 3))
        layers.append(
            TransparencyLayer(
                paths.ray,
                hits_from_camera,
                paths.directions,
                paths.transmittance,
                is_visible,
                origins,
                paths.chain,
                is_mirrored,
                key,
                paths.frost,
            )
        )
    return layers
