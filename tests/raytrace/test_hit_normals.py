"""Normals at hits by the kernel, against the interpolation of `surface_at`."""

import numpy as np

from relume.raytrace.camera_rays import Hits, camera_directions, trace_rays
from relume.raytrace.hit_normals import normals_at
from relume.raytrace.scene_buffers import build_scene_buffers
from relume.raytrace.surface_interaction import surface_at
from relume.scene.examples.catalog import built_in


def test_normals_equal_those_of_the_surface():
    """Teapot and pearls from within the scene: smooth normals, back faces, edges of triangles, and misses."""
    scene = built_in("still_life")
    geometry, camera, size = build_scene_buffers(scene), scene.cameras[0], (48, 36)
    y, x = np.divmod(np.arange(size[0] * size[1]), size[0])
    directions = camera_directions(camera, size, (x + 0.5).astype(np.float32), (y + 0.5).astype(np.float32))
    first_hits = trace_rays(geometry.embree, camera.to_world[:3, 3].astype(np.float32), directions)
    rng = np.random.default_rng(1)
    uv, face = first_hits.uv.copy(), np.where(rng.random(len(x)) < 0.1, np.int32(-1), first_hits.face)
    uv[::3, 0] = 0  # on an edge
    from_behind = rng.random(len(uv)) < 0.5
    towards = np.where(from_behind[:, None], -directions, directions)
    hits = Hits(face, uv, first_hits.distance)
    expected = surface_at(geometry, hits, towards).points.normal
    normals = normals_at(geometry, hits, towards)
    np.testing.assert_allclose(normals, expected, atol=2e-6)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-6)
