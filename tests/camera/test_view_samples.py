"""View samples: weights, order, silhouettes, textures, normals and the background."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from foliage import tuft
from tiny_scenes import checker, make_camera, make_tiny_scene, mesh, quad, sphere, still_life, studio

from relume.assets.environments.equirect import direction_to_uv
from relume.camera import tiling, view_samples
from relume.camera.view_samples import BACKGROUND, sample_view
from relume.raytrace.camera_rays import camera_directions
from relume.raytrace.scene_buffers import build_scene_buffers
from relume.raytrace.texture import MipMap
from relume.scene.model import Material, Texture, TextureEncoding

SIZE = (64, 48)
WHITE = ({"model": "lambert", "color": [1, 1, 1]},)


def sampled(scene, size=SIZE, view=None):
    return sample_view(scene, build_scene_buffers(scene), view or scene.cameras[0].name, size)


@pytest.fixture(scope="module")
def still_samples():
    scene = still_life()
    return scene, sampled(scene)


def weight_by_pixel(samples, rows, size=SIZE):
    out = np.zeros(size[0] * size[1])
    np.add.at(out, samples.pixel[rows], samples.weight[rows])
    return out


def test_weights_of_each_pixel_sum_to_one(still_samples):
    samples = still_samples[1]
    np.testing.assert_allclose(weight_by_pixel(samples, slice(None)), 1, atol=1e-6)
    assert samples.weight.min() >= 1 / 8 - 1e-6


def test_samples_are_sorted_by_material_then_by_image_position(still_samples):
    samples = still_samples[1]
    material = samples.material.astype(int)
    assert (np.diff(material) >= 0).all()
    assert set(material) == {0, 1, 2, BACKGROUND}
    for index in (0, 1, 2):
        pixel = samples.pixel[material == index].astype(int)
        y, x = np.divmod(pixel, SIZE[0])
        step = np.hypot(np.diff(x), np.diff(y))
        assert np.median(step) <= 2  # neighbors in memory are neighbors in the image
    assert samples.num_rays > SIZE[0] * SIZE[1]


def test_edges_have_more_samples_than_smooth_regions(still_samples):
    samples = still_samples[1]
    count = np.bincount(samples.pixel, minlength=SIZE[0] * SIZE[1]).reshape(SIZE[1], SIZE[0])
    assert count.min() == 1
    assert 2 <= count.max() <= 8
    several = np.zeros(count.shape, bool)
    for index in range(3):
        fraction = weight_by_pixel(samples, samples.material == index).reshape(count.shape)
        several |= (fraction > 0.01) & (fraction < 0.99)
    assert (count[several] >= 2).all()
    assert (count > 1).mean() < 0.25
    assert (count[-6:-1, 1:-1] == 1).all()  # the floor in the foreground


def flat(record):
    """All arrays of a record and of its nested records, by name."""
    fields = record._asdict() if hasattr(record, "_asdict") else vars(record)
    arrays = {}
    for name, value in fields.items():
        arrays |= {name: value} if isinstance(value, np.ndarray) else flat(value) if name != "num_rays" else {}
    return arrays


@pytest.mark.parametrize("is_rough", [False, True])
def test_samples_of_image_tiles_equal_those_of_the_whole_image(still_samples, is_rough, monkeypatch):
    scene, at_once = still_samples
    if is_rough:  # roughness levels are sorted before image positions
        texels = np.random.default_rng(1).integers(80, 255, (32, 32, 1), np.uint8)
        rough = Texture(texels, encoding=TextureEncoding("share", (1.0, 1.0, 1.0)))
        scene = replace(scene, materials=[replace(m, textures={"roughness": rough}) for m in scene.materials])
        at_once = sampled(scene)
        assert len(np.unique(at_once.level)) > 4
    monkeypatch.setattr(tiling, "TILE_SIZE", 16)
    by_window = flat(sampled(scene))
    assert len(tiling.image_tiles(SIZE)) == 12
    for name, values in flat(at_once).items():
        np.testing.assert_array_equal(by_window[name], values, err_msg=name)


@pytest.mark.parametrize(("room", "max_samples"), [(4, 8), (3, 4), (2, 2)])
def test_scenes_of_edges_use_the_available_number_of_samples(room, max_samples, monkeypatch):
    size, scene = (24, 24), tuft(4000)
    monkeypatch.setattr(view_samples, "_SAMPLES_PER_SIDE", room * size[0])
    samples = sampled(scene, size)
    count = np.bincount(samples.pixel, minlength=size[0] * size[1])
    assert 1.5 < count.mean() <= room
    assert count.max() == max_samples
    assert len(samples.pixel) <= view_samples.view_sample_limit(scene.materials, size[0] * size[1])
    np.testing.assert_allclose(weight_by_pixel(samples, slice(None), size), 1, atol=1e-6)


def disc_coverage(radius, size, yfov, distance, fine=32):
    """Coverage of each pixel by a disc facing the camera, by dense supersampling. (height, width)"""
    width, height = size
    half = np.tan(yfov / 2) * distance
    x = ((np.arange(width * fine) + 0.5) / fine / width * 2 - 1) * half * width / height
    y = (1 - (np.arange(height * fine) + 0.5) / fine / height * 2) * half
    inside = x[None] ** 2 + y[:, None] ** 2 < radius**2
    return inside.reshape(height, fine, width, fine).mean(axis=(1, 3))


def disc_samples(radius):
    """Samples of a disc that faces the camera, 2 m away."""
    turns = np.linspace(0, 2 * np.pi, 256, endpoint=False)
    rim = np.column_stack([radius * np.cos(turns), radius * np.sin(turns), 0 * turns])
    faces = [[0, k + 1, (k + 1) % 256 + 1] for k in range(256)]
    return sampled(
        make_tiny_scene(mesh("disc", [[0, 0, 0], *rim], faces, 0), camera=make_camera("c", [0, 0, 2], [0, 0, 0], 0.8))
    )


@pytest.mark.parametrize("radius", [0.31, 0.5, 0.731])
def test_the_silhouette_of_a_disc_has_the_right_coverage(radius):
    samples = disc_samples(radius)
    covered = weight_by_pixel(samples, samples.material == 0).reshape(SIZE[1], SIZE[0])
    exact = disc_coverage(radius, SIZE, 0.8, 2.0)
    error = covered - exact
    rim_pixels = (exact > 0) & (exact < 1)
    # the bound of eight positions: the discrepancy of the pattern over half-planes is 0.215
    assert np.abs(error).max() <= 0.215
    assert (np.abs(error[rim_pixels]) <= 1 / 8).mean() > 0.95
    assert np.sqrt(np.mean(error[rim_pixels] ** 2)) < 0.07
    assert abs(error.sum()) < 0.01 * exact.sum()


def test_a_sample_lies_in_the_center_of_its_part_of_the_pixel():
    """An off-center sample would shift silhouettes."""
    samples, fine = disc_samples(0.731), 32
    rim = np.nonzero((samples.material == 0) & (samples.weight < 1))[0]
    pixel_size = 2 * np.tan(0.4) * 2.0 / SIZE[1]
    corner = np.stack(np.divmod(samples.pixel[rim], SIZE[0])[::-1], axis=1)  # x, y
    within = samples.surface.points.position[rim, :2] / pixel_size * (1, -1) + np.array(SIZE) / 2 - corner
    steps = (np.arange(fine) + 0.5) / fine
    at = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    centered = (corner[:, None] + at - np.array(SIZE) / 2) * pixel_size
    inside = (np.sum(centered**2, axis=-1) < 0.731**2)[..., None]
    center = np.sum(inside * at, axis=1) / inside.sum(axis=1)
    assert len(rim) > 50
    assert np.abs(np.mean(within - center, axis=0)).max() < 0.04
    assert np.abs(within - center).mean() < 0.15


def test_positions_are_offset_toward_the_viewer():
    scene = make_tiny_scene(
        sphere("ball", [0, 0, 0], 1, 0, num_rings=40), camera=make_camera("c", [0, 0.5, 4], [0, 0, 0], 0.7)
    )
    samples, camera_position = sampled(scene), scene.cameras[0].to_world[:3, 3]
    solid = samples.material == 0
    surface = samples.surface.points
    away = np.linalg.norm(surface.position[solid].astype(float), axis=1)
    assert np.abs(away - 1).max() < 0.004  # chords of the facets
    towards = camera_position - surface.position[solid]
    facing = (surface.normal[solid] * towards).sum(axis=1) / np.linalg.norm(towards, axis=1)
    assert facing.min() > 0
    outward = surface.position[solid] / away[:, None]
    assert (surface.normal[solid] * outward).sum(axis=1).min() > np.cos(np.radians(5))


def test_frames_are_orthonormal(still_samples):
    samples = still_samples[1]
    solid = samples.material != BACKGROUND
    normal, tangent = samples.surface.points.normal[solid], samples.surface.points.tangent[solid]
    for v in (normal, tangent):
        np.testing.assert_allclose(np.linalg.norm(v, axis=1), 1, atol=1e-5)
    assert np.abs((normal * tangent).sum(axis=1)).max() < 1e-5


def test_background_samples_carry_the_environment_behind_them(still_samples):
    scene, samples = still_samples
    outside = samples.material == BACKGROUND
    whole = np.bincount(samples.pixel, minlength=SIZE[0] * SIZE[1])[samples.pixel] == 1
    rows = np.nonzero(outside & whole)[0]
    assert len(rows) > 300
    y, x = np.divmod(samples.pixel[rows].astype(int), SIZE[0])
    directions = camera_directions(scene.cameras[0], SIZE, (x + 0.5).astype(np.float32), (y + 0.5).astype(np.float32))
    half_pixel = 0.5 * 0.8 / SIZE[1]  # near an edge another position may represent the pixel
    np.testing.assert_allclose(samples.surface.points.position[rows], directions, atol=half_pixel)
    directions = samples.surface.points.position[rows]
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1, atol=1e-6)
    radiance = studio()
    u, v = direction_to_uv(directions)
    texel = radiance[(v * 32).astype(int), (u * 64).astype(int)]
    difference = np.abs(samples.surface.diffuse[rows] - texel).max(axis=1)
    slope = np.abs(np.diff(radiance, axis=0)).max() + np.abs(np.diff(radiance, axis=1)).max()
    assert difference.max() <= slope
    assert np.median(difference) < 0.05


def flat_scene(material, repeat=1.0, size=1.0):
    """A square that fills the image of a camera facing it."""
    square = quad("square", np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * size, 0)
    square.uvs[:] = square.uvs * repeat
    camera = make_camera("c", [0, 0, 2], [0, 0, 0], 2 * np.arctan(0.5))
    return make_tiny_scene(square, camera=camera, materials=[material])


def test_textures_follow_their_uv_coordinates():
    pixels = np.zeros((48, 48, 3), np.float32)
    pixels[:24, :, 0], pixels[:, 24:, 1], pixels[..., 2] = 1, 1, 0.25  # red above, green to the right
    samples = sampled(flat_scene(Material("M", WHITE, {"diffuse": Texture(pixels)})), (48, 48))
    y, x = np.divmod(samples.pixel.astype(int), 48)
    inner = (np.abs(x - 23.5) > 2) & (np.abs(y - 23.5) > 2) & (np.minimum(x, y) > 1) & (np.maximum(x, y) < 46)
    expected = np.stack([y < 24, x >= 24, np.full(len(x), 0.25)], axis=1)
    np.testing.assert_allclose(samples.surface.diffuse[inner], expected[inner], atol=1e-5)
    np.testing.assert_array_equal(samples.surface.specular[inner], 1)


def test_distant_checkers_become_gray_and_near_ones_stay():
    near = sampled(flat_scene(Material("M", WHITE, {"specular": checker(32, 4)})))
    values = near.surface.specular[near.material == 0][:, 0]
    assert ((values < 0.02) | (values > 0.98)).mean() > 0.5
    far = sampled(flat_scene(Material("M", WHITE, {"specular": checker(64, 64)}), repeat=20.0))
    gray = far.surface.specular[far.material == 0]
    assert np.abs(gray - 0.5).max() < 0.05


def test_mip_levels_preserve_the_mean_and_small_footprints_the_texels():
    pixels = np.random.default_rng(3).random((32, 32, 3), np.float32)
    pyramid = MipMap(Texture(pixels))
    for level in map(pyramid.level, range(len(pyramid.levels))):
        np.testing.assert_allclose(level.mean(axis=(0, 1)), pixels.mean(axis=(0, 1)), rtol=5e-4)  # half precision
    y, x = np.divmod(np.arange(32 * 32), 32)
    uv = np.column_stack([(x + 0.5) / 32, (y + 0.5) / 32]).astype(np.float32)
    exact = pyramid.sample(uv, np.full(1024, 1 / 32, np.float32))
    np.testing.assert_allclose(exact, pixels.reshape(-1, 3), atol=2e-5)
    everything = pyramid.sample(uv, np.full(1024, 5.0, np.float32))
    np.testing.assert_allclose(everything, np.tile(pixels.mean(axis=(0, 1)), (1024, 1)), rtol=5e-4)


@pytest.mark.parametrize(
    ("wrap", "at", "same_as"),
    [("repeat", 1.3, 0.3), ("repeat", -0.3, 0.7), ("mirror", 1.3, 0.7), ("mirror", -0.3, 0.3), ("clamp", 7.0, 0.999)],
)
def test_wrap_modes(wrap, at, same_as):
    pixels = np.random.default_rng(4).random((16, 16, 3), np.float32)
    pyramid = MipMap(Texture(pixels, (wrap, "clamp")))
    footprint = np.full(1, 1 / 16, np.float32)
    actual, expected = (pyramid.sample(np.float32([[u, 0.4]]), footprint) for u in (at, same_as))
    np.testing.assert_allclose(actual, expected, atol=1e-4)


@pytest.mark.parametrize("strength", [0.0, 0.4, 5.0])
def test_mapped_normals_are_unit_outward_and_follow_the_map(strength):
    lean = np.float32([strength, 0, 1])
    normals = np.tile(lean / np.linalg.norm(lean), (8, 8, 1)).astype(np.float32)
    samples = sampled(flat_scene(Material("M", WHITE, normal_map=Texture(normals)), size=3.0))
    normal = samples.surface.points.normal[samples.material == 0]
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1, atol=1e-5)
    assert (normal[:, 2] > 0).all()
    center = normal[np.abs(samples.pixel[samples.material == 0].astype(int) - 24 * 64 - 32) < 3]
    np.testing.assert_allclose(center, np.tile(lean / np.linalg.norm(lean), (len(center), 1)), atol=0.02)


def test_rough_normal_map_keeps_frames_unit_and_on_the_outer_side():
    rough = np.random.default_rng(5).normal(size=(16, 16, 3)).astype(np.float32)
    ball = sphere("ball", [0, 0, 0], 1, 0, num_rings=12)
    scene = make_tiny_scene(
        ball,
        camera=make_camera("c", [0, 0, 4], [0, 0, 0], 0.6),
        materials=[Material("M", WHITE, normal_map=Texture(rough))],
    )
    samples = sampled(scene)
    solid = samples.material == 0
    normal, tangent = samples.surface.points.normal[solid], samples.surface.points.tangent[solid]
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1, atol=1e-5)
    assert np.abs((normal * tangent).sum(axis=1)).max() < 1e-4
    towards = scene.cameras[0].to_world[:3, 3] - samples.surface.points.position[solid]
    assert ((normal * towards).sum(axis=1) > 0).all()


def test_mesh_without_tangents_or_coordinates_has_frames_all_the_same():
    bare = sphere("ball", [0, 0, 0], 1, 0, num_rings=8)
    bare.tangents[:], bare.uvs[:] = 0, 0
    scene = make_tiny_scene(
        bare,
        camera=make_camera("c", [0, 0, 4], [0, 0, 0], 0.6),
        materials=[Material("M", WHITE, {"diffuse": checker()}, Texture(np.tile(np.float32([0, 0, 1]), (4, 4, 1))))],
    )
    samples = sampled(scene)
    for v in (samples.surface.points.normal, samples.surface.points.tangent, samples.surface.diffuse):
        assert np.isfinite(v).all()
    np.testing.assert_allclose(np.linalg.norm(samples.surface.points.tangent, axis=1), 1, atol=1e-5)


def test_back_faces_are_shaded_with_flipped_normals():
    front = [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]
    scene = make_tiny_scene(quad("back", front[::-1], 0), camera=make_camera("c", [0, 0, 3], [0, 0, 0], 0.5))
    samples = sampled(scene)
    solid = samples.material == 0
    assert solid.sum() > 100
    assert (samples.surface.points.normal[solid][:, 2] > 0.999).all()
    assert (samples.surface.points.position[solid][:, 2] > 0).all()


def test_empty_view_is_all_background():
    scene = make_tiny_scene(
        sphere("ball", [0, 0, 0], 1, 0, num_rings=6), camera=make_camera("c", [0, 0, 4], [0, 0, 9], 0.6)
    )
    samples = sampled(scene)
    assert len(samples.pixel) == SIZE[0] * SIZE[1]
    assert (samples.material == BACKGROUND).all()
    np.testing.assert_array_equal(samples.weight, 1)
