"""Sources of emissive materials, area lights and directional lights: pictures equal those of the reference."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tiny_scenes import quad

from relume.assets.environments.environment import Environment
from relume.core.cache import Cache
from relume.live.fixed_camera.protocols import FixedViewTransfer
from relume.live.opened.openers import open_bake, open_transfer
from relume.look import Look, validate
from relume.look.single_lights import single_lights
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.reference import reference_image
from relume.scene.light_members import members_of
from relume.scene.model import Camera, Light, Material, Scene
from relume.scene.scene_folder import load_scene, make_scene, save_scene
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

NIGHT = Environment("night", np.full((4, 8, 3), 1e-7, np.float32))
SIZE = (18, 18)
LAMBERT = ({"model": "lambert", "color": [0.8, 0.8, 0.8]},)
EMISSIONS = np.array([[4.0, 1.0, 0.5], [0.5, 2.0, 4.0], [1.0, 1.0, 1.0]])
MEAN = EMISSIONS.mean(axis=0)  # of three emitters of one size
SURFACES = {
    "kind": "surfaces",
    "emission": MEAN.tolist(),
    "materials": [[f"Emitter {k}", (rgb / MEAN).tolist()] for k, rgb in enumerate(EMISSIONS)],
}
PANELS = [
    {"kind": "rectangle", "position": [-0.5, 1.2, 0], "direction": [0, -1, 0], "rotation": 0, "size": [0.4, 0.2]},
    {"kind": "disc", "position": [0.5, 1.2, 0], "direction": [0, -1, 0], "radius": 0.2},
    {"kind": "sphere", "position": [0, 1.2, -0.5], "radius": 0.1},
    {"kind": "tube", "position": [0, 1.2, 0.4], "direction": [1, 0, 0], "radius": 0.02, "length": 0.8},
]
DIRECTIONALS = [
    {"kind": "directional", "direction": [0.5, -1, 0], "angle": 0.0},
    {"kind": "directional", "direction": [-0.5, -1, 0.3], "angle": 4.0},
]
RELATIVE = [0.5, 1.0, 1.5, 1.0]
LIGHTS = {
    "surfaces": Light("Source", SURFACES),
    "panels": Light(
        "Source", {"kind": "panels", "source": "Source", "emission": [3.0, 2.0, 1.0]}, "", members_of(PANELS, RELATIVE)
    ),
    "directionals": Light(
        "Source",
        {"kind": "directionals", "source": "Source", "emission": [3.0, 2.0, 1.0]},
        "",
        members_of(DIRECTIONALS, [0.5, 1.5]),
    ),
}


def room(*lights: Light) -> Scene:
    """A floor and three small emitters above it; the camera looks down."""
    floor = quad("floor", [[-1, 0, -1], [-1, 0, 1], [1, 0, 1], [1, 0, -1]], 0)
    emitters = [
        quad(f"emitter {k}", [[x, 0.6, -0.2], [x + 0.3, 0.6, -0.2], [x + 0.3, 0.6, 0.2], [x, 0.6, 0.2]], 1 + k)
        for k, x in enumerate((-0.8, -0.15, 0.5))
    ]
    materials = [Material("Floor", LAMBERT)]
    materials += [Material(f"Emitter {k}", LAMBERT, double_sided=k == 2) for k in range(3)]
    to_world = np.eye(4)
    cosine, sine = np.cos(0.5), np.sin(0.5)
    to_world[1:3, 1:3] = [[cosine, sine], [-sine, cosine]]
    to_world[:3, 3] = [0, 1.9, 3.0]
    return make_scene("room", [floor, *emitters], materials, [Camera("front", to_world, 0.8)], NIGHT, lights=lights)


def opened(light: Light, folder: Any, method: str = "direct") -> tuple[Scene, FixedViewTransfer, Look]:
    save_scene(room(light), folder / "scene")
    scene = load_scene(folder / "scene")
    store = bake_in_process(METHODS[method], scene, Recipe(method, ("front",), SIZE, 200), folder / "a.zarr")
    transfer = open_transfer(store, Cache(1 << 30))
    return scene, transfer, validate({"environment": {"intensity": 0.0}}, transfer.default_look)


def block_means(image: np.ndarray) -> np.ndarray:
    return image.astype(np.float64).reshape(6, 3, 6, 3, 3).mean(axis=(1, 3))


def relative_rmse(image: np.ndarray, reference: np.ndarray) -> float:
    return float(np.sqrt(((image - reference) ** 2).mean() / (reference**2).mean()))


@pytest.mark.parametrize("kind", LIGHTS)
def test_a_source_lights_and_emits_as_its_lights(kind: str, tmp_path: Any) -> None:
    scene, transfer, look = opened(LIGHTS[kind], tmp_path)
    image = block_means(render_image(transfer, "front", look))
    reference = block_means(reference_image(scene, "front", look, SIZE, 64))
    np.testing.assert_allclose(image.mean(axis=(0, 1)), reference.mean(axis=(0, 1)), rtol=0.005)
    assert relative_rmse(image, reference) < 0.015
    single = {"environment": {"intensity": 0.0}, "lights": {"Source": {"enabled": False}}}
    if kind != "surfaces":  # a look cannot add the single meshes of a source
        single["lights"] |= {name: light.model_dump() for name, light in single_lights(scene, look).items()}
        singles = render_image(transfer, "front", validate(single, transfer.default_look))
        assert relative_rmse(image, block_means(singles)) < 0.01


def free_camera_image(folder: Any, *lights: Light) -> np.ndarray:
    recipe = Recipe("probes", ("front",), SIZE, 200, num_probes=1000)
    store = bake_in_process(METHODS["probes"], room(*lights), recipe, folder / f"{len(lights)}.zarr")
    bake = open_bake(store, Cache(1 << 30))
    return block_means(render_image(bake, "front", validate({"environment": {"intensity": 0.0}}, bake.default_look)))


def test_a_free_camera_shows_a_source_as_its_lights(tmp_path: Any) -> None:
    """Direct and indirect light at surface probes, and the surfaces themselves."""
    meshes = [
        Light(f"Emitter {k}", {"kind": "mesh", "material": f"Emitter {k}", "emission": rgb.tolist()})
        for k, rgb in enumerate(EMISSIONS)
    ]
    source, singles = free_camera_image(tmp_path, LIGHTS["surfaces"]), free_camera_image(tmp_path, *meshes)
    assert relative_rmse(source, singles) < 0.01
    assert singles.mean() > 0.02


def test_indirect_light_of_a_source(tmp_path: Any) -> None:
    scene, transfer, look = opened(LIGHTS["surfaces"], tmp_path, "gather")
    image = block_means(render_image(transfer, "front", look))
    reference = block_means(reference_image(scene, "front", look, SIZE, 64, reflects=True))
    np.testing.assert_allclose(image.mean(axis=(0, 1)), reference.mean(axis=(0, 1)), rtol=0.01)
    assert relative_rmse(image, reference) < 0.035  # 2.6 % with three single lights


def test_materials_of_a_source_glow_in_their_own_colors(tmp_path: Any) -> None:
    _, transfer, look = opened(LIGHTS["surfaces"], tmp_path)
    half = validate(
        {"environment": {"intensity": 0.0}, "lights": {"Source": {"intensity": 0.5}}}, transfer.default_look
    )
    np.testing.assert_allclose(
        render_image(transfer, "front", half), 0.5 * render_image(transfer, "front", look), rtol=1e-5
    )
