"""View samples through a lens: circles of confusion, coverage by brute force, merging, origins."""

from dataclasses import replace

import numpy as np
import pytest
from tiny_scenes import make_camera, make_tiny_scene, quad, studio

from relume.camera.lens_rays import RAYS_PER_PIXEL
from relume.camera.view_samples import BACKGROUND, sample_view, view_sample_limit
from relume.raytrace.scene_buffers import build_scene_buffers
from relume.scene.lens import Lens
from relume.scene.model import Material

SIZE, YFOV = (64, 48), 0.4
PAPER = Material("Paper", ({"model": "lambert", "color": [0.7, 0.7, 0.7]},))
PIXELS_PER_SLOPE = SIZE[1] / (2 * np.tan(YFOV / 2))


def square(name, center, half, material=0):
    """A square that faces the camera."""
    x, y, z = center
    corners = [[x - half, y - half, z], [x + half, y - half, z], [x + half, y + half, z], [x - half, y + half, z]]
    return quad(name, corners, material)


def lens_scene(*meshes, lens, materials=(PAPER,)):
    """Meshes before a camera at the origin that looks along -Z."""
    camera = replace(make_camera("front", (0, 0, 0), (0, 0, -1), YFOV), lens=lens)
    return make_tiny_scene(*meshes, camera=camera, environment=studio(), materials=list(materials))


def samples_of(scene):
    return sample_view(scene, build_scene_buffers(scene), "front", SIZE)


def coverage(samples, material=0):
    """Fraction of each pixel that shows a material. (height, width)"""
    weight = samples.weight * (samples.material == material)
    return np.bincount(samples.pixel, weight, SIZE[0] * SIZE[1]).reshape(SIZE[::-1])


def brute_force(lens, squares, num):
    """Coverage of each square, (center, half) from front to back, by random rays that meet planes in closed form."""
    rng, (width, height) = np.random.default_rng(1), SIZE
    out = np.zeros((len(squares), height, width))
    for y in range(height):
        shape = width, num
        at = np.stack([np.arange(width)[:, None] + rng.random(shape), y + rng.random(shape)], axis=-1)
        slope = (at - np.array(SIZE) / 2) * (1, -1) / PIXELS_PER_SLOPE
        radius, angle = lens.radius * np.sqrt(rng.random(shape)), 2 * np.pi * rng.random(shape)
        start = radius[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        toward, is_free = slope * lens.focus_distance - start, np.ones(shape, np.bool_)
        for k, (center, half) in enumerate(squares):
            point = start + toward * (-center[2] / lens.focus_distance)
            is_hit = is_free & (np.abs(point - center[:2]) < half).all(axis=-1)
            out[k, y], is_free = is_hit.mean(axis=1), is_free & ~is_hit
    return out


def test_a_small_square_out_of_focus_is_a_disk_of_the_circle_of_confusion():
    lens, depth, half = Lens(0.05, 2.0), 4.0, 0.02
    image = coverage(samples_of(lens_scene(square("dot", (0, 0, -depth), half), lens=lens)))
    area = (2 * half / depth * PIXELS_PER_SLOPE) ** 2  # of its sharp image, pixels
    assert image.sum() == pytest.approx(area, rel=0.05)  # light is spread, not lost
    y, x = np.mgrid[: SIZE[1], : SIZE[0]] + 0.5
    distance = np.hypot(x - SIZE[0] / 2, y - SIZE[1] / 2)
    radius = 0.5 * 2 * 0.05 * abs(1 / depth - 1 / 2) * PIXELS_PER_SLOPE  # 1.48 pixels
    second_moment = (image * distance**2).sum() / image.sum()
    of_square = (2 * half / depth * PIXELS_PER_SLOPE) ** 2 / 6
    of_pixels = 1 / 6
    assert second_moment == pytest.approx(radius**2 / 2 + of_square + of_pixels, rel=0.08)
    assert image[distance > radius + 1.2].max() == 0


def test_foreground_and_background_blur_like_random_rays():
    lens = Lens(0.1, 2.0)
    squares = [((0.08, 0.0, -1.2), 0.06), ((-0.1, 0.05, -2.0), 0.15), ((0.3, -0.2, -6.0), 0.7)]
    materials = [replace(PAPER, name=f"Paper {k}") for k in range(3)]
    meshes = [square(f"square {k}", *at, material=k) for k, at in enumerate(squares)]
    samples = samples_of(lens_scene(*meshes, lens=lens, materials=materials))
    expected = brute_force(lens, squares, 1000)
    for k in range(3):
        error = coverage(samples, k) - expected[k]
        assert np.sqrt(np.mean(error**2)) < 0.03
        assert abs(error.mean()) < 2e-3
    counts = np.bincount(samples.pixel, minlength=SIZE[0] * SIZE[1])
    assert counts.max() <= RAYS_PER_PIXEL[0]
    np.testing.assert_allclose(np.bincount(samples.pixel, samples.weight), 1, rtol=1e-5)


def test_the_plane_in_focus_is_as_sharp_as_without_a_lens():
    mesh = square("card", (0.013, -0.02, -2.0), 0.2)
    sharp, focused = (coverage(samples_of(lens_scene(mesh, lens=lens))) for lens in (None, Lens(0.05, 2.0)))
    assert (np.abs(focused - sharp) <= 0.26).all()  # eight positions of an edge pixel, and others
    inside = (sharp == 1) & (focused == 1)
    assert inside.sum() > 0.8 * (sharp > 0).sum()
    assert ((sharp > 0) == (focused > 0)).mean() > 0.99


def test_pixels_in_focus_have_one_sample_for_each_view_direction():
    mesh = square("card", (0, 0, -2.0), 2.0)
    narrow, wide = (samples_of(lens_scene(mesh, lens=Lens(radius, 2.0))) for radius in (0.02, 0.2))
    assert len(narrow.pixel) == SIZE[0] * SIZE[1]
    assert len(wide.pixel) > 4 * len(narrow.pixel)  # 11° across: a highlight differs


def test_samples_are_viewed_from_points_of_the_lens():
    lens = Lens(0.1, 3.0, blades=6)
    samples = samples_of(lens_scene(square("card", (0, 0, -2.0), 2.0), lens=lens))
    right, up, toward = samples.camera.T
    np.testing.assert_allclose(toward, 0, atol=1e-6)
    apothem = 0.1 * np.cos(np.pi / 6)
    for k in range(6):  # all sides of the hexagon, whose first corner is at the top
        angle = np.pi / 2 + np.pi / 6 + k * np.pi / 3
        assert (right * np.cos(angle) + up * np.sin(angle)).max() == pytest.approx(apothem, rel=0.02)
    assert right.mean() == pytest.approx(0, abs=1e-3)


def test_a_lens_without_width_is_a_pinhole():
    meshes = square("near", (0.05, 0, -1.0), 0.1), square("far", (-0.1, 0.03, -3.0), 0.3)
    pinhole, lens = (coverage(samples_of(lens_scene(*meshes, lens=each))) for each in (None, Lens(1e-9, 2.0)))
    assert np.abs(pinhole - lens).max() <= 0.26  # other positions in edge pixels
    assert pinhole.sum() == pytest.approx(lens.sum(), rel=2e-3)


def test_reflections_are_blurred_by_the_length_of_their_path():
    mirror = Material("Mirror", ({"model": "ggx", "color": [1.0] * 3, "params": {"roughness": 0.02, "f0": 0.9}},))
    wall = square("wall", (0, 0, -2.0), 2.0, material=1)
    corners = [[-0.1, -0.1, 1], [-0.1, 0.1, 1], [0.1, 0.1, 1], [0.1, -0.1, 1]]
    dot = quad("dot", corners, 0)  # behind the camera, five meters away by way of the mirror
    samples = samples_of(lens_scene(wall, dot, lens=Lens(0.1, 2.0), materials=(PAPER, mirror)))
    image = coverage(samples)
    assert image.sum() == pytest.approx((0.2 / 5 * PIXELS_PER_SLOPE) ** 2, rel=0.06)
    y, x = np.mgrid[: SIZE[1], : SIZE[0]] + 0.5
    squared = (x - SIZE[0] / 2) ** 2 + (y - SIZE[1] / 2) ** 2
    radius = 0.1 * abs(1 / 5 - 1 / 2) * PIXELS_PER_SLOPE
    expected = radius**2 / 2 + (0.2 / 5 * PIXELS_PER_SLOPE) ** 2 / 6 + 1 / 6
    assert (image * squared).sum() / image.sum() == pytest.approx(expected, rel=0.08)


def test_background_is_a_sample_of_the_environment_for_each_ray_out_of_focus():
    samples = samples_of(lens_scene(square("card", (0, 0, -2.0), 0.2), lens=Lens(0.1, 2.0)))
    background = samples.material == BACKGROUND
    assert background.any()
    assert samples.weight[background].max() <= 1 / 8


def test_the_limit_of_samples_holds_for_an_aperture_of_a_meter(monkeypatch):
    monkeypatch.setattr("relume.camera.view_samples._LENS_RATIO", 0.2)
    scene = lens_scene(square("card", (0, 0, -9.0), 3.0), lens=Lens(1.0, 0.5))
    samples = samples_of(scene)
    assert len(samples.pixel) <= view_sample_limit(scene.materials, SIZE[0] * SIZE[1], has_lens=True)
    np.testing.assert_allclose(np.bincount(samples.pixel, samples.weight), 1, rtol=1e-5)
