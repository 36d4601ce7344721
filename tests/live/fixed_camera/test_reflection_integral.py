"""The whole pipeline from a scene to a frame, against the reflection integral over every texel with embreex's rays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy_reference as ref
import pytest
from embreex import rtcore_scene
from embreex.mesh_construction import TriangleMesh
from session_edits import BUDGET, relative_rmse, run_until_exact
from tiny_scenes import still_life

from relume.assets.environments.equirect import texel_directions
from relume.brdf.curves import curve_values
from relume.brdf.registry import TERMS
from relume.core.cache import Cache
from relume.live.fixed_camera.picture import Picture
from relume.live.opened.openers import open_transfer
from relume.look import validate
from relume.methods.registry import METHODS
from relume.raytrace.scene_buffers import build_scene_buffers
from relume.scene.scene_folder import load_scene, save_scene
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

EDITED = {
    "materials": {
        "Floor": {
            "terms": [{"model": "lambert", "color": [0.2, 0.5, 0.4]}, {"model": "ggx", "params": {"roughness": 0.5}}]
        },
        "Wall": {"terms": [{"model": "ashikhmin_shirley", "params": {"nu": 10.0, "nv": 40.0, "f0": 0.3}}]},
        "Ball": {
            "terms": [
                {
                    "model": "cook_torrance",
                    "params": {"sigma": 0.3},
                    "curves": {"theta_h": {"points": [[0, 5], [20, 2], [40, 2.5], [90, 0]], "channels": "r"}},
                }
            ]
        },
    },
    "environment": {"intensity": 1.5, "color": [1.0, 0.8, 0.5]},
}


@pytest.fixture(scope="module")
def scene():
    return still_life()


@pytest.fixture(scope="module")
def transfer(scene, tmp_path_factory):
    """Loaded from the scene folder, as by a worker in another process."""
    folder = tmp_path_factory.mktemp("truth")
    save_scene(scene, folder / "scene")
    recipe = Recipe("direct", ("front",), (48, 36), 1000)
    bake_in_process(METHODS["direct"], load_scene(folder / "scene"), recipe, folder / "s.zarr")
    return open_transfer(folder / "s.zarr", Cache(1 << 30))


def visible_texels(scene, origins, normals, directions):
    """(n, texels) bool"""
    geometry, embreex = build_scene_buffers(scene), rtcore_scene.EmbreeScene()
    TriangleMesh(embreex, geometry.positions[geometry.faces])
    point, texel = np.nonzero(normals @ directions.T > 0)
    visible = np.zeros((len(origins), len(directions)), bool)
    visible[point, texel] = embreex.run(origins[point], directions[texel], query="OCCLUDED") < 0
    return visible


def reference_radiance(scene, transfer, material, rows, look):
    """Radiance of some of a material's samples. (n, 3)"""
    view = transfer.views["front"]
    receivers = view.receivers(material)
    first = view.rows(material).start
    some = replace(receivers.without_light(rows), visible=receivers.visible[rows])
    position = transfer.store.read("views/0/position")[first + rows]
    directions = texel_directions(*scene.environment.radiance.shape[:2]).reshape(-1, 3)
    visible = visible_texels(scene, position, some.normal, directions)
    total = np.zeros((len(rows), 3))
    for document in look.materials[transfer.material_names[material]].terms:
        image = ref.integrate_texels(document, scene.environment.radiance, some, visible) * document["color"]
        image *= transfer.store.read(f"views/0/{document['texture']}")[first + rows]
        for curve in TERMS[document["model"]].curves:
            if curve.depends_on_view:
                image *= curve_values(document, curve, np.arccos(view.cos_theta_o(material)[rows])).T
        total += image
    return np.array(look.environment.gain) * total


@pytest.mark.parametrize(("edit", "bound"), [({}, 0.01), (EDITED, 0.01)], ids=["default", "edited"])
def test_frame_is_the_reflection_integral(scene, transfer, edit, bound):
    look, view = validate(edit, transfer.default_look), transfer.views["front"]
    picture = run_until_exact(Picture(transfer, "front", Cache(BUDGET)))
    picture.set_look(look)
    image = run_until_exact(picture).image().reshape(-1, 3)
    num_samples = np.bincount(view.pixel, minlength=48 * 36)
    weight = np.empty_like(view.throughput)
    weight[view.order] = view.throughput
    actual, expected = [], []
    for material in range(3):
        own = view.rows(material)
        is_whole = np.bincount(view.pixel[own], minlength=48 * 36) == num_samples
        sample_pixels = np.unique(view.pixel[own][is_whole[view.pixel[own]]])[::11]
        assert len(sample_pixels) > 5
        rows = np.nonzero(np.isin(view.pixel[own], sample_pixels))[0]
        fractions = weight[own][rows] * reference_radiance(scene, transfer, material, rows, look)
        pixels = np.zeros_like(image, np.float64)
        np.add.at(pixels, view.pixel[own][rows], fractions)
        actual.append(image[sample_pixels])
        expected.append(pixels[sample_pixels])
        assert relative_rmse(actual[-1], expected[-1]) < 3 * bound
    assert relative_rmse(np.concatenate(actual), np.concatenate(expected)) < bound
