"""Transformed texture coordinates give the same pictures as a bake whose scene has these coordinates."""

import copy
from dataclasses import replace

import numpy as np
import pytest
from opened_bakes import render_exact
from session_edits import relative_rmse

from relume.core.cache import Cache
from relume.core.errors import ParameterError
from relume.images.image_store import load_texture
from relume.live.opened.openers import open_bake
from relume.look import default_look, validate
from relume.math.uv_transform import UvTransform
from relume.methods.registry import METHODS
from relume.reference.image import reference_image
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

DOUBLE = {"scale": [2.0, 2.0]}
MOVED = {"scale": [1.5, -0.7], "rotation": 30.0, "offset": [0.2, -0.4]}


def shown(scene, texture, uv=None, **others):
    """The look whose floor shows a texture with a transform, and is white."""
    document = copy.deepcopy(default_look(scene.materials)) | others
    floor = document["materials"]["Floor"]
    first, *rest = floor["terms"]
    floor["terms"] = [{**first, "color": [1.0, 1.0, 1.0], "texture": texture}, *rest]
    if uv is not None:
        floor["uv"] = uv
    return validate(document, default_look(scene.materials))


def transformed(scene, uv):
    """The scene whose floor has the transformed coordinates in its file; with the same id, a seed."""
    offset, rotation = tuple(uv.get("offset", (0.0, 0.0))), np.radians(uv.get("rotation", 0.0))
    transform = UvTransform(offset, rotation, tuple(uv["scale"]))
    meshes = [replace(m, uvs=transform.points(m.uvs)) if m.material == 0 else m for m in scene.meshes]
    return replace(scene, meshes=tuple(meshes))


def with_own(scene, texture):
    floor, *others = scene.materials
    return replace(scene, materials=(replace(floor, textures={"diffuse": texture}), *others))


@pytest.fixture(scope="module", params=["direct", "gather", "probes"])
def method(request):
    return request.param


@pytest.fixture(scope="module")
def scene(corner, named):
    """The corner whose floor has the image as its own texture, and coordinates that are not along its edges."""
    scene = with_own(corner, load_texture(named))
    axes = np.array([[0.5, 0.1], [0.0, 0.0], [-0.1, 0.6]], np.float32)
    meshes = [replace(m, uvs=m.positions @ axes) if m.material == 0 else m for m in scene.meshes]
    return replace(scene, meshes=tuple(meshes))


def bake(scene, method, folder):
    """A bake by a new method, since methods remember the triangles of an id."""
    options = {"num_probes": 300} if method == "probes" else {}
    recipe = Recipe(method, ("front",), (24, 18), 60, **options)
    return open_bake(bake_in_process(type(METHODS[method])(), scene, recipe, folder), Cache(1 << 30))


@pytest.fixture(scope="module")
def bakes(method, scene, tmp_path_factory):
    """The scene, and that with either transform in its file."""
    folder = tmp_path_factory.mktemp("transforms")
    scenes = {"plain": scene, "double": transformed(scene, DOUBLE), "moved": transformed(scene, MOVED)}
    return {name: bake(each, method, folder / name) for name, each in scenes.items()}


def tolerance(method, texture):
    """Bakes store the scene's textures in half precision."""
    return 2e-6 if method != "probes" and texture != "diffuse" else 1e-3


@pytest.mark.parametrize("own", [False, True], ids=["image", "own"])
@pytest.mark.parametrize(("name", "uv"), [("double", DOUBLE), ("moved", MOVED)])
def test_pictures_equal_those_of_transformed_coordinates(bakes, method, scene, named, own, name, uv):
    texture = "diffuse" if own else named
    actual = render_exact(bakes["plain"], shown(scene, texture, uv), method)
    expected = render_exact(bakes[name], shown(scene, texture), method)
    assert relative_rmse(render_exact(bakes["plain"], shown(scene, texture), method), expected) > 0.05
    assert relative_rmse(actual, expected) < tolerance(method, texture)


@pytest.mark.parametrize("own", [False, True], ids=["image", "own"])
def test_indirect_light_follows_the_transform(bakes, method, scene, named, own):
    if method == "direct":
        pytest.skip("no indirect light")
    texture = "diffuse" if own else named
    indirect = {"transport": {"show": "indirect"}}
    actual = render_exact(bakes["plain"], shown(scene, texture, MOVED, **indirect), method)
    expected = render_exact(bakes["moved"], shown(scene, texture, **indirect), method)
    assert relative_rmse(render_exact(bakes["plain"], shown(scene, texture, **indirect), method), expected) > 0.02
    assert relative_rmse(actual, expected) < tolerance(method, texture)


def test_the_identity_changes_nothing(bakes, method, scene):
    look = shown(scene, "diffuse", {"scale": [1, 1], "rotation": 0, "offset": [0, 0]})
    assert look == shown(scene, "diffuse")
    before = render_exact(bakes["plain"], shown(scene, "diffuse"), method)
    render_exact(bakes["plain"], shown(scene, "diffuse", MOVED), method)
    np.testing.assert_array_equal(render_exact(bakes["plain"], look, method), before)


@pytest.mark.parametrize("own", [False, True], ids=["image", "own"])
def test_references_show_the_transform(scene, named, own):
    texture = "diffuse" if own else named
    actual, expected = (
        reference_image(each, "front", shown(each, texture, uv), (20, 16), 16, reflects=True)
        for each, uv in ((scene, MOVED), (transformed(scene, MOVED), None))
    )
    np.testing.assert_allclose(actual, expected, rtol=1e-5)


@pytest.mark.parametrize(
    ("uv", "message"),
    [
        ({"scale": [0, 1]}, r"/materials/Floor/uv/scale/0 is 0; give a number from 0\.001 to 1000, or a negative"),
        ({"scale": [1, 1e9]}, r"uv/scale/1 is 1000000000\.0"),
        ({"scale": [1, float("nan")]}, "uv/scale/1 is nan"),
        ({"scale": 2}, r"uv/scale is 2; give two numbers, of u and v"),
        ({"scale": [1, True]}, "uv/scale/1 is True"),
        ({"rotation": 400}, r"uv/rotation is 400; give a number in \[-360, 360\]"),
        ({"rotation": None}, "uv/rotation is null"),
        ({"offset": [0, float("inf")]}, "uv/offset/1 is inf"),
        ({"offset": [0, 0, 0]}, "uv/offset is a list of 3 entries; give two numbers"),
        ({"tiling": 2}, "uv/tiling is unknown"),
        ([2, 2], "uv is a list"),
    ],
)
def test_invalid_transforms_are_refused(scene, uv, message):
    with pytest.raises(ParameterError, match=message):
        shown(scene, "diffuse", uv)
