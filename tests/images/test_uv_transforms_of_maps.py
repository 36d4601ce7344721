"""Transforms of the scene's own normal and roughness maps: as bakes whose scenes have the transformed coordinates."""

import copy
from dataclasses import replace

import numpy as np
import pytest
from opened_bakes import render_exact
from session_edits import relative_rmse
from test_normal_map_overrides import waves
from test_uv_transforms import MOVED, bake, transformed

from relume.look import default_look, validate
from relume.reference.image import reference_image
from relume.scene.model import Material, Texture, TextureEncoding
from relume.scene.tangents import compute_tangents


def with_tangents(scene):
    meshes = [replace(m, tangents=compute_tangents(m.positions, m.normals, m.uvs, m.faces)) for m in scene.meshes]
    return replace(scene, meshes=tuple(meshes))


@pytest.fixture(scope="module")
def scene(corner):
    """The corner with waves on its floor, of a roughness that varies."""
    shiny = {"model": "ggx", "params": {"roughness": 0.4, "f0": 0.5}, "roughness_map": "roughness"}
    steps = np.repeat(np.linspace(60, 250, 8).astype(np.uint8), 4)
    mean = 255 / float(steps.mean())
    roughness = Texture(np.tile(steps[:, None, None], (1, 32, 1)), encoding=TextureEncoding("share", (mean,) * 3))
    normals = Texture(waves(), encoding=TextureEncoding("normal"))
    terms = {"model": "lambert", "color": [0.2, 0.3, 0.2]}, shiny
    floor = Material("Floor", terms, {"roughness": roughness}, normals)
    axes = np.array([[0.5, 0.1], [0.0, 0.0], [-0.1, 0.5]], np.float32)
    meshes = [replace(m, uvs=m.positions @ axes) if m.material == 0 else m for m in corner.meshes]
    return with_tangents(replace(corner, meshes=tuple(meshes), materials=(floor, *corner.materials[1:])))


def moved_look(scene):
    document = copy.deepcopy(default_look(scene.materials))
    document["materials"]["Floor"]["uv"] = MOVED
    return validate(document, default_look(scene.materials))


@pytest.mark.parametrize("method", ["direct", "gather", "probes"])
def test_pictures_equal_those_of_transformed_coordinates(scene, method, tmp_path):
    """Tangents of the other scene follow its coordinates. Probes store tangents in half precision and lack maps of
    roughness; patches get other importons.
    """
    plain = validate({}, default_look(scene.materials))
    bare = bake(scene, method, tmp_path / "bare")
    expected = render_exact(bake(with_tangents(transformed(scene, MOVED)), method, tmp_path / "moved"), plain, method)
    assert relative_rmse(render_exact(bare, plain, method), expected) > 0.1
    assert relative_rmse(render_exact(bare, moved_look(scene), method), expected) < 0.01


def test_references_show_the_transform(scene):
    plain, other = validate({}, default_look(scene.materials)), with_tangents(transformed(scene, MOVED))
    actual = reference_image(scene, "front", moved_look(scene), (20, 16), 64, reflects=False)
    expected = reference_image(other, "front", plain, (20, 16), 64, reflects=False)
    before = reference_image(scene, "front", plain, (20, 16), 64, reflects=False)
    assert relative_rmse(actual, expected) < 0.05 < 0.1 < relative_rmse(before, expected)
