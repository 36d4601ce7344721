"""A scene of any size, anywhere, has the same picture; lights, glass and cameras are scaled with it.

A power of two scales every float exactly, so that the pictures must be equal; a constant in meters would change them.
Far from the origin positions have few digits left.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from session_edits import make_look, relative_rmse
from shared_bakes import unmeasured
from tiny_scenes import make_camera, make_tiny_scene, quad, sphere, studio

from relume.core.cache import Cache
from relume.live.opened.openers import open_bake
from relume.look import validate
from relume.look.document import default_look
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.reference.image import reference_image
from relume.scene.model import Glass, Light, Material
from relume.scene.scene_folder import make_scene
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

__all__ = ["unmeasured"]  # a fixture

SIZE = 24, 18
SMALL, LARGE = 2.0**-14, 2.0**14  # 6e-5 and 16,384


@pytest.fixture(scope="module")
def scene():
    """A floor with a ball and a card on edge, a mirror, a solid of glass, and lights of all kinds."""
    mirror = {"model": "ggx", "color": [0.9] * 3, "params": {"roughness": 0.03, "f0": 0.9}}
    materials = [
        Material("Floor", ({"model": "lambert", "color": [0.7, 0.7, 0.7]},)),
        Material("Ball", ({"model": "lambert", "color": [0.2, 0.3, 0.7]}, {"model": "ggx", "color": [1.0] * 3,
                          "params": {"roughness": 0.1, "f0": 0.05}})),
        Material("Mirror", (mirror,)),
        Material("Glass", ({"model": "lambert", "color": [0.0] * 3},), glass=Glass((0.9, 0.9, 1), 1.5, 0.3, (1, 2, 3))),
        Material("Lamp", ({"model": "lambert", "color": [0.5] * 3},), double_sided=False),
    ]  # fmt: skip
    meshes = [
        quad("floor", [[-2, 0, 2], [2, 0, 2], [2, 0, -2], [-2, 0, -2]], 0),
        quad("card", [[-0.9, 0, 0.3], [-0.3, 0, 0.6], [-0.3, 0.7, 0.6], [-0.9, 0.7, 0.3]], 0),
        sphere("ball", [0, 0.4, 0], 0.4, 1),
        quad("mirror", [[-1.2, 0, -1], [1.2, 0, -0.8], [1.2, 1.5, -0.9], [-1.2, 1.5, -1.1]], 2),
        sphere("solid", [0.8, 0.3, 0.3], 0.25, 3),
        quad("lamp", [[-0.2, 1.6, -0.2], [0.2, 1.6, -0.2], [0.2, 1.6, 0.2], [-0.2, 1.6, 0.2]], 4),
    ]
    camera = make_camera("front", (0.7, 1.3, 2.6), (0, 0.4, 0), 0.8)
    lights = [
        Light("Lamp", {"kind": "mesh", "material": "Lamp", "emission": [8.0, 7.0, 5.0]}),
        Light("Bulb", {"kind": "point", "position": [-0.2, 0.2, 0.7], "emission": [0.01, 0.01, 0.014]}),
        Light("Panel", {"kind": "rectangle", "position": [1.5, 1.2, 0.8], "direction": [-1.0, -0.8, -0.5],
                        "size": [1.0, 0.9], "emission": [0.2, 0.4, 0.2]}),
    ]  # fmt: skip
    made = make_tiny_scene(*meshes, camera=camera, environment=studio(), materials=materials)
    return make_scene("scale", made.meshes, made.materials, made.cameras, made.environment, lights=lights)


def placed(scene, scale, offset=0.0):
    """The scene, scaled and moved along the diagonal, with the random numbers of the original."""

    def move(position):
        return scale * np.asarray(position, np.float64) + offset / np.sqrt(3)

    def light(fields):
        moved = dict(fields)
        if "position" in fields:
            moved["position"] = move(fields["position"]).tolist()
        if "size" in fields:
            moved["size"] = [scale * side for side in fields["size"]]
        if fields["kind"] == "point":  # the irradiance falls with the squared distance
            moved["emission"] = [scale**2 * channel for channel in fields["emission"]]
        return moved

    cameras = []
    for camera in scene.cameras:
        to_world = camera.to_world.copy()
        to_world[:3, 3] = move(to_world[:3, 3])
        cameras.append(replace(camera, to_world=to_world))
    materials = [
        replace(m, glass=m.glass and replace(
            m.glass, thickness=scale * m.glass.thickness, absorbed=tuple(a / scale for a in m.glass.absorbed)))
        for m in scene.materials
    ]  # fmt: skip
    meshes = [replace(mesh, positions=move(mesh.positions).astype(np.float32)) for mesh in scene.meshes]
    lights = [replace(each, fields=light(each.fields)) for each in scene.lights]
    return replace(make_scene(scene.name, meshes, materials, cameras, scene.environment, lights=lights), id=scene.id)


def picture(scene, method, folder):
    """The picture of a bake, by a method that has no other scene of this id in its memory."""
    recipe = Recipe(method, ("front",), SIZE, 100, num_probes=500, num_patches=200, gather_rays=64)
    bake = open_bake(bake_in_process(type(METHODS[method])(), scene, recipe, folder / "store.zarr"), Cache(1 << 28))
    return render_image(bake, "front", make_look(bake))


@pytest.fixture(scope="module")
def originals(scene, tmp_path_factory):
    """The pictures of the scene by each method."""
    return {method: picture(scene, method, tmp_path_factory.mktemp(method)) for method in METHODS}


@pytest.mark.parametrize(("method", "scale"), [("direct", LARGE), ("gather", SMALL), ("probes", LARGE)])
def test_the_picture_is_the_same_at_any_scale(scene, originals, method, scale, tmp_path):
    image = picture(placed(scene, scale), method, tmp_path)
    # compilers may round sums of local lights differently; the largest differences are in narrow highlights
    np.testing.assert_allclose(image, originals[method], rtol=5e-3)
    assert relative_rmse(image, originals[method]) < 1e-4


@pytest.mark.parametrize("method", [method for method in METHODS if method != "probes"])
def test_the_picture_is_the_same_far_from_the_origin(scene, originals, method, tmp_path):
    """At 1000 times its size, positions are 6e-5 of the size apart, and shadow edges move by about as much."""
    assert originals[method].mean() > 0.1
    assert relative_rmse(picture(placed(scene, 1.0, 4e3), method, tmp_path), originals[method]) < 0.04


def test_probes_far_from_the_origin_are_as_close_to_the_exact_picture(scene, originals, tmp_path):
    """Few probes are elsewhere if positions are rounded, and so are the shadows between them."""
    exact = originals["gather"]
    near, far = originals["probes"], picture(placed(scene, 1.0, 4e3), "probes", tmp_path)
    assert relative_rmse(near, exact) < 0.3
    assert relative_rmse(far, exact) < 1.2 * relative_rmse(near, exact)


def test_the_reference_is_the_same_at_any_scale(scene):
    pictures = []
    for scale in (1.0, SMALL, LARGE):
        sized = placed(scene, scale)
        document = default_look(sized.materials, sized.lights)
        pictures.append(reference_image(sized, "front", validate(document, document), SIZE, 8, reflects=True))
    np.testing.assert_array_equal(pictures[1], pictures[0])
    np.testing.assert_array_equal(pictures[2], pictures[0])
