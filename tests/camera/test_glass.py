"""Glass: refraction and reflection against Snell and Fresnel, and transmitted light."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy_reference import unit
from session_edits import make_look, relative_rmse
from tiny_scenes import make_camera, make_tiny_scene, quad, sphere, studio

from relume.brdf.fresnel import fresnel
from relume.camera.refraction import MAX_GLASS_HITS, dielectric
from relume.camera.transparency_layers import trace_layers
from relume.camera.view_samples import sample_view
from relume.core.cache import Cache
from relume.live.fixed_camera.coverage import Coverage
from relume.live.free_camera.free_camera_picture import FreeCameraPicture
from relume.live.opened.openers import open_bake
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.raytrace.scene_buffers import build_scene_buffers
from relume.raytrace.visibility import trace_visibility
from relume.reference.image import reference_image
from relume.scene.model import Glass, Material
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

SIZE = (64, 48)
EVEN = np.full(1, 0.5, np.float32)
WHITE = Material("White", ({"model": "lambert", "color": [0.8, 0.8, 0.8]},))


def glass(**fields):
    term = {"model": "ggx", "color": [1, 1, 1], "params": {"roughness": 0.3, "f0": [0.04] * 3}}
    return Material("Glass", (term,), glass=Glass(**fields))


def wall(z=-1.0):
    return quad("wall", [[-3, -3, z], [3, -3, z], [3, 3, z], [-3, 3, z]], 0)


def slab(depth):
    """A box about the origin, `depth` from front to back, with faces outward."""
    x, y, z = 2.0, 2.0, depth / 2
    corners = [
        [[-x, -y, z], [x, -y, z], [x, y, z], [-x, y, z]],
        [[x, -y, -z], [-x, -y, -z], [-x, y, -z], [x, y, -z]],
    ]
    return [quad(name, side, 1) for name, side in zip(("front", "back"), corners, strict=True)]


def scene_with(*meshes, material):
    camera = make_camera("front", (0, 0, 3), (0, 0, 0), 0.6)
    return make_tiny_scene(wall(), *meshes, camera=camera, environment=studio(), materials=[WHITE, material])


def trace_ray_paths(scene, directions):
    camera_position = np.array([0, 0, 3], np.float32)
    return trace_layers(
        build_scene_buffers(scene), scene.materials, camera_position, directions.astype(np.float32), EVEN
    )


def slanted(num=50):
    across = np.linspace(-0.3, 0.3, num)
    return unit(np.stack([across, 0.3 * across, -np.ones(num)], axis=1))


def by_angles(theta_i, theta_t):
    """Fresnel's equations for the incident and transmitted angles, neither 0."""
    across = np.sin(theta_i - theta_t) / np.sin(theta_i + theta_t)
    along = np.tan(theta_i - theta_t) / np.tan(theta_i + theta_t)
    return (across**2 + along**2) / 2


def test_an_interface_follows_fresnel_and_total_internal_reflection():
    cosine = np.linspace(0, 1, 101)
    outside, cos_t = dielectric(cosine, np.full(101, 1 / 1.5))
    np.testing.assert_allclose(outside, fresnel(cosine, 1.5, 0.0), atol=1e-12)
    np.testing.assert_allclose(outside[:-1], by_angles(np.arccos(cosine[:-1]), np.arccos(cos_t[:-1])), atol=1e-9)
    np.testing.assert_allclose(np.sqrt(1 - cos_t**2) * 1.5, np.sqrt(1 - cosine**2), atol=1e-12)
    inside, cos_t = dielectric(cosine, np.full(101, 1.5))
    passes = np.sqrt(1 - cosine**2) * 1.5 < 1
    np.testing.assert_allclose(inside[passes], dielectric(cos_t[passes], np.full(passes.sum(), 1 / 1.5))[0], atol=1e-9)
    assert (inside[~passes] == 1).all()


def test_thin_glass_attenuates_by_tint_and_reflection_without_refraction():
    tint = (0.9, 0.5, 0.2)
    pane = quad("pane", [[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]], 1)
    directions = slanted()
    first, behind = trace_ray_paths(scene_with(pane, material=glass(tint=tint)), directions)
    assert first.is_visible.all()
    np.testing.assert_array_equal(behind.directions, directions.astype(np.float32))
    expected = (1 - fresnel(-directions[:, 2], 1.5, 0.0))[:, None] * tint
    np.testing.assert_allclose(behind.transmittance, expected, rtol=1e-4)
    np.testing.assert_allclose(behind.hits.distance, 4 / -directions[:, 2], rtol=1e-4)


def test_only_the_border_of_thin_glass_is_an_edge():
    corners = np.array([[-0.3, -0.3, 0], [0.3, -0.3, 0], [0.3, 0.3, 0], [-0.3, 0.3, 0]])
    scene = scene_with(quad("pane", corners, 1), material=glass())
    samples = sample_view(scene, build_scene_buffers(scene), "front", SIZE)
    assert np.bincount(samples.pixel).max() > 2
    assert samples.num_rays < 3.5 * SIZE[0] * SIZE[1]


@pytest.mark.parametrize("ior", [1.0, 1.5, 2.4])
def test_a_slab_displaces_rays_as_snells_law_predicts(ior):
    depth, directions = 0.5, slanted()
    absorbed = (0.0, 0.4, 2.0)
    scene = scene_with(*slab(depth), material=glass(thickness=depth, ior=ior, absorbed=absorbed))
    front, back, behind = trace_ray_paths(scene, directions)
    assert front.is_visible.all()
    assert not back.is_visible.any()
    np.testing.assert_allclose(behind.directions, directions, atol=2e-5)  # parallel to the incident ray
    sin_i = np.linalg.norm(directions[:, :2], axis=1)
    inside = depth / np.sqrt(1 - (sin_i / ior) ** 2)
    tan_t = sin_i / ior / np.sqrt(1 - (sin_i / ior) ** 2)
    off_axis = sin_i / -directions[:, 2] * (2.75 + 0.75) + tan_t * depth
    mesh = scene.meshes[0]
    corners = mesh.positions[mesh.faces[behind.hits.face]]
    b = np.column_stack([1 - behind.hits.uv.sum(axis=1), behind.hits.uv])[:, :, None]
    np.testing.assert_allclose(np.linalg.norm((corners * b).sum(axis=1)[:, :2], axis=1), off_axis, atol=1e-3)
    passed = (1 - fresnel(-directions[:, 2], ior, 0.0))[:, None] ** 2 * np.exp(-inside[:, None] * absorbed)
    np.testing.assert_allclose(behind.transmittance, passed, rtol=1e-3)


def test_totally_reflected_rays_terminate():
    scene = scene_with(sphere("ball", [0, 0, 0], 0.8, 1, num_rings=24), material=glass(thickness=1.6, ior=2.4))
    layers = trace_ray_paths(scene, slanted(2000))
    assert 3 <= len(layers) <= MAX_GLASS_HITS
    for before, after in pairwise(layers):
        assert set(after.ray) <= set(before.ray)
        assert (after.transmittance <= 1).all()
    np.testing.assert_allclose(np.linalg.norm(layers[-1].directions, axis=1), 1, atol=1e-5)


def test_glass_without_refraction_and_reflection_is_invisible():
    ball = sphere("ball", [0, 0, 0], 0.8, 1, num_rings=16)
    scene = scene_with(ball, material=glass(thickness=1.6, ior=1.0))
    samples = sample_view(scene, build_scene_buffers(scene), "front", SIZE)
    assert samples.transmittance is not None
    on_wall = samples.material == 0
    throughput = np.bincount(
        samples.pixel[on_wall], samples.throughput[on_wall].mean(axis=1), minlength=SIZE[0] * SIZE[1]
    )
    assert np.median(np.abs(throughput - 1)) < 1e-4
    assert np.abs(throughput - 1).max() < 0.26  # rays of the two layers are merged separately


@pytest.mark.parametrize("before", [[quad("pane", [[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]], 1)], slab(0.5)])
def test_mirrors_behind_invisible_glass_are_unchanged(before):
    """With neither refraction nor reflection: rays cross the glass before and after the mirror."""
    chrome = Material("Chrome", ({"model": "ggx", "color": [1, 1, 1], "params": {"roughness": 0.02, "f0": [0.9] * 3}},))
    clear = glass(ior=1.0, thickness=0.5 if len(before) == 2 else 0.0)
    beyond = quad("beyond", [[9, -9, 5], [-9, -9, 5], [-9, 9, 5], [9, 9, 5]], 2)
    camera_position, directions, mirror_layers = np.array([0, 0, 3], np.float32), slanted(), []
    for meshes in ([], before):
        camera = make_camera("front", camera_position, (0, 0, 0), 0.6)
        scene = make_tiny_scene(
            wall(), *meshes, beyond, camera=camera, environment=studio(), materials=[chrome, clear, WHITE]
        )
        geometry = build_scene_buffers(scene)
        layers = trace_layers(geometry, scene.materials, camera_position, directions, EVEN)
        (last,) = (
            layer
            for layer in layers
            if layer.chain is not None and (geometry.face_material[layer.hits.face] == 2).all()
        )
        assert last.is_visible.all()
        mirror_layers.append(last)
    np.testing.assert_array_equal(mirror_layers[0].ray, mirror_layers[1].ray)
    np.testing.assert_allclose(
        mirror_layers[0].hits.distance, mirror_layers[1].hits.distance, atol=3e-3
    )  # ray origins are offset from surfaces
    np.testing.assert_allclose(mirror_layers[0].hits.uv, mirror_layers[1].hits.uv, atol=3e-4)
    np.testing.assert_allclose(mirror_layers[1].transmittance, 1, atol=1e-5)


def test_light_is_transmitted_in_proportion():
    tint = (0.8, 0.8, 0.8)
    pane = quad("pane", [[-90, 1, 90], [90, 1, 90], [90, 1, -90], [-90, 1, -90]], 1)
    scene = scene_with(pane, material=glass(tint=tint))
    z = np.linspace(0.3, 1, 16000)
    turn = np.arange(16000) * 2.4
    directions = np.stack([np.sqrt(1 - z**2) * np.cos(turn), z, np.sqrt(1 - z**2) * np.sin(turn)], axis=1)
    points, up = np.array([[0.1, 0, 0.2], [0.5, 0.1, 0.3]], np.float32), np.tile([0, 1, 0], (2, 1)).astype(np.float32)
    bits = trace_visibility(build_scene_buffers(scene).embree, points, up, directions.astype(np.float32)).visible
    visible = np.unpackbits(bits, axis=1, bitorder="little")[:, :16000]
    past_wall = replace(scene, meshes=scene.meshes[:1])
    bits = trace_visibility(build_scene_buffers(past_wall).embree, points, up, directions.astype(np.float32)).visible
    free = np.unpackbits(bits, axis=1, bitorder="little")[:, :16000].all(axis=0)
    np.testing.assert_array_equal(visible[0, free], visible[1, free])  # one light is transmitted everywhere or nowhere
    for chunk in np.array_split(np.flatnonzero(free), 4):
        schlick = 0.04 + 0.96 * (1 - z[chunk]) ** 5
        assert visible[0, chunk].mean() == pytest.approx(np.mean(0.8 * (1 - schlick)), abs=0.04)


@pytest.fixture(scope="module")
def tinted():
    """A ball of absorbing glass and a red thin glass before a wall."""
    ball = sphere("ball", [-0.5, 0, 0], 0.4, 1, num_rings=16)
    pane = quad("pane", [[0.1, -0.5, 0], [0.9, -0.5, 0], [0.9, 0.5, 0], [0.1, 0.5, 0]], 2)
    materials = [WHITE, glass(thickness=0.8, absorbed=(2.0, 0.2, 0.2)), replace(glass(tint=(1, 0.1, 0.1)), name="Pane")]
    camera = make_camera("front", (0, 0, 3), (0, 0, 0), 0.6)
    back = quad("wall", [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1]], 0)
    return make_tiny_scene(back, ball, pane, camera=camera, environment=studio(), materials=materials)


def opened(scene, method, folder, size=SIZE, num_lights=600):
    recipe = Recipe(method, ("front",), size, num_lights, num_probes=2000)
    return open_bake(bake_in_process(METHODS[method], scene, recipe, folder / f"{method}.zarr"), Cache(1 << 30))


def test_images_of_glass_equal_the_reference_and_show_the_background(tinted, tmp_path):
    bake = opened(tinted, "direct", tmp_path)
    look = make_look(bake)
    picture = render_image(bake, "front", look)
    assert relative_rmse(picture, reference_image(tinted, "front", look, SIZE, 0)) < 0.03
    red, green, _ = picture[18:30, 40:52].mean(axis=(0, 1))
    assert red > 3 * green
    view = bake.views["front"]
    assert view.throughput.shape == (view.num_view_samples, 3)
    alpha = Coverage(view, lambda material: np.ones(0, np.float32)).pixels([])
    assert alpha[24, 32] == 1
    (camera,), materials = tinted.cameras, list(tinted.materials)
    outside = make_tiny_scene(*tinted.meshes[1:], camera=camera, environment=studio(), materials=materials)
    alone = opened(outside, "direct", tmp_path / "alone").views["front"]
    alpha = Coverage(alone, lambda material: np.ones(0, np.float32)).pixels([])
    assert alpha[24, 46] == pytest.approx(1 - 0.96 * 0.4, abs=0.01)
    assert alpha[2, 2] == 0


def test_shadows_of_thin_glass_are_tinted(tmp_path):
    """A floor lit by the environment through two glass sheets, by a bake and by the reference."""
    tint, size = np.array([0.95, 0.8, 0.5]), (16, 16)
    glass_quads = [quad(f"at {y}", [[-60, y, 60], [60, y, 60], [60, y, -60], [-60, y, -60]], 1) for y in (4, 5)]
    floor = quad("floor", [[-9, 0, 9], [9, 0, 9], [9, 0, -9], [-9, 0, -9]], 0)
    camera, radiance = make_camera("front", (0, 2, 2), (0, 0, 0), 0.6), np.ones((32, 64, 3), np.float32)
    scene = make_tiny_scene(
        floor, *glass_quads, camera=camera, environment=radiance, materials=[WHITE, glass(tint=tuple(tint))]
    )
    bake = opened(scene, "direct", tmp_path, size, 2000)
    for picture in (
        render_image(bake, "front", make_look(bake)),
        reference_image(scene, "front", make_look(bake), size, 0),
    ):
        actual = picture.mean(axis=(0, 1))
        np.testing.assert_allclose(actual / actual[0], (tint / tint[0]) ** 2, atol=0.04)


def test_a_free_camera_shows_thin_glass_like_a_fixed_view(tinted, tmp_path):
    back, _, pane = tinted.meshes
    (camera,), materials = tinted.cameras, list(tinted.materials)
    pane_alone = make_tiny_scene(back, pane, camera=camera, environment=studio(), materials=materials)
    bake = opened(pane_alone, "probes", tmp_path)
    look = make_look(bake)
    free_bake = render_image(bake, "front", look)
    still = reference_image(pane_alone, "front", look, SIZE, 0)
    session = FreeCameraPicture(bake, "front")
    session.set_look(look)
    session.advance(None)
    session.image()
    assert session.inspect(46, 24)["material"] == "Pane"
    assert session.inspect(46, 24)["position"][2] == pytest.approx(0, abs=1e-3)
    assert session.inspect(20, 24)["material"] == "White"
    inside = (slice(17, 31), slice(38, 54))
    np.testing.assert_allclose(free_bake[inside].mean(axis=(0, 1)), still[inside].mean(axis=(0, 1)), rtol=0.08)
