"""An image of a look gives the same pictures as a bake whose scene has it: fixed, free camera, reference."""

import copy
from dataclasses import replace

import numpy as np
import pytest
from opened_bakes import open_small_bake, render_exact
from session_edits import relative_rmse
from tiny_scenes import make_tiny_scene, mesh

from relume.core.errors import ParameterError
from relume.images.image_store import load_texture
from relume.live.free_camera.free_camera_picture import FreeCameraPicture
from relume.live.free_camera.texture_overrides import ProbeMapOverrides, overridden_textures
from relume.look import default_look, validate
from relume.raytrace.camera_rays import trace_rays
from relume.raytrace.scene_buffers import build_scene_buffers
from relume.raytrace.surface_interaction import surface_at
from relume.reference.image import reference_image
from relume.scene.texture_encoding import decode


def painted(scene, texture, **terms):
    """The look in which the scene's floor shows a texture and its color is white. terms: of other materials"""
    document = copy.deepcopy(default_look(scene.materials))
    document["materials"].update({name: {"terms": of_material} for name, of_material in terms.items()})
    first, *others = document["materials"]["Floor"]["terms"]
    document["materials"]["Floor"]["terms"] = [{**first, "color": [1.0, 1.0, 1.0], "texture": texture}, *others]
    return validate(document, default_look(scene.materials))


def with_own(scene, texture):
    """The scene whose floor has the texture in its file; with the same id, which seeds random numbers."""
    floor, *others = scene.materials
    return replace(scene, materials=(replace(floor, textures={"diffuse": texture}), *others))


@pytest.fixture(scope="module", params=["gather", "probes"])
def bakes(request, corner, named, tmp_path_factory):
    """The corner, and the corner whose floor has the image: each with its method."""
    folder = tmp_path_factory.mktemp("images")
    scenes = corner, with_own(corner, load_texture(named))
    return (
        request.param,
        scenes,
        [open_small_bake(scene, request.param, folder / str(k)) for k, scene in enumerate(scenes)],
    )


def test_pictures_equal_those_of_a_scene_with_the_image(bakes, named):
    """Free cameras store the scene's textures in half precision; those of looks are not."""
    method, (plain, own), (bare, baked) = bakes
    actual, expected = (
        render_exact(bare, painted(plain, named), method),
        render_exact(baked, painted(own, "diffuse"), method),
    )
    assert relative_rmse(render_exact(bare, painted(plain, None), method), expected) > 0.1
    assert relative_rmse(actual, expected) < (1e-3 if method == "probes" else 1e-6)


def test_polished_surfaces_reflect_the_image(bakes, named):
    """The back wall is chrome, and shows the floor: textures of bakes are stored in half precision."""
    method, (plain, own), (bare, baked) = bakes
    chrome = [{"model": "ggx", "color": [1.0] * 3, "params": {"roughness": 0.02, "f0": 0.9}}]
    actual = render_exact(bare, painted(plain, named, Blue=chrome), method)
    expected = render_exact(baked, painted(own, "diffuse", Blue=chrome), method)
    assert relative_rmse(actual, expected) < 1e-3
    assert relative_rmse(render_exact(bare, painted(plain, None, Blue=chrome), method), expected) > 0.1


def test_removing_the_image_restores_the_picture(bakes, named):
    method, (plain, _), (bare, _) = bakes
    before = render_exact(bare, painted(plain, None), method)
    render_exact(bare, painted(plain, named), method)
    np.testing.assert_array_equal(render_exact(bare, painted(plain, None), method), before)


def test_indirect_light_follows_the_image(bakes, named):
    """With only indirect light, walls show the image of the floor: patches have its colors."""
    method, (plain, own), (bare, baked) = bakes

    def reflected(scene, texture):
        look = painted(scene, texture)
        return look.model_copy(update={"transport": look.transport.model_copy(update={"show": "indirect"})})

    actual = render_exact(bare, reflected(plain, named), method)
    expected = render_exact(baked, reflected(own, "diffuse"), method)
    assert relative_rmse(actual, expected) < (1e-3 if method == "probes" else 1e-6)
    assert relative_rmse(render_exact(bare, reflected(plain, None), method), expected) > 0.1


def test_references_show_the_image(corner, named):
    own = with_own(corner, load_texture(named))
    actual, expected = (
        reference_image(scene, "front", painted(scene, texture), (20, 16), 16, reflects=True)
        for scene, texture in ((corner, named), (own, "diffuse"))
    )
    np.testing.assert_allclose(actual, expected, rtol=1e-5)


def test_terms_of_one_channel_share_it(corner, named):
    document = copy.deepcopy(default_look(corner.materials))
    first, *others = document["materials"]["Floor"]["terms"]
    document["materials"]["Floor"]["terms"] = [{**first, "texture": named}, {**first, "texture": "diffuse"}, *others]
    with pytest.raises(ParameterError, match=r"terms/1/texture.*change them together"):
        validate(document, default_look(corner.materials))


@pytest.mark.parametrize("texture", ["image:0000000000000000", "image:../x", "image:", 3, "albedo"])
def test_a_missing_image_is_no_texture(corner, texture):
    document = copy.deepcopy(default_look(corner.materials))
    document["materials"]["Floor"]["terms"][0]["texture"] = texture
    with pytest.raises(ParameterError, match=r"terms/0/texture.*image that was uploaded"):
        validate(document, default_look(corner.materials))


def test_free_cameras_use_the_triplanar_mapping_of_fixed_views(corner, named, tmp_path):
    """Rays hit every face of a box without UV coordinates: both give the same positions in the image."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))]
    box = mesh("box", corners, faces, 0, normals=corners / np.sqrt(3))
    scene = make_tiny_scene(box, camera=corner.cameras[0], materials=corner.materials[:1])
    free_bake = open_small_bake(scene, "probes", tmp_path)
    actual = overridden_textures(free_bake.stored_scene, free_bake.positions, (ProbeMapOverrides((named, None)),))
    camera_positions = np.random.default_rng(2).normal(size=(60, 3)).astype(np.float32)
    directions = -camera_positions / np.linalg.norm(camera_positions, axis=1, keepdims=True)
    geometry = build_scene_buffers(scene)
    hits = trace_rays(geometry.embree, -4 * directions, directions)
    assert len(set(hits.face // 2)) == 6
    fraction = np.column_stack([1 - hits.uv.sum(axis=1), hits.uv])
    places = np.einsum("nk,nkc->nc", fraction, actual.uvs[actual.uv_faces[hits.face]])
    expected = surface_at(geometry, hits, directions, scene.materials, 1e-3).uv
    np.testing.assert_allclose(places, expected[:, :2], atol=1e-3)
    assert (actual.uv_scale[hits.face] == 1).all()


def test_the_browser_gets_the_image_when_a_look_uses_it(bakes, named):
    """The row of the floor names a texture whose finest level is the image, after the textures of the bake."""
    method, (plain, _), (bare, _) = bakes
    if method != "probes":
        pytest.skip("fixed views have no shader")
    picture = FreeCameraPicture(bare, "front")
    picture.set_look(painted(plain, None))
    picture.advance(None)
    assert "images" not in picture.array_blocks()[0]
    picture.set_look(painted(plain, named))
    picture.advance(None)
    parts, _ = picture.array_blocks()
    arrays, rows = parts["images"].make(), parts["materials"].make()["materials"].reshape(len(plain.materials), -1, 4)
    number, num_levels, *wraps = arrays["levels"][rows[0, 1, 3]]
    first, height, width, _ = arrays["levels"][number]
    texture = load_texture(named)
    assert (height, width, num_levels, wraps) == (32, 32, 6, [0, 0])
    expected = decode(texture.pixels, texture.encoding).reshape(-1, 3)
    np.testing.assert_allclose(arrays["texels"][first : first + height * width, :3], expected, rtol=1e-3)
    assert len(arrays["uvs"]) == 2 * len(bare.stored_scene.uvs)
