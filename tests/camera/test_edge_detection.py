"""Pixels with changing normals: thin chrome against many samples per pixel, and the number of samples.

A mirror shows the environment in the reflected direction; nothing else contributes.
"""

from __future__ import annotations

import numpy as np
import pytest
from tiny_scenes import make_camera, make_tiny_scene, mesh, studio, torus

from relume.assets.environments.equirect import lookup
from relume.camera.view_samples import BACKGROUND, sample_view
from relume.raytrace.camera_rays import Hits, camera_directions, trace_rays
from relume.raytrace.scene_buffers import build_scene_buffers
from relume.raytrace.surface_interaction import surface_at

SIZE = (96, 72)
FINE = 12


@pytest.fixture(scope="module", params=[0.02, 0.05])
def ring(request):
    camera = make_camera("c", [0, 0.6, 1.6], [0, 0, 0], 0.6)
    return make_tiny_scene(torus("ring", 0.5, request.param, 0), camera=camera, environment=studio(64))


def mirrored(scene, normal, towards):
    reflected = towards - 2 * np.sum(towards * normal, axis=1, keepdims=True) * normal
    return lookup(scene.environment.radiance, reflected.astype(np.float32))


def brute_force(scene):
    """Trace FINE² rays per pixel. Returns radiance (pixels, 3) and the ring's coverage of each pixel."""
    width, height = SIZE[0] * FINE, SIZE[1] * FINE
    camera, geometry = scene.cameras[0], build_scene_buffers(scene)
    y, x = np.divmod(np.arange(width * height), width)
    directions = camera_directions(
        camera, SIZE, ((x + 0.5) / FINE).astype(np.float32), ((y + 0.5) / FINE).astype(np.float32)
    )
    hits = trace_rays(geometry.embree, camera.to_world[:3, 3].astype(np.float32), directions)
    hit = hits.face >= 0
    radiance = lookup(scene.environment.radiance, directions)
    on = Hits(hits.face[hit], hits.uv[hit], hits.distance[hit])
    radiance[hit] = mirrored(scene, surface_at(geometry, on, directions[hit]).points.normal, directions[hit])
    shape = (SIZE[1], FINE, SIZE[0], FINE)
    means = radiance.reshape(*shape, 3).mean(axis=(1, 3)).reshape(-1, 3)
    return means, hit.reshape(shape).mean(axis=(1, 3)).ravel()


def shown(scene, samples):
    camera_position = scene.cameras[0].to_world[:3, 3]
    on = samples.material != BACKGROUND
    radiance = samples.surface.diffuse.astype(np.float64)
    towards = samples.surface.points.position[on] - camera_position
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    radiance[on] = mirrored(scene, samples.surface.points.normal[on], towards)
    weighted = radiance * samples.weight[:, None]
    return np.stack([np.bincount(samples.pixel, weighted[:, c], SIZE[0] * SIZE[1]) for c in range(3)], axis=1)


def test_a_thin_chrome_ring_equals_brute_force(ring):
    exact, coverage = brute_force(ring)
    image = shown(ring, sample_view(ring, build_scene_buffers(ring), "c", SIZE))
    is_ring = coverage > 0.1
    # displays clip at white
    error = np.abs(np.minimum(image, 1) - np.minimum(exact, 1))[is_ring]
    assert np.sqrt(np.mean(error**2)) < 0.08
    assert np.percentile(error, 99) < 0.45


def test_samples_of_a_pixel_have_different_normals_and_are_few(ring):
    samples = sample_view(ring, build_scene_buffers(ring), "c", SIZE)
    count = np.bincount(samples.pixel)
    assert 3 <= count.max() <= 8
    assert len(samples.pixel) < 2 * SIZE[0] * SIZE[1]
    np.testing.assert_allclose(np.bincount(samples.pixel, samples.weight), 1, atol=1e-6)


def test_the_number_of_samples_is_bounded_for_curved_surfaces():
    """On a thick ring 25 pixels wide, normals change by more than four degrees per pixel nearly everywhere."""
    fat = make_tiny_scene(torus("ring", 0.4, 0.39, 0, 64, 64), camera=make_camera("c", [0, 0, 16], [0, 0, 0], 0.1))
    samples = sample_view(fat, build_scene_buffers(fat), "c", (32, 24))
    count = np.bincount(samples.pixel, minlength=32 * 24)
    assert (count > 1).mean() > 0.1
    assert len(samples.pixel) < 2.5 * 32 * 24


def two_floors(step):
    """Two squares of one mesh that face the camera, the left one nearer by a fraction of the distance."""
    near = 2 * (1 - step)
    corners = [[-2, -2, 2 - near], [0, -2, 2 - near], [0, 2, 2 - near], [-2, 2, 2 - near]]
    corners += [[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]]
    faces = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]]
    return make_tiny_scene(
        mesh("floors", corners, faces, 0), camera=make_camera("c", [0.301, 0, 2], [0.301, 0, 0], 0.8)
    )


def test_a_step_between_parallel_faces_of_one_mesh_is_an_edge():
    samples = sample_view(two_floors(0.1), build_scene_buffers(two_floors(0.1)), "c", SIZE)
    several = np.bincount(samples.pixel) == 2
    assert several.sum() == SIZE[1]
    depth = samples.surface.points.position[:, 2]
    for pixel in np.nonzero(several)[0]:
        own = samples.pixel == pixel
        assert np.ptp(depth[own]) == pytest.approx(0.2, abs=1e-3)
        assert 0 < samples.weight[own].min() < 1


def test_a_floor_at_grazing_angles_has_no_edges():
    corners = [[-50, 0, 50], [50, 0, 50], [50, 0, -50], [-50, 0, -50]]
    floor = make_tiny_scene(
        mesh("floor", corners, [[0, 1, 2], [0, 2, 3]], 0), camera=make_camera("c", [0, 0.3, 20], [0, 0.3, 0], 0.4)
    )
    samples = sample_view(floor, build_scene_buffers(floor), "c", SIZE)
    several = np.nonzero(np.bincount(samples.pixel) > 1)[0]
    rows = np.unique(several // SIZE[0])
    assert len(rows) <= 4  # the end of the floor
