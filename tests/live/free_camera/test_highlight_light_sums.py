"""Outgoing environment light of probes in highlights, summed over visible lights."""

import numpy as np
import pytest
from numpy.typing import NDArray
from tiny_scenes import make_camera, make_tiny_scene, sphere, studio

from relume.brdf.evaluate import eval_brdf
from relume.core.cache import Cache
from relume.lights.sphere_tiles import Tiles
from relume.live.free_camera.basis.highlight_lobes import Lobes, build_lobes
from relume.live.free_camera.basis.lobe_shapes import (
    NUM_AZIMUTHS,
    NUM_GRID_DIRECTIONS,
    NUM_RINGS,
    WIDTHS,
    ring_distances,
)
from relume.live.free_camera.basis.outgoing_coefficients import NUM_ROWS, cosines
from relume.live.free_camera.basis.table_index import MIN_COSINE
from relume.live.free_camera.highlights.light_sum_kernel import (
    F32,
    F64,
    LIGHTS_PER_GROUP,
    EnvironmentLights,
    sum_lights,
)
from relume.live.opened.openers import open_bake
from relume.methods.registry import METHODS
from relume.probes.stored_scene import StoredScene
from relume.scene.model import Material
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

CAMERA = make_camera("front", [0, 0.5, 3], [0, 0, 0], 0.75)
CAMERA_POSITION = np.array([0.4, 1.5, 3.0], np.float32)


def sum_lights_numpy(
    stored_scene: StoredScene,
    visibility_bits: NDArray[np.uint8],
    lights: EnvironmentLights,
    lobes: Lobes,
    camera_position: F32,
    probe: int,
) -> F64:
    """Reference of `sum_lights` for one probe with a lobe in plain NumPy.

    Args:
        stored_scene, visibility_bits, lights, lobes, camera_position: as there. probe: its index.
    Returns:
        (3,) float64
    """
    n, lobe = stored_scene.probes.normal[probe].astype(np.float64), lobes.lobe_index[stored_scene.material[probe]]
    wo = camera_position.astype(np.float64) - stored_scene.probes.position[probe]
    wo /= np.linalg.norm(wo)
    facing = float(np.clip(n @ wo, MIN_COSINE, 1))
    row_coordinate = np.sqrt(1 - facing) * (NUM_ROWS - 1)
    row = min(int(row_coordinate), NUM_ROWS - 2)
    table = (1 - (row_coordinate - row)) * lobes.shape[lobe, row] + (row_coordinate - row) * lobes.shape[lobe, row + 1]
    table = table.astype(np.float64).reshape(len(WIDTHS), NUM_RINGS, NUM_AZIMUTHS)
    mirror = 2 * facing * n - wo
    across = n - facing * mirror
    across /= max(float(np.linalg.norm(across)), 1e-6)
    bits = np.unpackbits(visibility_bits[probe], bitorder="little")[: len(lights.table) // 4]
    nibbles = np.pad(bits, (0, -len(bits) % LIGHTS_PER_GROUP)).reshape(-1, LIGHTS_PER_GROUP) @ (
        1 << np.arange(LIGHTS_PER_GROUP)
    )
    light_indices = (16 * np.arange(len(nibbles)) + nibbles)[nibbles > 0]
    wi, irradiance = np.split(lights.lights[light_indices].astype(np.float64), 2, axis=1)
    x = np.clip(2 - 2 * wi @ mirror, ring_distances()[0], 4)
    psi = np.arccos(np.clip(wi @ across / np.sqrt(np.maximum(x * (1 - x / 4), 1e-12)), -1, 1))
    half = (wi @ n + facing) / np.linalg.norm(wi + wo, axis=1)
    ring = np.interp(x, ring_distances(), np.arange(NUM_RINGS))
    spoke = np.clip(psi / np.pi * NUM_AZIMUTHS - 0.5, 0, NUM_AZIMUTHS - 1)
    r, s = np.minimum(ring.astype(int), NUM_RINGS - 2), np.minimum(spoke.astype(int), NUM_AZIMUTHS - 2)
    fr, fs, width = ring - r, spoke - s, lights.table[light_indices] // NUM_GRID_DIRECTIONS
    lower = (1 - fs) * table[width, r, s] + fs * table[width, r, s + 1]
    upper = (1 - fs) * table[width, r + 1, s] + fs * table[width, r + 1, s + 1]
    values = ((1 - fr) * lower + fr * upper) / (np.maximum(2 - 2 * half, 0) + lobes.flatness[lobe]) ** 2
    return np.asarray(values @ irradiance)


def document(model, **params):
    return {"model": model, "color": [1.0, 1.0, 1.0], "texture": None, "params": params, "curves": {}}


@pytest.fixture(scope="module")
def surface(tmp_path_factory):
    material = Material("Ball", ({"model": "lambert", "color": [1.0, 1.0, 1.0]},))
    ball = sphere("ball", [0, 0, 0], 1, 0, 24)
    scene = make_tiny_scene(ball, camera=CAMERA, environment=studio(64, 20.0), materials=[material])
    store = tmp_path_factory.mktemp("ball") / "probes.zarr"
    bake_in_process(METHODS["probes"], scene, Recipe("probes", ("front",), (32, 24), 500, num_probes=300), store)
    return open_bake(store, Cache(1 << 30)).stored_scene


def lights_of(rng, num, radius):
    """Four neighboring lights, one after another."""
    towards = np.repeat(rng.normal(size=(num // 4, 3)), 4, axis=0)
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    towards += rng.normal(scale=0.01, size=(num, 3))
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    light = rng.uniform(0, 2, (num, 3)).astype(np.float32)
    return towards.astype(np.float32), light, np.broadcast_to(np.float32(radius), num)


def facing(surface, least):
    """Probes that face the camera at no grazing angle."""
    towards = CAMERA_POSITION - surface.probes.position
    cosine = np.einsum("pk,pk->p", surface.probes.normal, towards) / np.linalg.norm(towards, axis=1)
    return np.flatnonzero(cosine > least)


@pytest.mark.parametrize("term", [document("ggx", roughness=0.4, f0=0.9), document("blinn_phong", exponent=400.0)])
def test_the_kernel_equals_its_reference(surface, term):
    rng, num = np.random.default_rng(5), surface.probes.num_points
    lobes = build_lobes([[term]])
    lights = EnvironmentLights.from_lights(*lights_of(rng, 152, rng.uniform(0, 0.3, 152)))
    visible = rng.integers(0, 256, (num, 19)).astype(np.uint8)
    is_needed = (np.arange(num) % 3 > 0).astype(np.uint8)
    actual = sum_lights(surface.viewed_from(CAMERA_POSITION, is_needed), visible, lights, lobes)
    assert not actual[is_needed == 0].any()
    for point in np.flatnonzero(is_needed)[::7]:
        expected = sum_lights_numpy(surface, visible, lights, lobes, CAMERA_POSITION, point)
        np.testing.assert_allclose(actual[point], expected, rtol=2e-3, atol=2e-3 * np.abs(actual).max())


@pytest.mark.parametrize(
    "term",
    [
        document("ggx", roughness=0.6, f0=0.9),
        document("ggx", roughness=0.4, f0=0.04),
        document("cook_torrance", sigma=0.35),
        document("ggx", roughness=0.5, f0=0.5),
    ],
)
def test_wide_highlights_are_sums_of_the_brdf_over_lights(surface, term):
    """Small lights, some of them visible, against the terms themselves."""
    rng, num, lobes = np.random.default_rng(6), surface.probes.num_points, build_lobes([[term]])
    assert not lobes.lobe_confidence[0, cosines() > 0.4].any()
    towards, light, radius = lights_of(rng, 400, 0.01)
    bits = rng.integers(0, 256, (num, 50)).astype(np.uint8)
    viewed = surface.viewed_from(CAMERA_POSITION, np.ones(num, np.uint8))
    actual = sum_lights(viewed, bits, EnvironmentLights.from_lights(towards, light, radius), lobes)
    difference, size = [], []
    for point in facing(surface, 0.4):
        n, t = surface.probes.normal[point], surface.probes.tangent[point, :3]
        to_local = np.stack([t, np.cross(n, t), n]).astype(np.float64)
        wo = to_local @ (CAMERA_POSITION - surface.probes.position[point])
        wi = towards @ to_local.T
        outgoing = eval_brdf(term, wi, wo / np.linalg.norm(wo)) * np.maximum(wi[:, 2:], 0)
        expected = np.unpackbits(bits[point], bitorder="little") @ (outgoing * light)
        row = np.sqrt(1 - wo[2] / np.linalg.norm(wo)) * (lobes.albedo.shape[1] - 1)
        albedo = np.interp(row, np.arange(lobes.albedo.shape[1]), lobes.albedo[0, :, 0, 0])
        difference.append(albedo * actual[point] - expected)
        size.append(expected)
    assert np.sqrt(np.mean(np.square(difference)) / np.mean(np.square(size))) < 0.03


@pytest.mark.parametrize("roughness", [0.02, 0.1, 0.25])
def test_a_white_environment_preserves_energy(surface, roughness):
    """Lights as wide as those of a bake; the lobes' share of the environment is one."""
    num, lobes = surface.probes.num_points, build_lobes([[document("ggx", roughness=roughness, f0=0.9)]])
    tiles = Tiles(np.arange(8 << 8, 16 << 8, dtype=np.uint64))
    light = np.broadcast_to(tiles.solid_angles[:, None], (2048, 3)).astype(np.float32)
    radius = np.linalg.norm(tiles.corners[:, 0] - tiles.centroids, axis=1)
    lights = EnvironmentLights.from_lights(tiles.centroids.astype(np.float32), light, radius.astype(np.float32))
    viewed = surface.viewed_from(CAMERA_POSITION, np.ones(num, np.uint8))
    summed = sum_lights(viewed, np.full((num, 256), 255, np.uint8), lights, lobes)
    ratios = []
    for point in facing(surface, 0.4)[::1]:
        wo = CAMERA_POSITION - surface.probes.position[point]
        row = np.sqrt(1 - surface.probes.normal[point] @ wo / np.linalg.norm(wo)) * (lobes.lobe_confidence.shape[1] - 1)
        believed = np.interp(row, np.arange(lobes.lobe_confidence.shape[1]), lobes.lobe_confidence[0])
        ratios.append(believed + summed[point, 0])
    np.testing.assert_allclose(ratios, 1, atol=0.11)
    assert np.sqrt(np.mean(np.square(np.subtract(ratios, 1)))) < 0.05
