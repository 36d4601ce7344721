"""Frosted glass: facets against their distribution, pixels against many rays through one of them."""

from __future__ import annotations

import numpy as np
import pytest
from session_edits import make_look, relative_rmse
from tiny_scenes import make_camera, make_tiny_scene, quad

from relume.assets.environments.equirect import lookup
from relume.camera.camera_samples import FROST_PERIOD, stratified_facets
from relume.camera.refraction import unshadowed_fraction, visible_facets
from relume.camera.transparency_layers import trace_layers
from relume.camera.view_samples import sample_view
from relume.core.cache import Cache
from relume.core.errors import SceneError
from relume.live.opened.openers import open_bake
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.raytrace.alpha_filter import STOP_AT_OPAQUE
from relume.raytrace.scene_buffers import build_scene_buffers
from relume.reference import reference_image
from relume.scene.model import Glass, Material
from relume.scene.scene_folder import load_scene, save_scene
from relume.scene.validate import check_glass
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process
from relume.views.frost_filter import REACH

SIZE = 64, 48
ALPHA = 0.3
CAMERA = np.array([0, 0, 3], np.float32)


def frosted(roughness, **fields):
    term = {"model": "ggx", "color": [0, 0, 0], "params": {"roughness": 0.3, "f0": [0.04] * 3}}
    return Material("Glass", (term,), glass=Glass(roughness=roughness, **fields))


def halves():
    """An environment that is bright on one side of −z and dark on the other. (64, 128, 3)"""
    radiance = np.full((64, 128, 3), 0.05, np.float32)
    radiance[:, :64] = 1.0
    columns = np.broadcast_to(np.arange(128, dtype=np.float32)[None, :, None], (64, 128, 3))
    ahead = round(float(lookup(columns, np.array([[0, 0, -1]], np.float32))[0, 0]))
    return np.roll(radiance, ahead, axis=1)


def pane_scene(glass):
    """A pane that fills the image, in front of nothing."""
    pane = quad("pane", [[-3, -3, 0], [3, -3, 0], [3, 3, 0], [-3, 3, 0]], 0)
    camera = make_camera("front", tuple(CAMERA), (0, 0, 0), 0.6)
    return make_tiny_scene(pane, camera=camera, environment=halves(), materials=[glass])


def slab_scene(glass):
    sides = {"front": 0.1, "back": -0.1}
    corners = {
        name: [[-3, -3, z], [3, -3, z], [3, 3, z], [-3, 3, z]][:: 1 if name == "front" else -1]
        for name, z in sides.items()
    }
    meshes = [quad(name, side, 0) for name, side in corners.items()]
    camera = make_camera("front", tuple(CAMERA), (0, 0, 0), 0.6)
    return make_tiny_scene(*meshes, camera=camera, environment=halves(), materials=[glass])


@pytest.mark.parametrize("angle", [0.0, 0.6, 1.3])
def test_facets_have_the_distribution_of_those_that_are_visible(angle) -> None:
    """E[g(h)] = ∫ g D(h) max(0, wo · h) G₁(wo) / cos θo dh for a test function g."""
    rng, num = np.random.default_rng(1), 200_000
    wo = np.tile([np.sin(angle), 0, np.cos(angle)], (num, 1))
    normal, alpha = np.tile([0, 0, 1.0], (num, 1)), np.full(num, ALPHA)
    half = visible_facets(normal, wo, alpha, rng.random((num, 2)))
    np.testing.assert_allclose(np.linalg.norm(half, axis=1), 1, rtol=1e-9)
    assert (half[:, 2] > 0).all()
    cosine, phi = (g.ravel() for g in np.meshgrid((np.arange(800) + 0.5) / 800, np.arange(400) * np.pi / 200))
    sine = np.sqrt(1 - cosine**2)
    grid = np.stack([sine * np.cos(phi), sine * np.sin(phi), cosine], axis=1)
    density = ALPHA**2 / (np.pi * (cosine**2 * (ALPHA**2 - 1) + 1) ** 2)
    masking = unshadowed_fraction(np.array([np.cos(angle)]), np.array([ALPHA]))[0]
    weights = density * np.maximum(grid @ wo[0], 0) * masking / np.cos(angle) * (2 * np.pi / len(grid))
    assert weights.sum() == pytest.approx(1, abs=0.01)
    for moment in (lambda h: h[:, 0], lambda h: h[:, 2], lambda h: h[:, 1] ** 2, lambda h: h[:, 0] * h[:, 2]):
        assert moment(half).mean() == pytest.approx(float(weights @ moment(grid)), abs=0.005)


def test_any_four_by_four_pixels_have_one_net() -> None:
    num, width = 16, 32
    for x0, y0 in ((0, 0), (3, 5)):
        y, x = (g.ravel() for g in np.mgrid[y0 : y0 + FROST_PERIOD, x0 : x0 + FROST_PERIOD])
        points = stratified_facets(y * width + x, width, num)[:, 0]
        cells = np.floor(points * 16).astype(int)
        assert len(np.unique(cells @ [16, 1])) == 256
        for pixel in np.floor(points * 4).astype(int).reshape(16, num, 2):
            assert len(np.unique(pixel @ [4, 1])) == num


def through_one_pixel(scene, num=65_536):
    """Mean radiance of many rays through the center of the image, with random facets."""
    directions = np.tile(np.array([[0, 0, -1]], np.float32), (num, 1))
    facets = np.random.default_rng(2).random((num, 4, 2))
    layers = trace_layers(
        build_scene_buffers(scene), scene.materials, CAMERA, directions, np.repeat(STOP_AT_OPAQUE, num), facets=facets
    )
    total = np.zeros(3)
    for layer in layers:
        rows = np.flatnonzero(layer.is_visible & (layer.hits.face < 0))
        total += (layer.transmittance[rows] * lookup(scene.environment.radiance, layer.directions[rows])).sum(axis=0)
    return total / num


@pytest.fixture(scope="module", params=["pane", "slab"])
def bake(request, tmp_path_factory):
    make_scene = pane_scene if request.param == "pane" else slab_scene
    scene = make_scene(frosted(0.5, thickness=0.0 if request.param == "pane" else 0.2))
    folder, recipe = tmp_path_factory.mktemp("frosted") / "direct.zarr", Recipe("direct", ("front",), SIZE, 300)
    return scene, open_bake(bake_in_process(METHODS["direct"], scene, recipe, folder), Cache(1 << 29))


def test_a_pixel_is_the_mean_of_many_rays(bake) -> None:
    scene, transfer = bake
    image = render_image(transfer, "front", make_look(transfer))
    height, width, _ = image.shape
    center = image[height // 2 - 1 : height // 2 + 1, width // 2 - 1 : width // 2 + 1].mean(axis=(0, 1))
    np.testing.assert_allclose(center, through_one_pixel(scene), rtol=0.03)


def test_the_picture_is_clean(bake) -> None:
    """Differences of neighbors are those of a smooth edge, without noise."""
    _, transfer = bake
    image = render_image(transfer, "front", make_look(transfer))[4:-4, 4:-4, 0]
    assert np.ptp(image) > 0.2
    columns = np.arange(image.shape[1])
    smooth = np.polynomial.Polynomial.fit(columns, image.mean(axis=0), 7)(columns)
    assert relative_rmse(image, np.broadcast_to(smooth, image.shape)) < 0.02


def test_it_agrees_with_the_reference(bake) -> None:
    scene, transfer = bake
    look = make_look(transfer)
    image, reference = render_image(transfer, "front", look), reference_image(scene, "front", look, SIZE, 1)
    assert relative_rmse(image[4:-4, 4:-4], reference[4:-4, 4:-4]) < 0.02


def test_the_filter_keeps_the_light_of_the_image(bake) -> None:
    _, transfer = bake
    view = transfer.views["front"]
    assert view.frost is not None
    ones = np.ones(len(view.frost.pixel), np.float32)
    inner = np.zeros(SIZE[::-1], bool)
    inner[REACH:-REACH, REACH:-REACH] = True
    np.testing.assert_allclose((view.frost.change @ ones)[inner.ravel()[view.frost.pixel]], 0, atol=1e-5)


def test_clear_glass_has_one_ray() -> None:
    scenes = [pane_scene(frosted(roughness)) for roughness in (0.0, 0.03, 0.5)]
    clear, nearly, rough = (sample_view(scene, build_scene_buffers(scene), "front", (32, 24)) for scene in scenes)
    assert len(clear.pixel) == len(nearly.pixel) == 2 * 32 * 24
    assert not clear.frost.any()
    assert 15 * 32 * 24 < len(rough.pixel) <= 17 * 32 * 24


def test_its_roughness_is_saved_and_checked(tmp_path) -> None:
    scene = pane_scene(frosted(0.4))
    save_scene(scene, tmp_path / "scene")
    assert load_scene(tmp_path / "scene").materials[0].glass == scene.materials[0].glass
    with pytest.raises(SceneError, match="out of range"):
        check_glass(frosted(1.5))
