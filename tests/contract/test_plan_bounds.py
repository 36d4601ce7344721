"""Plans are upper bounds, even for adversarial scenes: grass blades, large environments, large textures.

`relume bench plan` gives the figures of ordinary scenes.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from foliage import tuft
from tiny_scenes import quad

from relume.methods.registry import METHODS
from relume.scene.model import Environment, Material, Scene, Texture
from relume.scene.scene_folder import make_scene
from relume.store.bake_protocol import BakeMethod, Recipe
from relume_bench.plan import measure_use
from relume_worker.status import FREE_CAMERA_METHODS

linux = pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="only Linux tells the most memory held")
BLUE = {"model": "lambert", "color": [0.2, 0.3, 0.5], "texture": "diffuse"}


@pytest.fixture(scope="module")
def blades() -> Scene:
    return tuft()


def large_environment() -> Scene:
    """A quad under an environment of 2 million texels."""
    radiance = np.random.default_rng(1).random((1024, 2048, 3), np.float32)
    return _lit_by(radiance, Material("Plain", (BLUE,)))


def large_textures() -> Scene:
    """A quad with 100 MB of textures and normals."""
    pixels = np.random.default_rng(2).random((2, 2048, 2048, 3), np.float32)
    maps = {"diffuse": Texture(pixels[0])}
    return _lit_by(np.ones((8, 16, 3), np.float32), Material("Mapped", (BLUE,), maps, Texture(2 * pixels[1] - 1)))


def _lit_by(radiance: np.ndarray, material: Material) -> Scene:
    floor = quad("floor", [[-9, -1, 9], [9, -1, 9], [9, -1, -9], [-9, -1, -9]], 0)
    return make_scene("Floor", [floor], [material], tuft(1).cameras, Environment("sky", radiance))


def check(method: BakeMethod, scene: Scene, recipe: Recipe) -> dict[str, int]:
    plan, took = method.plan(scene, recipe), measure_use(scene, recipe)
    assert took["view_samples"] <= plan.num_view_samples
    assert took["rays"] <= plan.num_rays
    assert took["store_bytes"] <= plan.store_bytes
    assert took["peak_bytes"] <= plan.peak_bytes
    return took


@linux
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name != "direct")) for name in sorted(METHODS)]
)
def test_tuft_of_blades_stays_below_its_plan(name: str, blades: Scene) -> None:
    took = check(METHODS[name], blades, Recipe(name, ("front",), (16, 16), 40, num_probes=1000))
    if name not in FREE_CAMERA_METHODS:  # nearly every pixel is an edge
        assert took["view_samples"] > 3 * 16 * 16


@linux
@pytest.mark.slow
@pytest.mark.parametrize("name", ["gather", "probes"])
def test_many_patches_and_rays_stay_below_their_plan(name: str, blades: Scene) -> None:
    asked = Recipe(name, ("front",), (16, 16), 40, num_probes=1000, num_patches=4000, gather_rays=1024)
    check(METHODS[name], blades, asked)


@linux
@pytest.mark.slow
@pytest.mark.parametrize("make", [large_environment, large_textures])
def test_environment_and_textures_are_in_the_plan(make: object) -> None:
    check(METHODS["direct"], make(), Recipe("direct", ("front",), (32, 32), 40))  # type: ignore[operator]


@pytest.mark.parametrize("name", sorted(set(METHODS) - FREE_CAMERA_METHODS))
def test_3840_pixel_view_fits_if_one_process_samples_it(name: str, blades: Scene) -> None:
    views = [replace(blades.cameras[0], name=view) for view in ("front", "again")]
    plans = [
        METHODS[name].plan(replace(blades, cameras=views), Recipe(name, view_names, (3840, 2160), 1000))
        for view_names in (("front",), ("front", "again"))
    ]
    assert plans[0].peak_bytes < 9e9
    assert plans[0].peak_bytes - plans[0].lone_bytes < 2e9
    assert plans[0].store_bytes < 25e9
    assert plans[1].lone_bytes == 0  # two processes may sample at once


@pytest.mark.parametrize("name", sorted(METHODS))
def test_scene_data_is_in_the_plan(name: str, blades: Scene) -> None:
    recipe = Recipe(name, ("front",), (32, 32), 40)
    plan = METHODS[name].plan
    larger = replace(blades, environment=Environment("sky", np.ones((512, 1024, 3), np.float32)))
    assert plan(larger, recipe).peak_bytes > plan(blades, recipe).peak_bytes + 512 * 1024 * 12
    mapped = replace(blades.materials[0], normal_map=Texture(np.ones((512, 512, 3), np.float32)))
    assert plan(replace(blades, materials=(mapped,)), recipe).peak_bytes > plan(blades, recipe).peak_bytes + 512**2 * 12
    assert plan(tuft(80_000), recipe).peak_bytes > plan(blades, recipe).peak_bytes + 40_000 * 100
