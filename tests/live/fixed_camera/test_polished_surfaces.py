"""Polished surfaces under bad input: a right picture, never NaN, never black.

Most scenes are white furnaces: everything reflects or transmits all light, the environment is 1, and so is the picture.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from session_edits import make_look
from tiny_scenes import make_camera, make_tiny_scene, quad, sphere

from relume.core.cache import Cache
from relume.live.opened.openers import open_transfer
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.scene.model import Glass, Material, Texture
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

SIZE = (40, 30)
WHITE = np.ones((32, 64, 3), np.float32)


def metal(name, roughness=0.05, **term):
    params = {"roughness": roughness, "f0": 1.0}
    return Material(name, ({"model": "ggx", "color": [1, 1, 1], "params": params, "texture": None, **term},))


def bake(scene, folder, method="gather", size=SIZE):
    return bake_in_process(METHODS[method], scene, Recipe(method, ("front",), size, 300), folder / "s.zarr")


def shown(store, change=lambda document: None, cache_bytes=1 << 30):
    transfer = open_transfer(store, Cache(cache_bytes))
    return render_image(transfer, "front", make_look(transfer, change)).astype(float)


def camera(origin=(0, 0.4, 3), target=(0, 0.2, 0)):
    return make_camera("front", origin, target, 0.6)


def assert_is_white(image, tolerance):
    assert np.all(np.isfinite(image))
    assert image.min() > 0.5
    assert image.max() < 1.5
    assert image.mean() == pytest.approx(1, abs=tolerance)


@pytest.fixture(scope="module")
def two_mirrors(tmp_path_factory):
    """Two parallel mirrors and a ball between them, which reflect one another without end."""
    mirrors = [
        quad("left", [[-0.6, -1, 1], [-0.6, -1, -1], [-0.6, 1, -1], [-0.6, 1, 1]], 0, tangent=(0, 1, 0)),
        quad("right", [[0.6, -1, -1], [0.6, -1, 1], [0.6, 1, 1], [0.6, 1, -1]], 0, tangent=(0, 1, 0)),
    ]
    materials = [metal("Mirror"), metal("Ball")]
    scene = make_tiny_scene(
        *mirrors, sphere("ball", [0, 0, 0], 0.3, 1, num_rings=24), camera=camera(), environment=WHITE,
        materials=materials,
    )  # fmt: skip
    return bake(scene, tmp_path_factory.mktemp("mirrors"))


@pytest.mark.parametrize("roughness", [0.01, 0.05, 0.1, 0.2, 0.3])
def test_mirrors_that_face_each_other_lose_no_light(two_mirrors, roughness):
    def change(document):
        for material in document["materials"].values():
            material["terms"][0]["params"]["roughness"] = roughness

    assert_is_white(shown(two_mirrors, change), 0.06)


@pytest.mark.parametrize(
    "term",
    [
        {"model": "ward_anisotropic", "params": {"alpha_x": 0.005, "alpha_y": 0.3}},
        {"model": "ashikhmin_shirley", "params": {"nu": 1e5, "nv": 1e5, "f0": 1.0}},
        {"model": "lafortune", "params": {"exponent": 1e5}},
    ],
)
def test_anisotropic_mirrors_are_neither_black_nor_too_bright(two_mirrors, term):
    """These terms are not normalized at grazing angles."""

    def change(document):
        document["materials"]["Ball"]["terms"] = [{**term, "color": [1.0, 1.0, 1.0], "texture": None}]

    image = shown(two_mirrors, change)
    assert np.all(np.isfinite(image))
    assert image.min() > 0.2
    assert image.max() < 3


def test_a_curve_that_is_one_spike_is_finite_and_one_that_is_zero_is_black(two_mirrors):
    def drawn(*points):
        def change(document):
            for material in document["materials"].values():
                material["terms"][0]["curves"] = {"theta_h": {"points": [list(point) for point in points]}}

        return shown(two_mirrors, change)

    spike = drawn((0, 0), (0.2, 0), (0.21, 1e4), (0.22, 0), (90, 0))
    assert np.all(np.isfinite(spike))
    assert spike.min() > 0
    zero = drawn((0, 0), (90, 0))
    assert np.mean(zero == 0) > 0.3
    assert zero.max() <= 1


def test_memory_for_a_tenth_of_the_rays_changes_nothing(two_mirrors):
    np.testing.assert_allclose(shown(two_mirrors, cache_bytes=1 << 18), shown(two_mirrors), rtol=1e-5)


def test_a_sharp_object_in_glass_before_a_mirror_is_white(tmp_path):
    clear = {"model": "ggx", "color": [1, 1, 1], "params": {"roughness": 0.03, "f0": 0.04}, "texture": None}
    glass = Material("Glass", (clear,), glass=Glass(thickness=1.0))
    meshes = [
        quad("mirror", [[-3, -2, -1.2], [3, -2, -1.2], [3, 2, -1.2], [-3, 2, -1.2]], 0),
        sphere("glass", [0, 0, 0], 0.6, 1, num_rings=24),
        sphere("ball", [0, 0, 0], 0.3, 2, num_rings=24),
    ]
    materials = [metal("Mirror"), glass, metal("Ball", 0.1)]
    scene = make_tiny_scene(*meshes, camera=camera(), environment=WHITE, materials=materials)
    assert_is_white(shown(bake(scene, tmp_path)), 0.1)


def test_a_normal_map_of_noise_is_finite_and_loses_little(tmp_path):
    noise = np.random.default_rng(3).normal(0, 0.5, (64, 64, 3))
    noise[..., 2] = np.abs(noise[..., 2] + 1)
    texels = (noise / np.linalg.norm(noise, axis=2, keepdims=True)).astype(np.float32)
    bumpy = replace(metal("Ball", 0.05, roughness_map="roughness"), normal_map=Texture(texels))
    scene = make_tiny_scene(
        sphere("ball", [0, 0, 0], 0.8, 0, num_rings=24), camera=camera(), environment=WHITE, materials=[bumpy]
    )
    image = shown(bake(scene, tmp_path))
    assert np.all(np.isfinite(image))
    assert image.min() > 0.1
    assert 0.7 < image.mean() < 1.1


@pytest.mark.parametrize("roughness", [0.02, 0.05, 0.15, 0.3])
def test_one_texel_of_a_million_is_reflected_with_all_its_light(tmp_path, roughness):
    """A distant mirror ball of radius R under the irradiance E has the radiant intensity E R² / 4 in all directions."""
    radiance, distance, yfov, radius = np.full((32, 64, 3), 0.1, np.float32), 40.0, 0.05, 0.8
    radiance[8, 44] = 1e6
    far = make_camera("front", (0, 0, distance), (0, 0, 0), yfov)
    ball = sphere("ball", [0, 0, 0], radius, 0, num_rings=96)
    scene = make_tiny_scene(ball, camera=far, environment=radiance, materials=[metal("Ball", roughness)])
    image = shown(bake(scene, tmp_path, "direct", (4 * SIZE[0], 4 * SIZE[1])))
    assert np.all(np.isfinite(image))
    irradiance = 1e6 * 2 * np.pi / 64 * (np.cos(8 * np.pi / 32) - np.cos(9 * np.pi / 32))
    solid_angle = SIZE[0] / SIZE[1] * (2 * np.tan(yfov / 2)) ** 2
    expected = 0.1 + irradiance * radius**2 / (4 * distance**2 * solid_angle)
    assert image.mean() == pytest.approx(expected, rel=0.1)
