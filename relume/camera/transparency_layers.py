"""What an eye sees, layer by layer: its rays meet surfaces, go on behind glass, and are sent back by mirrors.

A pixel has samples in layers: what its rays meet first, what they meet behind glass, what they meet after a mirror.
What glass lets through is baked; what a mirror sends back its look decides (`relume.brdf.specular`), so a bake keeps by
which mirrors a ray came.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.camera.ray_paths import RayPaths, SpecularChain
from relume.camera.refraction import MAX_GLASS_HITS, MAX_VISIBLE_GLASS, glass_surfaces, has_glass, refract
from relume.camera.specular_hits import MAX_MIRROR_BOUNCES, is_mirror_material, reflect_rays
from relume.raytrace.camera_rays import Hits, trace_rays
from relume.raytrace.scene_buffers import SceneBuffers
from relume.scene.model import Material

F32 = NDArray[np.float32]


# of a layer, a row a ray
_ARRAYS = (
    "ray",
    "directions",
    "transmittance",
    "is_visible",
    "origins",
    "is_mirrored",
    "key",
)


class TransparencyLayer(NamedTuple):
    """What some of an eye's rays meet after as many surfaces.

    Attributes:
        ray: which of the rays they are, ascending. (m,) int64
        hits: what they meet; distances are along the whole way.
        directions: of the rays there, unit. (m, 3) float32
        transmittance: share of what is sent there that comes to the eye, but for what mirrors take of it. (m, 3)
            float32
        is_visible: whether there is something to be seen, and not just a way on. (m,)
        origins: where the rays come from: the eye itself, or the last surface that turned them. (m, 3) float32
        chain: the mirrors that sent them here; None where none did.
        is_mirrored: whether the surface is a mirror, and another layer has what is seen in it. (m,)
        key: number of the mesh there, −1 where nothing is met; larger ones after mirrors, others after others.
            (m,) int64
    """

    ray: NDArray[np.int64]
    hits: Hits
    directions: F32
    transmittance: F32
    is_visible: NDArray[np.bool_]
    origins: F32
    chain: SpecularChain | None
    is_mirrored: NDArray[np.bool_]
    key: NDArray[np.int64]

    def rows(self, rows: NDArray[np.integer] | NDArray[np.bool_]) -> TransparencyLayer:
        """Those of some rays."""
        chain = None if self.chain is None else self.chain.rows(rows)
        selection = self._replace(hits=self.hits.rows(rows), chain=chain)
        return selection._replace(**{name: getattr(self, name)[rows] for name in _ARRAYS})

    @staticmethod
    def concatenate(layers: Sequence[TransparencyLayer], max_mirrors: int) -> TransparencyLayer:
        """Those of several, one after another. most_mirrors: that any ray has met."""
        chains = [SpecularChain.padded(layer.chain, len(layer.ray), max_mirrors) for layer in layers]
        return TransparencyLayer(
            hits=Hits.concatenate([layer.hits for layer in layers]),
            chain=SpecularChain(*map(np.concatenate, zip(*chains, strict=True))),
            **{name: np.concatenate([getattr(layer, name) for layer in layers]) for name in _ARRAYS},
        )

    @property
    def visible(self) -> TransparencyLayer:
        """Where there is something to be seen."""
        return self.rows(self.is_visible)


def has_layers(materials: Sequence[Material]) -> bool:
    """Tell whether rays go on from any material."""
    return has_glass(materials) or bool(is_mirror_material(materials).any())


def max_layers(materials: Sequence[Material]) -> int:
    """The most layers that there are: what mirrors show is behind glass as well."""
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
    """The most layers of a ray in which there is something to be seen."""
    has_glass_and_mirrors = has_glass(materials) and bool(is_mirror_material(materials).any())
    return 1 + MAX_VISIBLE_GLASS if has_glass(materials) and not has_glass_and_mirrors else max_layers(materials)


def trace_layers(
    geometry: SceneBuffers,
    materials: Sequence[Material],
    camera_position: F32,
    directions: F32,
    alpha_sample: F32 | np.float32,
    pixel_angle: float = 0.0,
    *,
    traces_mirrors: bool = True,
) -> list[TransparencyLayer]:
    """Follow an eye's rays through glass, and off mirrors.

    Args:
        geometry: the triangles. materials: of the scene. camera_position: (3,) float32
        directions: unit. (n, 3) float32. alpha_sample: of `trace_rays`.
        pixel_angle: that a ray stands for, radians: what textures on mirrors are filtered by.
        traces_mirrors: whether there are layers of what is seen in mirrors.
    Returns:
        All rays first; then, layer by layer, those that went on.
    """
    num, glass, mirrors = len(directions), glass_surfaces(materials), is_mirror_material(materials)
    mirrors &= traces_mirrors
    num_keys, layer_limit = int(geometry.face_mesh.max(initial=0)) + 2, max_layers(materials)
    alpha_samples, layers = np.broadcast_to(alpha_sample, num), list[TransparencyLayer]()
    queue = deque([RayPaths.from_camera(camera_position, directions)])

    def fits() -> bool:
        return len(layers) + 1 + len(queue) < layer_limit  # the one that is being followed is in neither

    while queue:
        paths = queue.popleft()
        hits = trace_rays(geometry.embree, paths.origins, paths.directions, alpha_samples[paths.ray])
        is_hit = hits.face >= 0
        face = np.maximum(hits.face, 0)
        material = geometry.face_material[face]
        is_visible, is_mirrored = np.ones(len(paths.ray), np.bool_), np.zeros(len(paths.ray), np.bool_)
        glass_rows = np.flatnonzero(is_hit & glass.is_glass[material])
        if len(glass_rows):
            is_outer, refracted = refract(geometry, glass, paths, hits, glass_rows)
            is_visible[glass_rows] = is_outer & (paths.num_glass < MAX_VISIBLE_GLASS)
            if paths.num_glass + 1 < MAX_GLASS_HITS and fits():
                queue.append(refracted)
        mirror_rows = np.flatnonzero(is_hit & mirrors[material] & is_visible)
        if len(mirror_rows) and paths.num_mirrors < MAX_MIRROR_BOUNCES and fits():
            queue.append(reflect_rays(geometry, materials, paths, hits, mirror_rows, pixel_angle, num_keys))
            is_mirrored[mirror_rows] = True
        hits_from_camera = replace(hits, distance=hits.distance + paths.length)
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
            )
        )
    return layers
