"""An image as a normal map gives the same pictures as a bake whose scene has that map."""

import copy
from dataclasses import replace

import numpy as np
import pytest
from opened_bakes import open_small_bake, render_exact
from PIL import Image
from session_edits import bake_corner_scene, relative_rmse, run_until_exact
from tiny_scenes import corner

from relume.brdf.texture_slots import IMAGES, NormalMap
from relume.camera.view_samples import sample_view
from relume.core.cache import Cache
from relume.core.errors import CancelledError, ParameterError, StoreError
from relume.images.image_store import load_normal_map, store
from relume.live.fixed_camera.picture import Picture
from relume.live.free_camera.texture_overrides import NO_OVERRIDES, ProbeMapOverrides, overridden_textures
from relume.live.opened.retrace import NormalRetracer
from relume.look import default_look, validate
from relume.methods.gather import RAYS_PER_SAMPLE
from relume.raytrace.scene_buffers import build_scene_buffers
from relume.reference.image import reference_image
from relume.reference.textures import with_overrides
from relume.scene.model import Material, Texture, TextureEncoding
from relume.scene.tangents import compute_tangents
from relume.scene.texture_encoding import decode
from relume.views import map_override_store

SIDE = 64
SCALE = 1.5


def waves(side=SIDE, slope=0.4, seed=0):
    """Normals of a wavy ground, with finer waves below the pixel size. (side, side, 3) uint8"""
    y, x = 2 * np.pi * np.mgrid[0:side, 0:side] / side
    fine = np.random.default_rng(seed).normal(0, 0.1, (side, side, 2))
    slopes = np.stack([slope * np.sin(3 * x + y), slope * np.cos(2 * y - x)], axis=-1) + fine
    normals = np.concatenate([slopes, np.ones((side, side, 1))], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    return np.round(127.5 * (normals + 1)).astype(np.uint8)


@pytest.fixture(scope="module")
def named(tmp_path_factory):
    folder = tmp_path_factory.mktemp("normals")
    Image.fromarray(waves()).save(folder / "waves.png")
    with IMAGES.with_search_folder(folder / "images") as library:
        yield store(library, folder / "waves.png", "Waves").texture


def with_tangents(scene):
    """Tangents along u, as from imports of materials with a normal map."""
    meshes = [replace(m, tangents=compute_tangents(m.positions, m.normals, m.uvs, m.faces)) for m in scene.meshes]
    return replace(scene, meshes=tuple(meshes))


@pytest.fixture(scope="module", params=["flat", pytest.param("bumpy", marks=pytest.mark.slow)])
def plain(request):
    """A glossy floor, a ball and a wall; the parameter: with normal maps in the scene."""
    shiny = {"model": "ggx", "texture": None, "params": {"roughness": 0.4, "f0": 0.5}, "roughness_map": "roughness"}
    floor = {"model": "lambert", "color": [0.2, 0.3, 0.2]}, shiny
    wall = {**floor[0], "color": [0.8, 0.5, 0.2]}, shiny
    own = (
        Texture(waves(seed=1, slope=0.3)[::-1].copy(), encoding=TextureEncoding("normal"))
        if request.param == "bumpy"
        else None
    )
    return with_tangents(corner([Material("Floor", floor, {}, own), Material("Wall", wall)]))


def with_own(scene, name, scale=SCALE):
    """The scene whose floor has the map in its file; with the same id, which seeds random numbers."""
    floor, *others = scene.materials
    return replace(scene, materials=(replace(floor, normal_map=load_normal_map(NormalMap(name, scale))), *others))


@pytest.fixture(scope="module", params=["direct", pytest.param("gather", marks=pytest.mark.slow)])
def bakes(request, plain, named, tmp_path_factory):
    folder = tmp_path_factory.mktemp("bakes")
    scenes = plain, with_own(plain, named)
    return [bake_corner_scene(scene, request.param, folder / str(k)) for k, scene in enumerate(scenes)]


def normal_mapped(scene, name, scale=SCALE, **others):
    """The look whose floor has an image as its normal map; None: the scene's own."""
    document = copy.deepcopy(default_look(scene.materials))
    if name is not None:
        document["materials"]["Floor"]["normal_map"] = {"image": name, "scale": scale}
    return validate(document | others, default_look(scene.materials))


def test_pictures_equal_those_of_a_scene_with_the_normal_map(bakes, plain, named):
    """Also in a rotated environment. Triangles of the coarse ball have one tangent each, vertices an interpolated one;
    patch points see other importons.
    """
    bare, baked = bakes
    max_error, usual = (0.015, 1e-6) if bare.method == "direct" else (0.015, 0.003)
    for others in ({}, {"environment": {"map": None, "rotation": 40.0}}):
        actual = render_exact(bare, normal_mapped(plain, named, **others), bare.method)
        expected = render_exact(baked, normal_mapped(plain, None, **others), bare.method)
        assert relative_rmse(actual, expected) < max_error
        assert np.median(np.abs(actual - expected) / expected) < usual
        assert relative_rmse(render_exact(bare, normal_mapped(plain, None, **others), bare.method), expected) > 0.4


@pytest.mark.slow
@pytest.mark.parametrize("bakes", ["gather"], indirect=True)
def test_indirect_light_uses_the_mapped_normals(bakes, plain, named):
    """With the normals of the bake it would be 27 % off."""
    bare, baked = bakes
    reflected = {"transport": {"show": "indirect"}}
    actual = render_exact(bare, normal_mapped(plain, named, **reflected), bare.method)
    expected = render_exact(baked, normal_mapped(plain, None, **reflected), bare.method)
    assert relative_rmse(actual, expected) < 0.05
    assert np.median(np.abs(actual - expected)) < 0.01 * expected.mean()


@pytest.mark.slow
@pytest.mark.parametrize("bakes", ["gather"], indirect=True)
def test_tracing_of_gather_rays_is_cancelled_and_resumed(bakes, plain, named, monkeypatch):
    """If an edit arrives during tracing; traced rays are not traced again."""
    bare, _ = bakes
    monkeypatch.setattr(map_override_store, "_SAMPLES_PER_STEP", 64)
    linked, traced = NormalRetracer.gather_hits, []

    def counted(self, points, wo, pattern):
        traced.extend(points.seed.tolist() if pattern.num_rays == RAYS_PER_SAMPLE else ())  # others are of patches
        return linked(self, points, wo, pattern)

    monkeypatch.setattr(NormalRetracer, "gather_hits", counted)
    picture = Picture(bare, "front", Cache(1 << 28))
    picture.set_look(normal_mapped(plain, named, 1.25))
    images = picture._images
    floor, light = images.by_name["Floor"], images.light
    with pytest.raises(CancelledError):
        images.incident_light(floor, light, lambda: len(traced) >= 128)
    assert 128 <= len(traced) < 0.5 * floor.num_samples
    images.incident_light(floor, light, lambda: False)
    assert sorted(traced) == sorted(images.view.surface_points(0).seed.tolist())


def test_lights_above_the_mapped_horizon_are_traced(bakes, plain, named):
    """And lights below it are hidden: bits equal those of the bake on the floor, where the frames are equal."""
    bare, baked = bakes
    picture = Picture(bare, "front", bare.cache)
    picture.set_look(normal_mapped(plain, named))
    view, expected, before = picture._images.view, baked.views["front"], bare.views["front"]
    (rows, actual), (their_rows, theirs), (_, old) = (_floor_of(each) for each in (view, expected, before))
    np.testing.assert_array_equal(rows, their_rows)
    assert np.count_nonzero(np.unpackbits(actual ^ theirs)) < 2e-3 * np.count_nonzero(np.unpackbits(theirs))
    assert np.count_nonzero(np.unpackbits(old ^ theirs)) > 0.03 * np.count_nonzero(np.unpackbits(theirs))


def _floor_of(view):
    """Positions of the floor's samples, in an order that views share, and the bits of each. (n, 3), (n, bytes)"""
    position = view.surface_points(0).position
    rows = np.flatnonzero(position[:, 1] < 1e-3)
    rows = rows[np.lexsort(position[rows].T)]
    return position[rows], view._read_visibility(0)[rows]


def test_normals_and_roughness_levels_equal_the_bake(bakes, plain, named):
    bare, baked = bakes
    picture = Picture(bare, "front", bare.cache)
    picture.set_look(normal_mapped(plain, named))
    view, expected = picture._images.view, baked.views["front"]
    np.testing.assert_allclose(view.level_pairs[0], expected.level_pairs[0], rtol=1e-5)
    assert np.mean(view.level == expected.level) > 0.95
    assert len(np.unique(view.level)) > 8
    (rows, actual), (their_rows, theirs) = (_normals_of(each) for each in (view, expected))
    np.testing.assert_array_equal(rows, their_rows)
    np.testing.assert_allclose(actual[rows[:, 1] < 1e-3], theirs[rows[:, 1] < 1e-3], atol=1e-4)
    np.testing.assert_allclose(actual, theirs, atol=0.12)  # on the ball, see above


def _normals_of(view):
    points = view.surface_points(0)
    rows = np.lexsort(points.position.T)
    return points.position[rows], points.normal[rows]


def test_removing_the_normal_map_restores_the_picture(bakes, plain, named):
    bare, _ = bakes
    picture = Picture(bare, "front", bare.cache)
    images = []
    for name in (None, named, None, named):
        picture.set_look(normal_mapped(plain, name))
        images.append(run_until_exact(picture).image())
    np.testing.assert_array_equal(images[2], images[0])
    np.testing.assert_array_equal(images[3], images[1])


def test_a_scale_of_zero_is_a_flat_surface(bakes, plain, named):
    """Regardless of the scene's own normal map."""
    bare, _ = bakes
    picture = Picture(bare, "front", bare.cache)
    picture.set_look(normal_mapped(plain, named, 0.0))
    positions, normals = _normals_of(picture._images.view)
    on_floor = positions[:, 1] < 1e-3
    np.testing.assert_allclose(normals[on_floor], np.broadcast_to([0, 1, 0], normals[on_floor].shape), atol=1e-6)


@pytest.mark.parametrize("method", ["direct", pytest.param("gather", marks=pytest.mark.slow)])
def test_mirror_images_use_the_mapped_normals(named, method, tmp_path):
    """A floor and a ball before a mirror: the pixels of the mirror."""
    chrome = {"model": "ggx", "texture": None, "color": [0.9, 0.9, 0.9], "params": {"roughness": 0.03, "f0": 1.0}}
    shiny = {"model": "ggx", "texture": None, "params": {"roughness": 0.4, "f0": 0.5}, "roughness_map": "roughness"}
    scene = with_tangents(corner([Material("Floor", (shiny,)), Material("Wall", (chrome,))]))
    # Patches and gather rays of the bakes differ: with 610 rays by 0.006 to 0.015 over twelve seeds, with 4096 by 0.003
    # to 0.008 over eight; with more patches by as much.
    rays = 4096 if method == "gather" else None
    bare, baked = (
        open_small_bake(s, method, tmp_path / str(k), gather_rays=rays)
        for k, s in enumerate((scene, with_own(scene, named)))
    )
    in_mirror = bare.views["front"].material_ids() == 1
    actual, plain, expected = (
        render_exact(transfer, normal_mapped(scene, name), method)[in_mirror]
        for transfer, name in ((bare, named), (bare, None), (baked, None))
    )
    assert relative_rmse(actual, expected) < 0.01
    assert relative_rmse(plain, expected) > 0.4


def test_references_show_the_normal_map(plain, named):
    actual, expected = (
        reference_image(scene, "front", normal_mapped(scene, name), (16, 16), 0)
        for scene, name in ((plain, named), (with_own(plain, named), None))
    )
    np.testing.assert_allclose(actual, expected, rtol=1e-5)
    assert relative_rmse(reference_image(plain, "front", normal_mapped(plain, None), (16, 16), 0), expected) > 0.3


@pytest.mark.slow
def test_free_cameras_show_the_normal_map(plain, named, tmp_path):
    """With direct light, and with all light. The latter has other rays in both bakes: the median of three seeds."""
    errors = {"direct": [], "all": []}
    for seed in range(3):
        scene = replace(plain, id=f"{seed:016x}")  # seeds random numbers
        bare, baked = (
            open_small_bake(s, "probes", tmp_path / f"{seed}-{k}")
            for k, s in enumerate((scene, with_own(scene, named)))
        )
        for show, of_seeds in errors.items():
            light = {"transport": {"show": show}}
            actual, expected = (
                render_exact(transfer, normal_mapped(plain, name, **light), "probes")
                for transfer, name in ((bare, named), (baked, None))
            )
            of_seeds.append(relative_rmse(actual, expected))
            assert relative_rmse(render_exact(bare, normal_mapped(plain, None, **light), "probes"), expected) > 0.3
    assert max(errors["direct"]) < 2e-3
    assert np.median(errors["all"]) < 0.015


@pytest.mark.slow
def test_meshes_without_tangents_get_the_tangents_of_imports(named, tmp_path):
    scene = corner([Material("Floor", ({"model": "lambert"},)), Material("Wall", ({"model": "lambert"},))])
    none = replace(scene, meshes=tuple(replace(m, tangents=0 * m.tangents) for m in scene.meshes))
    free_bake = open_small_bake(none, "probes", tmp_path)
    assert len(free_bake.stored_scene.tangents) == 0
    actual = overridden_textures(
        free_bake.stored_scene, free_bake.positions, (ProbeMapOverrides(normals=NormalMap(named)), NO_OVERRIDES)
    ).tangents
    expected = np.concatenate([mesh.tangents for mesh in with_tangents(scene).meshes])
    normals = np.concatenate([mesh.normals for mesh in scene.meshes])
    across = actual[:, :3] - normals * np.einsum("nc,nc->n", actual[:, :3], normals)[:, None]
    of_floor = slice(0, 4)
    np.testing.assert_allclose(across[of_floor], expected[of_floor, :3], atol=1e-6)
    assert not actual[4:8].any()  # the wall shows no image
    of_ball = np.linalg.norm(expected[:, :3], axis=1) > 0
    of_ball[:8] = False
    length = np.linalg.norm(across[of_ball], axis=1, keepdims=True)
    assert np.einsum("nc,nc->n", across[of_ball] / length, expected[of_ball, :3]).min() > 0.999
    np.testing.assert_array_equal(actual[of_ball, 3], expected[of_ball, 3])


@pytest.mark.parametrize(
    ("given", "where"),
    [
        ({"image": "image:0000000000000000"}, "image"),
        ({"image": "image:../x"}, "image"),
        ({"image": "diffuse"}, "image"),
        ({}, "image"),
        ("NAME", "normal_map"),
        ([1], "normal_map"),
        ({"image": "NAME", "turn": 1}, "turn"),
        ({"image": "NAME", "scale": -0.1}, "scale"),
        ({"image": "NAME", "scale": 10.5}, "scale"),
        ({"image": "NAME", "scale": float("nan")}, "scale"),
        ({"image": "NAME", "scale": "1"}, "scale"),
    ],
)
def test_invalid_normal_maps_are_rejected(given, where, named):
    scene = corner([Material("Floor", ({"model": "lambert"},)), Material("Wall", ({"model": "lambert"},))])
    document = copy.deepcopy(default_look(scene.materials))
    named_here = (
        {key: named if value == "NAME" else value for key, value in given.items()} if isinstance(given, dict) else given
    )
    document["materials"]["Floor"]["normal_map"] = named if given == "NAME" else named_here
    with pytest.raises(ParameterError, match=rf"/materials/Floor.*{where}"):
        validate(document, default_look(scene.materials))


def test_no_normal_map_has_strength_one(named):
    scene = corner([Material("Floor", ({"model": "lambert"},)), Material("Wall", ({"model": "lambert"},))])
    default = default_look(scene.materials)
    assert validate({"materials": {"Floor": {"normal_map": None}}}, default) == validate({}, default)
    look = validate({"materials": {"Floor": {"normal_map": {"image": named}}}}, default)
    assert look.materials["Floor"].normals == NormalMap(named, 1.0)


def test_a_normal_map_is_listed_with_its_values(named):
    texture = load_normal_map(NormalMap(named, 2.0))
    values, plain = decode(texture.pixels, texture.encoding), waves() / 127.5 - 1
    np.testing.assert_array_equal(texture.pixels, waves())
    np.testing.assert_allclose(np.linalg.norm(values, axis=-1), 1, rtol=1e-5)
    np.testing.assert_allclose(values[..., 0] / values[..., 2], 2 * plain[..., 0] / plain[..., 2], rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("pixel", [(0, 0, 0), (127, 127, 127), (128, 128, 255), (255, 255, 0)])
def test_images_without_normals_give_finite_pictures(pixel, tmp_path, named):
    """Black, gray, and normals that point into the surface."""
    scene = with_tangents(
        corner([Material("Floor", ({"model": "lambert"},)), Material("Wall", ({"model": "lambert"},))])
    )
    bare = bake_corner_scene(scene, "direct", tmp_path)
    Image.fromarray(np.full((1, 1, 3), pixel, np.uint8)).save(tmp_path / "x.png")
    with IMAGES.with_search_folder(tmp_path / "images") as library:
        record = store(library, tmp_path / "x.png", "x")
        assert np.isfinite(render_exact(bare, normal_mapped(scene, record.texture, 10.0), "direct")).all()


class Older:
    """An older store: some arrays and attributes are missing."""

    def __init__(self, store, arrays=(), attributes=()):
        self._store, self._arrays = store, arrays
        self.attributes = {name: value for name, value in store.attributes.items() if name not in attributes}

    def shape(self, path):
        return self._store.shape(path)

    def read(self, path, start=0, stop=None):
        if path.endswith(self._arrays):
            raise StoreError(f"there is no {path}")
        return self._store.read(path, start, stop)


def test_older_bakes_show_normal_maps_where_possible(bakes, plain, named):
    """Without normal maps of the scene and without gather rays; otherwise the error says what to do."""
    bare, _ = bakes
    older = Older(bare.store, ("scene/face_mesh", "surface_normal"))
    view = replace(bare.views["front"], store=older, overridden={})
    transfer = replace(bare, store=older, views={"front": view})
    picture = Picture(transfer, "front", bare.cache)
    before = run_until_exact(picture).image()
    if bare.method == "direct" and plain.materials[0].normal_map is None:
        picture.set_look(normal_mapped(plain, named))
        assert relative_rmse(run_until_exact(picture).image(), before) > 0.1
        return
    with pytest.raises(StoreError, match=r"too old.*bake the scene again"):
        picture.set_look(normal_mapped(plain, named))
    np.testing.assert_array_equal(run_until_exact(picture).image(), before)


def test_bakes_without_normal_mapping_data_are_rejected(bakes, plain, named):
    bare, _ = bakes
    view = replace(bare.views["front"], store=Older(bare.store, (), ("shortest_normals",)), overridden={})
    with pytest.raises(StoreError, match="bake the scene again"):
        Picture(replace(bare, views={"front": view}), "front", bare.cache).set_look(normal_mapped(plain, named))


def test_surfaces_without_uv_coordinates_are_normal_mapped(tmp_path):
    """In pictures and references alike, whose pixels have other footprints: an image with one normal everywhere."""
    Image.fromarray(np.full((4, 4, 3), (176, 100, 240), np.uint8)).save(tmp_path / "slope.png")
    with IMAGES.with_search_folder(tmp_path / "images") as library:
        _apply_triplanar_map(store(library, tmp_path / "slope.png", "Slope").texture, tmp_path)


def _apply_triplanar_map(named, tmp_path):
    scene = corner([Material("Floor", ({"model": "lambert"},)), Material("Wall", ({"model": "lambert"},))])
    bare = replace(scene, meshes=tuple(replace(m, uvs=0 * m.uvs, tangents=0 * m.tangents) for m in scene.meshes[:2]))
    transfer = bake_corner_scene(replace(bare, id="0" * len(bare.id)), "direct", tmp_path)
    look = normal_mapped(bare, named)
    picture = Picture(transfer, "front", transfer.cache)
    picture.set_look(look)
    positions, normals = _normals_of(picture._images.view)
    reference_scene = with_overrides(bare, look)
    samples = sample_view(reference_scene, build_scene_buffers(reference_scene), "front", (40, 30))
    points, rows = samples.surface.points, np.flatnonzero(samples.material == 0)
    rows = rows[np.lexsort(points.position[rows].T)]
    np.testing.assert_allclose(positions, points.position[rows], atol=1e-6)
    np.testing.assert_allclose(normals, points.normal[rows], atol=1e-4)
    assert np.all(normals[:, 0] > 0.3)
    assert np.all(normals[:, 2] > 0.1)  # green below one half tilts down the image, toward the viewer here
