"""An image that a look makes surfaces emit: visible, and lighting other surfaces, as if the scene's file had it."""

import copy

import numpy as np
import pytest
from PIL import Image
from session_edits import BUDGET, bake_corner_scene, make_look, relative_rmse, run_until_exact
from tiny_scenes import make_camera, make_tiny_scene, mesh, quad

from relume.brdf.texture_slots import IMAGES
from relume.core.cache import Cache
from relume.core.errors import NotFoundError, ParameterError, StoreError
from relume.images.image_store import store
from relume.live.fixed_camera.picture import Picture
from relume.live.opened.openers import open_bake
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.raytrace.emission_image import image_emitter
from relume.reference import reference_image
from relume.scene.model import Material, Texture, TextureEncoding
from relume.scene.texture_encoding import decode
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

SIZE = 40, 30
CORNERS = [[-1, 0, -1], [1, 0, -1], [1, 1, -1], [-1, 1, -1]]
UVS = [[0, 1], [1, 1], [1, 0], [0, 0]]


def fields(side=64):
    """A warm and a cool field on black, (side, side, 3) uint8"""
    pixels = np.zeros((side, side, 3), np.uint8)
    quarter = side // 4
    pixels[quarter : 2 * quarter, :quarter] = 255, 200, 150
    pixels[2 * quarter :, 2 * quarter :] = 120, 130, 140
    return pixels


@pytest.fixture(scope="module")
def images(tmp_path_factory):
    """Names of images in looks, by kind."""
    folder = tmp_path_factory.mktemp("emission")
    with IMAGES.with_search_folder(folder / "images") as library:
        names = {}
        for name, pixels in {"fields": fields(), "black": np.zeros((8, 8, 3), np.uint8)}.items():
            Image.fromarray(pixels).save(folder / f"{name}.png")
            names[name] = store(library, folder / f"{name}.png", name).texture
        yield names


@pytest.fixture(scope="module", params=["uv", "without uv"])
def scene(request):
    """A floor before a panel of two triangles."""
    floor = Material("Floor", ({"model": "lambert", "color": [0.7, 0.7, 0.7]},))
    wall = Material("Panel", ({"model": "lambert", "color": [0.1, 0.1, 0.1]},))
    ground = quad("floor", [[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]], 0)
    panel = mesh("panel", CORNERS, [[0, 1, 2], [0, 2, 3]], 1, **({"uvs": UVS} if request.param == "uv" else {}))
    camera, dark = make_camera("front", (0.2, 1.0, 2.4), (0, 0.3, -0.3), 0.8), np.full((4, 8, 3), 1e-3, np.float32)
    return make_tiny_scene(ground, panel, camera=camera, environment=dark, materials=[floor, wall])


@pytest.fixture(scope="module", params=["direct", pytest.param("gather", marks=pytest.mark.slow)])
def transfer(request, scene, tmp_path_factory):
    return bake_corner_scene(scene, request.param, tmp_path_factory.mktemp("emission"))


def emitting(image, *, intensity=20.0, **changes):
    """An edit that makes the panel emit an image."""

    def change(document):
        light = {"kind": "mesh", "material": "Panel", "image": image, "intensity": intensity, **changes}
        document["lights"]["Panel"] = light

    return change


def exact(transfer, look):
    picture = Picture(transfer, "front", Cache(BUDGET))
    picture.set_look(look)
    return run_until_exact(picture).image()


def inner_of(mask):
    """Pixels whose neighbors are in the mask, too."""
    return mask & np.roll(mask, 1, 0) & np.roll(mask, -1, 0) & np.roll(mask, 1, 1) & np.roll(mask, -1, 1)


@pytest.fixture(scope="module")
def pictures(scene, transfer, images):
    look = make_look(transfer, emitting(images["fields"]))
    bounces = 0 if transfer.indirect is None else 8
    document = copy.deepcopy(transfer.default_look)
    emitting(images["fields"])(document)
    document["transport"]["bounces"] = bounces
    reference = reference_image(scene, "front", make_look(transfer, lambda d: d.update(document)), SIZE, 2048)
    return exact(transfer, look), reference, transfer.views["front"].material_ids()


def test_the_surface_shows_the_image(pictures) -> None:
    actual, reference, ids = pictures
    inner = inner_of(ids == 1)
    assert reference[inner].max() > 10
    np.testing.assert_allclose(actual[inner], reference[inner], rtol=0.05, atol=0.01 * reference.max())


def test_it_lights_other_surfaces_from_its_bright_parts(pictures) -> None:
    actual, reference, ids = pictures
    floor = ids == 0
    assert relative_rmse(actual[floor], reference[floor]) < 0.05  # as is the noise of the reference
    np.testing.assert_allclose(actual[floor].sum(axis=0), reference[floor].sum(axis=0), rtol=0.03)


def test_intensity_is_linear_and_undo_restores_the_picture(transfer, images) -> None:
    picture = Picture(transfer, "front", Cache(BUDGET))
    before = run_until_exact(picture).image()
    picture.set_look(make_look(transfer, emitting(images["fields"], intensity=1.0)))
    once = run_until_exact(picture).image()
    picture.set_look(make_look(transfer, emitting(images["fields"], intensity=3.0)))
    thrice = run_until_exact(picture).image()
    np.testing.assert_allclose(thrice - before, 3 * (once - before), rtol=2e-2, atol=2e-3)
    picture.set_look(make_look(transfer))
    np.testing.assert_allclose(run_until_exact(picture).image(), before, rtol=1e-2, atol=1e-5)


def test_another_image_replaces_the_first(transfer, images) -> None:
    picture = Picture(transfer, "front", Cache(BUDGET))
    before = run_until_exact(picture).image()
    picture.set_look(make_look(transfer, emitting(images["fields"])))
    run_until_exact(picture)
    picture.set_look(make_look(transfer, emitting(images["black"])))
    np.testing.assert_allclose(run_until_exact(picture).image(), before, rtol=1e-2, atol=1e-5)


def test_an_image_that_does_not_exist_changes_nothing(transfer, images) -> None:
    with pytest.raises(ParameterError, match="uploaded"):
        make_look(transfer, emitting("image:0123456789abcdef"))
    picture = Picture(transfer, "front", Cache(BUDGET))
    before = run_until_exact(picture).image()
    look = make_look(transfer, emitting(images["fields"]))
    light = look.lights["Panel"].model_copy(update={"image": "image:0123456789abcdef"})
    with pytest.raises(NotFoundError):
        picture.set_look(look.model_copy(update={"lights": {"Panel": light}}))
    np.testing.assert_array_equal(run_until_exact(picture).image(), before)


def test_a_bake_without_texture_coordinates_explains_itself(transfer, images, monkeypatch) -> None:
    monkeypatch.setattr(type(transfer.store), "read", lambda self, name, *rows: _raise(name))
    with pytest.raises(StoreError, match="bake the scene again"):
        transfer.local._read_uvs()


def _raise(name):
    raise StoreError(f"no {name}")


def test_pieces_follow_the_image_and_keep_its_mean() -> None:
    texture = Texture(fields(), encoding=TextureEncoding("srgb"))
    corners, uvs = np.array(CORNERS, np.float32), np.array(UVS, np.float32)
    faces = [[0, 1, 2], [0, 2, 3]]
    emitter = image_emitter(texture, corners[faces], uvs[faces])
    pieces, relative = emitter.corners, emitter.relative_radiance(None)
    assert emitter.is_colored
    np.testing.assert_allclose(emitter.mean, decode(texture.pixels, texture.encoding).mean(axis=(0, 1)), rtol=0.02)
    areas = np.linalg.norm(np.cross(pieces[:, 1] - pieces[:, 0], pieces[:, 2] - pieces[:, 0]), axis=1) / 2
    assert areas.sum() == pytest.approx(2, rel=1e-5)
    assert areas @ relative == pytest.approx(2, rel=1e-3)
    center = pieces.mean(axis=1)
    is_dark = (np.abs(center[:, 0] - 0.5) < 0.35) & (np.abs(center[:, 1] - 0.75) < 0.15)
    assert relative[is_dark].max() < 1e-3


def test_a_free_camera_shows_the_image_and_its_light(scene, images, tmp_path) -> None:
    recipe = Recipe("probes", ("front",), SIZE, 400, num_probes=2000)
    free_bake = open_bake(bake_in_process(METHODS["probes"], scene, recipe, tmp_path / "probes.zarr"), Cache(1 << 30))
    look = make_look(free_bake, emitting(images["fields"]))
    actual, reference = render_image(free_bake, "front", look), reference_image(scene, "front", look, SIZE, 2048)
    panel = reference.max(axis=2) > 0.05 * reference.max()
    inner = inner_of(panel)
    assert inner.sum() > 20
    assert relative_rmse(actual[inner], reference[inner]) < 0.05
    floor = np.s_[20:27, 8:32]
    assert relative_rmse(actual[floor], reference[floor]) < 0.07
