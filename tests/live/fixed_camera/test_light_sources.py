"""Many lights as one source: pictures equal the sum of all lights, in fixed views, patches and the reference."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from glb_builder import Glb
from tiny_scenes import make_surface_points

from relume.assets.environments.environment import Environment
from relume.core.cache import Cache
from relume.lights.local_lights import LightPoints, make_light_strata, prepare_local_lights
from relume.live.opened.openers import open_transfer
from relume.look import LightGeometry, validate
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.raytrace.local_light_visibility import compute_irradiance
from relume.reference import reference_image
from relume.scene.model import Scene
from relume.scene.scene_folder import load_scene, save_scene
from relume.scene_io.gltf import import_gltf
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

NIGHT = Environment("night", np.full((4, 8, 3), 1e-7, np.float32))
CANDELA = 683.0  # of 1 W/sr
DOWN = [-np.sqrt(0.5), 0, 0, np.sqrt(0.5)]


def lit_file(num_lights: int) -> tuple[Scene, np.ndarray]:
    """A quad in the plane z = 0, and instances of two lights in front of it; their positions."""
    rng = np.random.default_rng(num_lights)
    positions = rng.uniform((0, 0, 0.3), (1, 1, 1), (num_lights, 3))
    glb = Glb().quad()
    definitions = [
        {"type": "point", "color": [1, 0.5, 0.25], "intensity": CANDELA / num_lights},
        {"type": "spot", "intensity": CANDELA / num_lights, "spot": {"innerConeAngle": 0.5, "outerConeAngle": 1.0}},
    ]
    glb.document["extensions"] = {"KHR_lights_punctual": {"lights": definitions}}
    nodes = [
        {"name": f"node {k} of it", "translation": p.tolist(), "extensions": {"KHR_lights_punctual": {"light": k % 2}}}
        for k, p in enumerate(positions)
    ]
    glb.document["scenes"][0]["nodes"] += range(len(glb.document["nodes"]), len(glb.document["nodes"]) + num_lights)
    glb.document["nodes"] += nodes
    return import_gltf(glb.bytes(), "lights", NIGHT), positions


def expected_irradiance(position: Any, lights: np.ndarray) -> np.ndarray:
    """Irradiance on z = 0 by the formulas of KHR_lights_punctual. (n, 3) W/m²"""
    to_light = lights - np.asarray(position)[:, None]
    distance = np.linalg.norm(to_light, axis=2)
    cosine = to_light[:, :, 2] / distance
    falloff = np.clip((cosine - np.cos(1.0)) / (np.cos(0.5) - np.cos(1.0)), 0, 1) ** 2
    irradiance = cosine / distance**2 / len(lights)
    points, spots = irradiance[:, ::2].sum(axis=1), (irradiance * falloff)[:, 1::2].sum(axis=1)
    return np.outer(points, [1, 0.5, 0.25]) + spots[:, None]


def pixel_centers(scene: Scene, side: int) -> tuple[np.ndarray, np.ndarray]:
    """Mask of pixels well inside the quad, and the points where the rays through their centers meet it."""
    camera = scene.cameras[0]
    edge = np.tan(camera.yfov / 2) * ((np.arange(side) + 0.5) / side * 2 - 1)
    x, y = np.meshgrid(edge, -edge)
    direction = np.stack([x, y, -np.ones_like(x)], axis=-1) @ camera.to_world[:3, :3].T
    origin = camera.to_world[:3, 3]
    position = origin - direction * (origin[2] / direction[..., 2:])
    inside = ((position[..., :2] > 0.15) & (position[..., :2] < 0.85)).all(axis=-1)
    return inside, position[inside]


@pytest.mark.parametrize("num_lights", [65, pytest.param(1000, marks=pytest.mark.slow)])
def test_an_imported_picture_is_lit_by_all_lights_of_the_file(num_lights: int, tmp_path: Any) -> None:
    scene, lights = lit_file(num_lights)
    assert [light.fields["kind"] for light in scene.lights] == ["points", "points"]
    save_scene(scene, tmp_path / "scene")
    scene = load_scene(tmp_path / "scene")
    recipe = Recipe("direct", (scene.cameras[0].name,), (16, 16), 20)
    transfer = open_transfer(bake_in_process(METHODS["direct"], scene, recipe, tmp_path / "a.zarr"), Cache(1 << 30))
    view = transfer.views[scene.cameras[0].name]
    dark = {
        "environment": {"intensity": 0.0},
        "materials": {scene.materials[0].name: {"terms": [{"model": "lambert", "color": [1, 1, 1]}]}},
    }
    look = validate(dark, transfer.default_look)
    image = render_image(transfer, view.name, look)
    inside, position = pixel_centers(scene, 16)
    expected = expected_irradiance(position, lights) / np.pi
    tolerance = 2e-3 if num_lights == 65 else 0.01  # 500 lights a source are more than its 256 samples
    np.testing.assert_allclose(image[inside].mean(axis=0), expected.mean(axis=0), rtol=tolerance)
    reference = reference_image(scene, view.name, look, (16, 16), 1)
    np.testing.assert_allclose(image[inside].mean(axis=0), reference[inside].mean(axis=0), rtol=tolerance)
    half = validate(
        {**dark, "lights": {scene.lights[0].name: {"intensity": 0.5}, scene.lights[1].name: {"enabled": False}}},
        transfer.default_look,
    )
    single = validate({**dark, "lights": {scene.lights[1].name: {"enabled": False}}}, transfer.default_look)
    np.testing.assert_allclose(
        render_image(transfer, view.name, half), 0.5 * render_image(transfer, view.name, single), rtol=1e-5
    )


def test_more_lights_than_samples_are_unbiased() -> None:
    """Members are drawn by intensity: the mean over many points equals the sum over all lights."""
    rng, num = np.random.default_rng(1), 5000
    lights = rng.uniform((-1, 1, -1), (1, 2, 1), (num, 3)).astype(np.float32)
    relative = rng.uniform(0, 2, num).astype(np.float32)
    cone = np.full((num, 2), 180, np.float32)
    light = prepare_local_lights(
        LightGeometry("points", source="A"),
        points=LightPoints(lights, np.tile(np.float32([0, -1, 0]), (num, 1)), cone, relative),
    )
    strata = make_light_strata(light, 64)
    assert strata.uv.shape == (256, 2)
    points = make_surface_points(np.zeros((4096, 3)), np.tile([0.0, 1.0, 0.0], (4096, 1)))
    irradiance = compute_irradiance(light, strata, points, np.full((4096, 32), 255, np.uint8))
    distance = np.linalg.norm(lights, axis=1)
    expected = float((relative * lights[:, 1] / distance**3).sum()) / relative.mean()
    assert irradiance.mean() == pytest.approx(expected, rel=1e-3)
    assert irradiance.std() < 0.05 * expected  # stratified along a curve through space


def test_few_lights_are_summed_exactly_at_each_point() -> None:
    lights = np.array([[0, 1, 0], [1, 2, 0], [0, 1, 3]], np.float32)
    relative = np.array([0.5, 1.0, 1.5], np.float32)
    cone = np.array([[180, 180], [180, 180], [80, 80.01]], np.float32)
    light = prepare_local_lights(
        LightGeometry("points", source="A"), points=LightPoints(lights, -lights, cone, relative)
    )
    points = make_surface_points([[0, 0, 0]], [[0, 1, 0]])
    strata = make_light_strata(light, 16)
    irradiance = compute_irradiance(light, strata, points, np.full((1, 1), 255, np.uint8))
    expected = (relative * lights[:, 1] / np.linalg.norm(lights, axis=1) ** 3).sum()
    np.testing.assert_allclose(irradiance, expected, rtol=1e-5)
