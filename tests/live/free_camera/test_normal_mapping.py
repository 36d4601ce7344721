"""Normal maps with a free camera, against fixed views, whose samples are lit with their own normals."""

import numpy as np
import pytest
from tiny_scenes import make_camera, make_tiny_scene, quad, studio

from relume.core.cache import Cache
from relume.core.color import LUMINANCE
from relume.live.free_camera.normal_mapping import F32, F64, basis_gradients, light_gradient
from relume.live.opened.openers import open_bake
from relume.look import complete, validate
from relume.math.zernike import NUM_FUNCTIONS, basis_functions
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.probes.stored_scene import StoredScene
from relume.scene.model import Material, Texture
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

WAVES = 4
LAMBERT = ({"model": "lambert", "color": [0.8, 0.7, 0.6]},)
METAL = ({"model": "ggx", "color": [0.9, 0.9, 0.9], "params": {"roughness": 0.25}},)
CAMERA = make_camera("front", [0.4, 1.6, 1.8], [0, 0, 0], 0.35)  # only the floor is visible
SIZE = (64, 48)


def light_gradient_numpy(stored_scene: StoredScene, vectors: F32, probe: int) -> F64:
    """Reference of `light_gradient` for one probe in plain NumPy.

    Args:
        stored_scene, vectors: as there. probe: its index.
    Returns:
        (3,) float64
    """
    n, t = (getattr(stored_scene.probes, name)[probe].astype(np.float64) for name in ("normal", "tangent"))
    luminance = np.asarray(LUMINANCE) @ vectors[probe].astype(np.float64)
    assert luminance.shape == (NUM_FUNCTIONS,)
    return np.asarray((basis_gradients().astype(np.float64) @ luminance) @ np.stack([t, np.cross(n, t), n]))


def waves(size=128, slope=0.35, wrap=("repeat", "repeat")):
    """Normals of a surface that is wavy along u, and half as much along v."""
    v, u = np.mgrid[:size, :size] * 2 * np.pi * WAVES / size
    normals = np.stack([slope * np.sin(u), 0.5 * slope * np.cos(v), np.ones_like(u)], axis=-1)
    return Texture((normals / np.linalg.norm(normals, axis=-1, keepdims=True)).astype(np.float32), wrap)


def floor(terms, normal_map):
    material = Material("Floor", terms, normal_map=normal_map)
    ground = quad("floor", [[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]], 0)
    return make_tiny_scene(ground, camera=CAMERA, environment=studio(64, 20.0), materials=[material])


def picture_of(scene, method, folder):
    recipe = Recipe(method, ("front",), SIZE, 1000, num_probes=2000)
    opened = open_bake(bake_in_process(METHODS[method], scene, recipe, folder / f"{method}.zarr"), Cache(1 << 30))
    return render_image(opened, "front", validate(complete({}, opened.default_look), opened.default_look))


def error(actual, expected):
    """Root mean square error relative to the expected values."""
    return np.sqrt(np.mean((actual - expected) ** 2) / np.mean(expected**2))


@pytest.mark.parametrize(
    ("terms", "at_most"),
    [pytest.param(LAMBERT, 0.02, id="broad"), pytest.param(METAL, 0.04, id="narrow", marks=pytest.mark.slow)],
)
def test_normal_mapped_shading_equals_fixed_views(terms, at_most, tmp_path):
    """The effect of the map is several times the remaining error."""
    bumpy, flat = floor(terms, waves()), floor(terms, None)
    expected = picture_of(bumpy, "direct", tmp_path)
    actual_error = error(picture_of(bumpy, "probes", tmp_path), expected)
    ignored = error(picture_of(flat, "probes", tmp_path / "flat"), expected)
    assert actual_error < at_most
    assert ignored > 4 * actual_error


def test_the_gradient_of_a_few_lights_is_their_mean_direction(tmp_path):
    """D is the sum of w ω for lights well above the horizon, within the accuracy of the basis."""
    rng = np.random.default_rng(4)
    wi = rng.normal(size=(400, 3)) * [0.5, 0.5, 0.2] + [0, 0, 1]
    wi /= np.linalg.norm(wi, axis=1, keepdims=True)
    vectors = np.einsum("s,sk->k", wi[:, 2], basis_functions(wi)) / len(wi)
    np.testing.assert_allclose(basis_gradients() @ vectors, wi.mean(axis=0), atol=0.03)


def test_the_light_gradient_equals_numpy(tmp_path):
    scene = floor(LAMBERT, waves())
    recipe = Recipe("probes", ("front",), (16, 12), 60, num_probes=500)
    surface = open_bake(
        bake_in_process(METHODS["probes"], scene, recipe, tmp_path / "s.zarr"), Cache(1 << 30)
    ).stored_scene
    num = surface.probes.num_points
    vectors = np.random.default_rng(1).normal(size=(num, 3, NUM_FUNCTIONS)).astype(np.float32)
    is_needed = (np.arange(num) % 3 > 0).astype(np.uint8)
    actual = light_gradient(surface, vectors, is_needed)
    expected = np.array([light_gradient_numpy(surface, vectors, point) for point in range(num)])
    np.testing.assert_allclose(actual, expected * is_needed[:, None], atol=1e-4)


def test_scenes_without_normal_maps_store_no_tangents(tmp_path):
    recipe = Recipe("probes", ("front",), (16, 12), 60, num_probes=500)
    store = bake_in_process(METHODS["probes"], floor(LAMBERT, None), recipe, tmp_path / "s.zarr")
    assert open_bake(store, Cache(1 << 30)).stored_scene.tangents.shape == (0, 4)
