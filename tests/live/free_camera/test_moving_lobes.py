"""Polished surfaces while a camera moves, against exact views of the same camera and closed forms."""

import copy

import numpy as np
import pytest
from scipy.ndimage import binary_erosion
from tiny_scenes import make_camera, make_tiny_scene, quad, sphere

from relume.brdf.albedo import directional_albedo
from relume.core.cache import Cache
from relume.live.free_camera import shade_lobe_rays, shared_lobe_rays
from relume.live.free_camera.free_camera_picture import FreeCameraPicture
from relume.live.free_camera.lobe_terms import split_terms
from relume.live.free_camera.static_view_jobs import StaticViewState, correction_job
from relume.live.opened import fixed_views
from relume.live.opened.openers import open_bake
from relume.live.opened.static_view import StaticViewBuilder
from relume.look import complete, validate
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.scene.model import Glass, Material
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

CAMERA = make_camera("front", [0.4, 1.2, 3.2], [0, 0.45, 0], 0.7)
SIZE = (48, 36)
CHROME = {"model": "ggx", "color": [1.0] * 3, "params": {"roughness": 0.05, "f0": 0.9}}
RED = {"model": "lambert", "color": [0.8, 0.1, 0.1]}
BRUSHED = {"model": "ashikhmin_shirley", "color": [1.0] * 3, "params": {"nu": 300.0, "nv": 1500.0, "f0": 0.07}}


def bake_ball(folder, environment):
    ball = sphere("ball", (0, 0.5, 0), 0.5, 0, num_rings=24)
    floor = quad("floor", [[-2, 0, 2], [2, 0, 2], [2, 0, -2], [-2, 0, -2]], 1)
    materials = [Material("Ball", (CHROME,)), Material("Floor", (RED,))]
    scene = make_tiny_scene(ball, floor, camera=CAMERA, environment=environment, materials=materials)
    recipe = Recipe("probes", ("front",), SIZE, 200, num_probes=3000)
    bake = open_bake(bake_in_process(METHODS["probes"], scene, recipe, folder / "s.zarr"), Cache(1 << 30))
    return bake, StaticViewBuilder(bake.light_transport, scene)


@pytest.fixture(scope="module")
def white(tmp_path_factory):
    return bake_ball(tmp_path_factory.mktemp("white"), np.ones((16, 32, 3), np.float32))


@pytest.fixture(scope="module")
def sunny(tmp_path_factory):
    radiance = np.full((64, 128, 3), 0.3, np.float32)
    radiance[20:22, 40:42] = 300
    return bake_ball(tmp_path_factory.mktemp("sunny"), radiance)


def look_with(bake, edit):
    document = copy.deepcopy(complete({}, bake.default_look))
    edit(document)
    return validate(document, bake.default_look)


def show(bake, look, builder=None, finer=1):
    camera_and_size = CAMERA, (finer * SIZE[0], finer * SIZE[1])
    image = render_image(bake, "front", look, static_views=builder, camera_and_size=camera_and_size)
    return np.asarray(image[..., :3])


def ball_of(bake, look):
    """Pixels of the ball alone: what changes with its color."""

    def darken(document):
        document["materials"]["Ball"]["terms"][0]["color"] = [0.0] * 3

    return (show(bake, look) - show(bake, look_with(bake, darken))).max(axis=2) > 0.05


def test_narrow_terms_leave_the_basis():
    rough = {**CHROME, "params": {"roughness": 0.4, "f0": 0.9}}
    traced, others = split_terms([RED, CHROME, rough])
    assert others == [RED, rough]
    theta_o, values = directional_albedo([CHROME])
    np.testing.assert_allclose(traced.albedo[0, 0], np.interp(0, theta_o, values[:, 0]), rtol=1e-3)
    assert split_terms([RED, rough]) == (None, [RED, rough])
    assert (traced.core.quantile[0, -1] == traced.sampling.quantile[0, 2048]).all()


def test_a_chrome_ball_shows_the_floor_as_the_exact_view_does(white):
    bake, builder = white
    look = look_with(bake, lambda document: None)
    moving, exact, is_ball = show(bake, look), show(bake, look, builder), ball_of(bake, look)
    assert is_ball.sum() > 100
    assert abs(moving[is_ball].mean() / exact[is_ball].mean() - 1) < 0.03
    assert np.sqrt(np.mean((moving - exact)[is_ball] ** 2)) < 0.1 * np.sqrt(np.mean(exact[is_ball] ** 2))
    # the floor is in its lower half, red
    lower = is_ball & (np.arange(SIZE[1]) > 24)[:, None]
    assert moving[lower, 0].mean() > 2 * moving[lower, 1].mean()


def test_direct_light_alone_leaves_the_floor_out(white):
    bake, builder = white
    look = look_with(bake, lambda document: document["transport"].update(show="direct"))
    moving, exact, is_ball = show(bake, look), show(bake, look, builder), ball_of(bake, look)
    assert np.sqrt(np.mean((moving - exact)[is_ball] ** 2)) < 0.1 * np.sqrt(np.mean(exact[is_ball] ** 2))


@pytest.mark.parametrize("roughness", [0.05, 0.1])  # partly a mirror of the exact image, and a lobe alone
def test_the_residual_leaves_indirect_light_in_a_polished_surface(white, roughness):
    bake, builder = white
    size = 20 * SIZE[0], 20 * SIZE[1]
    picture = FreeCameraPicture(bake, "front", is_watched=True)
    picture.set_camera(CAMERA, size)

    def edit(document):
        document["materials"]["Ball"]["terms"][0]["params"]["roughness"] = roughness

    look = look_with(bake, edit)
    picture.set_look(look)
    picture.advance(None)
    while (job := picture.next_job()) is not None and job.key[0] != "highlights":
        job.apply(job.run(lambda share: None, lambda: False))
        picture.advance(None)
    before = picture.image()
    view_state = StaticViewState(builder.make_static_view, bake.cache, (CAMERA, size), look, None)
    applied = []
    job = correction_job(view_state, picture.unwatched(), (0, 0), applied.append)
    job.apply(job.run(lambda share: None, lambda: False))
    is_chrome = bake.stored_scene.face_material[np.maximum(picture.gbuffer.hits.face, 0)] == 0
    is_chrome &= picture.gbuffer.hits.face >= 0
    pixels = before.reshape(-1, 3)[is_chrome[: size[0] * size[1]]]
    residual = np.zeros_like(before) if applied[0] is None else applied[0]
    assert abs(residual.reshape(-1, 3)[is_chrome[: size[0] * size[1]]]).mean() < 0.02 * pixels.mean()
    # the picture itself keeps the light of the floor
    picture.set_camera(CAMERA, size)
    picture.advance(None)
    np.testing.assert_allclose(picture.image(), before, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("narrow", [{**CHROME, "params": {"roughness": 0.1, "f0": 0.9}}, BRUSHED])
def test_the_residual_corrects_what_lies_beneath_a_narrow_lobe_without_tracing_it(sunny, monkeypatch, narrow):
    bake, builder = sunny
    size = 2 * SIZE[0], 2 * SIZE[1]

    def residual_of(terms):
        look = look_with(bake, lambda document: document["materials"]["Ball"].update(terms=terms))
        picture = FreeCameraPicture(bake, "front")
        picture.set_camera(CAMERA, size)
        view_state = StaticViewState(builder.make_static_view, bake.cache, (CAMERA, size), look, None)
        applied = []
        job = correction_job(view_state, picture, (0, 0), applied.append)
        job.apply(job.run(lambda share: None, lambda: False))
        return applied[0], picture.gbuffer

    def refuse(*args):
        raise AssertionError("the exact view traces these rays, in all light")

    monkeypatch.setattr(fixed_views, "trace_lobes", refuse)
    (diffuse, gbuffer), (both, _) = residual_of([RED]), residual_of([RED, narrow])
    face = gbuffer.hits.face[: size[0] * size[1]]
    is_ball = (face >= 0) & (bake.stored_scene.face_material[np.maximum(face, 0)] == 0)
    assert abs(diffuse.reshape(-1, 3)[is_ball]).max() > 0.01
    np.testing.assert_allclose(both, diffuse, atol=1e-6)


@pytest.mark.parametrize("roughness", [0.01, 0.05, 0.2])
def test_the_highlight_of_a_sun_has_its_energy(sunny, roughness):
    bake, builder = sunny

    def edit(document):
        document["materials"]["Ball"]["terms"][0]["params"]["roughness"] = roughness

    look = look_with(bake, edit)
    moving, exact = show(bake, look, finer=4), show(bake, look, builder, finer=4)
    assert np.isfinite(moving).all()
    assert (moving >= 0).all()
    assert exact.max() > 3
    sun = exact - np.minimum(exact, 1)
    assert sun.mean() > 0.02 * exact.mean()
    assert abs(moving.mean() / exact.mean() - 1) < 0.03


def test_a_piece_without_rays_nearby_is_not_black(white, monkeypatch):
    bake, _ = white
    monkeypatch.setattr(shade_lobe_rays, "MAX_RAYS", 1)
    monkeypatch.setattr(shared_lobe_rays, "_LEAST_POINTS", 1)
    look = look_with(bake, lambda document: None)
    is_ball = ball_of(bake, look).repeat(8, axis=0).repeat(8, axis=1)
    assert (show(bake, look, finer=8)[binary_erosion(is_ball, iterations=8)].max(axis=1) > 0.05).all()


def test_each_block_of_pixels_has_a_point_with_rays():
    pixel = np.random.default_rng(4).choice(100 * 70, 60, replace=False).astype(np.int32)
    twice = np.concatenate([pixel, pixel[::-1]])
    image = shared_lobe_rays.ImagePoints.from_pixels(twice, (100, 70), None)
    assert image.num_pixels == 60
    assert (image.order[60:] == 2).all()
    y, x = np.divmod(pixel, 100)
    for block in set(zip(x // 16, y // 16, strict=True)):
        is_inside = (x // 16 == block[0]) & (y // 16 == block[1])
        assert image.order[:60][is_inside].min() == 0


def test_rays_of_glass_are_bounded_and_shared(tmp_path, monkeypatch):
    ball = sphere("ball", (0, 0.5, 0), 0.5, 0, num_rings=24)
    floor = quad("floor", [[-2, 0, 2], [2, 0, 2], [2, 0, -2], [-2, 0, -2]], 1)
    materials = [Material("Ball", (CHROME,), glass=Glass()), Material("Floor", (RED,))]
    environment = np.ones((16, 32, 3), np.float32)
    scene = make_tiny_scene(ball, floor, camera=CAMERA, environment=environment, materials=materials)
    recipe = Recipe("probes", ("front",), SIZE, 200, num_probes=2000)
    bake = open_bake(bake_in_process(METHODS["probes"], scene, recipe, tmp_path / "s.zarr"), Cache(1 << 30))
    num_traced, trace = [], shared_lobe_rays.mean_lobe_radiance

    def count(scene, environment, receivers, *args, **options):
        num_traced.append(receivers.points.num_points)
        return trace(scene, environment, receivers, *args, **options)

    monkeypatch.setattr(shared_lobe_rays, "mean_lobe_radiance", count)
    monkeypatch.setattr(shade_lobe_rays, "MAX_RAYS", 2000)
    picture = FreeCameraPicture(bake, "front")
    picture.set_camera(CAMERA, (4 * SIZE[0], 4 * SIZE[1]))
    picture.set_look(look_with(bake, lambda document: None))
    picture.advance(None)
    few = picture.image()
    assert 0 < num_traced[0] < 2500
    monkeypatch.setattr(shade_lobe_rays, "MAX_RAYS", 10**6)
    picture.set_camera(CAMERA, (4 * SIZE[0], 4 * SIZE[1]))
    picture.advance(None)
    many = picture.image()
    assert np.sqrt(np.mean((few - many) ** 2)) < 0.1 * np.sqrt(np.mean(many**2))


def test_a_glint_smaller_than_a_pixel_is_the_mean_over_it(sunny):
    bake, _ = sunny

    def edit(document):
        document["materials"]["Ball"]["terms"][0]["params"]["roughness"] = 0.03

    look = look_with(bake, edit)
    shown, finer = show(bake, look).astype(float), show(bake, look, finer=8).astype(float)
    expected = finer.reshape(SIZE[1], 8, SIZE[0], 8, 3).mean(axis=(1, 3))
    assert np.linalg.norm(shown - expected) < 0.3 * np.linalg.norm(expected)  # 0.94 with the middle of each pixel
